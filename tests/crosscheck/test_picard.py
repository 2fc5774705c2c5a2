"""The solver of the truths against solutions known in closed form."""

from concurrent.futures import ThreadPoolExecutor
from time import sleep

import numpy as np
import pytest

from crosscheck.judge.truth import picard
from crosscheck.judge.truth.picard import NoSolution, Solution


def test_equations_of_motion_that_end_say_so():
    solution = Solution(lambda y: y**2, np.array([1.0]), 0.1)
    assert abs(solution(np.array([0.9]))[0, 0] - 10) < 1e-12
    with pytest.raises(NoSolution, match=r"t = (1|0\.99999)"):
        solution(np.array([1.1]))


def test_panels_reach_rounding_error_over_many_periods():
    t = np.linspace(0, 300.0, 50)
    got = Solution(lambda y: np.stack([y[:, 1], -y[:, 0]], axis=1), np.array([0.0, 1.0]), 0.1)(t)
    off = np.abs(got[:, 0].astype(float) - np.sin(t)).max()
    assert off < 1e-14, f"sine off by {off} after {t[-1]} rad"


def test_threads_that_ask_at_once_get_the_same_states():
    """Runs of a study share the truth of a scene; at every call of f here another thread goes on."""

    def derivative(y):
        sleep(0)
        return np.stack([y[:, 1], -np.sin(y[:, 0])], axis=-1)

    times, start = np.linspace(0.0, 20.0, 41), np.array([1.0, 0.0])
    alone, shared = (Solution(derivative, start, 0.3) for _ in range(2))
    with ThreadPoolExecutor(8) as threads:
        answers = list(threads.map(lambda _: shared(times), range(8)))
    for answer in answers:
        np.testing.assert_array_equal(answer, alone(times))


def with_sweeps(*sweeps: tuple[bool, int], first: float = 1.0) -> picard.Solution:
    """A solution whose panels converge or not after so many sweeps."""
    made = picard.Solution(lambda y: y, np.ones(1), first)
    left = iter(sweeps)

    def sweep(length: np.floating) -> tuple[np.ndarray | None, int]:
        converges, count = next(left)
        return (np.full((picard.NODES, 1), 7.0) if converges else None), count

    made._sweep = sweep  # type: ignore[method-assign]
    return made


def test_lengths_of_panels():
    """Less than 20 sweeps lengthen the next panel by a fifth; a panel that does not converge is shortened."""
    made = with_sweeps((True, 19), (True, 20), (False, 60), (False, 5), (True, 3))
    for _ in range(3):
        made._add_panel()
    lengths = np.diff(np.array(made._edges, dtype=float))
    assert lengths == pytest.approx([1.0, 1.2, 1.2 * 0.7 * 0.7])
    assert float(made._next) == pytest.approx(1.2 * 0.49 * 1.2) and made._state.tolist() == [7.0]


@pytest.mark.parametrize(("first", "tries"), [(1.5e-15, 1), (2.0e-15, 2)])
def test_a_panel_too_short_ends_the_solution(first, tries):
    """Below 1e-12 of the time, which is at least 1e-3: 0.7 · 1.5e-15 is enough, 0.49 · 1.5e-15 is not."""
    made = with_sweeps(*[(False, 1)] * 9, first=first)
    with pytest.raises(NoSolution, match="the solution ends at t = 0"):
        made._add_panel()
    assert float(made._next) == pytest.approx(first * 0.7 ** (tries + 1), rel=1e-6)


def test_polynomials_between_chebyshev_points():
    """Integrals from -1, coefficients and values of x³ at the nodes."""
    x = picard._nodes()
    integrate, series = picard._matrices()
    assert x[[0, -1]].tolist() == [-1.0, 1.0] and (np.diff(x) > 0).all() and len(x) == 64
    assert np.abs(integrate @ x**3 - (x**4 - 1) / 4).max() < 1e-17
    assert np.abs(integrate @ np.ones(64) - (x + 1)).max() < 1e-17
    found = series @ x**3
    assert (
        found[[1, 3]].astype(float) == pytest.approx([0.75, 0.25])
        and np.abs(np.delete(found, [1, 3])).max() < 1e-17
    )
    points = np.array([-1.0, -0.3, 0.2, float(x[5]), 1.0], dtype=picard.REAL)
    assert np.abs(picard._cardinal(points) @ x**3 - points**3).max() < 1e-17


def test_times_at_which_a_component_has_a_value():
    """y' = (1, 2 y₀): the first grows as t, the second as t²."""
    made = picard.Solution(lambda y: np.stack([np.ones_like(y[:, 0]), 2 * y[:, 0]], axis=1), np.zeros(2), 0.5)
    assert made.where(1, np.array([0.25, 4.0])).astype(float) == pytest.approx(
        np.array([[0.5, 0.25], [2.0, 4.0]])
    )
    end = made.reach(lambda y: y[0] >= 3.0)
    assert end[0] >= 3.0 and float(end[1]) == pytest.approx(float(end[0]) ** 2)
    assert made(np.array([0.0, 1.5])).astype(float) == pytest.approx(np.array([[0, 0], [1.5, 2.25]]))
