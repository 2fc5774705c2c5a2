"""Picard's iteration, by which the judge integrates its truths / solutions in closed form."""

from concurrent.futures import ThreadPoolExecutor
from time import sleep

import numpy as np
import pytest

from crosscheck.judge.truth.picard import NoSolution, Solution


def test_solution_with_a_pole_ends_at_the_pole():
    """y' = y², y(0) = 1: y = 1 / (1 - t) is 10 at 0.9, to rounding, and has no value at 1.1; the solution
    ends at its pole t = 1, found to 1e-5."""
    solution = Solution(lambda y: y**2, np.array([1.0]), 0.1)
    assert abs(solution(np.array([0.9]))[0, 0] - 10) < 1e-12
    with pytest.raises(NoSolution) as ended:
        solution(np.array([1.1]))
    assert ended.value.until == pytest.approx(1.0, abs=1e-5)


def test_panels_reach_rounding_error_over_many_periods():
    """y'' = -y from (0, 1) is the sine. Over 48 periods it is off by less than 1e-14, 50 roundings of
    doubles; the solver computes in extended precision."""
    t = np.linspace(0, 300.0, 50)
    got = Solution(lambda y: np.stack([y[:, 1], -y[:, 0]], axis=1), np.array([0.0, 1.0]), 0.1)(t)
    assert np.abs(got[:, 0].astype(float) - np.sin(t)).max() < 1e-14


def test_threads_that_share_a_solution_get_the_states_of_one_thread():
    """Eight threads evaluate one solution, as runs of a study do, and the derivative yields to another thread
    at every call. Their states equal the states of a solution in one thread, to the last bit."""

    def derivative(y):
        sleep(0)
        return np.stack([y[:, 1], -np.sin(y[:, 0])], axis=-1)

    times, start = np.linspace(0.0, 20.0, 41), np.array([1.0, 0.0])
    alone, shared = (Solution(derivative, start, 0.3) for _ in range(2))
    with ThreadPoolExecutor(8) as threads:
        answers = list(threads.map(lambda _: shared(times), range(8)))
    for answer in answers:
        np.testing.assert_array_equal(answer, alone(times))


def parabola() -> Solution:
    """The solution of y' = (1, 2 y₀) from zero: y = (t, t²)."""
    return Solution(lambda y: np.stack([np.ones_like(y[:, 0]), 2 * y[:, 0]], axis=1), np.zeros(2), 0.5)


def test_solution_finds_the_states_at_which_a_component_has_given_values():
    """y₁ = t² is 0.25 at t = y₀ = 0.5, and 4 at 2."""
    found = parabola().where(1, np.array([0.25, 4.0])).astype(float)
    assert found == pytest.approx(np.array([[0.5, 0.25], [2.0, 4.0]]))


def test_solution_is_continued_until_its_state_meets_a_condition():
    """The returned state (t, t²) has y₀ ≥ 3."""
    end = parabola().reach(lambda y: y[0] >= 3.0)
    assert end[0] >= 3.0 and float(end[1]) == pytest.approx(float(end[0]) ** 2)
