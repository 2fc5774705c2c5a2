"""Integrators outside the engines, and the judge's Picard iteration, against closed forms."""

import math
from concurrent.futures import ThreadPoolExecutor
from time import sleep

import numpy as np
import pytest
from scipy.integrate import DOP853

from crosscheck.engines.shared.sampling import JUMPS, Adaptive, Counts, Failed, rk4
from crosscheck.judge.truth.picard import NoSolution, Solution
from mbref.motions.trajectory import Outcome


def oscillator(t: float, y: np.ndarray) -> np.ndarray:
    """x'' = -25 x, from x = 1 at rest: x = cos 5t."""
    return np.array([y[1], -25 * y[0]])


def cosine(t: float) -> np.ndarray:
    return np.array([np.cos(5 * t), -5 * np.sin(5 * t)])


def adaptive(rhs, rtol: float = 1e-9, **options) -> Adaptive:
    limits = {"min_step": 1e-4, "max_step": np.inf} | options
    return Adaptive(rhs, None, rtol, limits["min_step"], limits["max_step"], Counts())


@pytest.mark.parametrize("rtol", [1e-4, 1e-7, 1e-10])
def test_adaptive_steps_stay_within_ten_tolerances_of_the_cosine(rtol: float) -> None:
    """The equation of x = cos 5 t is integrated over 0.7, 0.001 and 2.299 s."""
    stepper, y = adaptive(oscillator, rtol), cosine(0.0)
    for t0, t1 in ((0.0, 0.7), (0.7, 0.701), (0.701, 3.0)):
        y = stepper.advance(y, t0, t1)
        assert abs(y - cosine(t1)).max() < 10 * rtol


def test_every_evaluation_of_dop853_is_counted() -> None:
    """DOP853 evaluates 12 times a step, taken or rejected, and once at the start."""
    calls = 0

    def counted(t: float, y: np.ndarray) -> np.ndarray:
        nonlocal calls
        calls += 1
        return oscillator(t, y)

    stepper = adaptive(counted)
    stepper.advance(cosine(0.0), 0.0, 2.0)
    expected = 12 * (stepper.counts.steps + stepper.counts.rejected) + 1
    assert stepper.counts.rhs == calls == expected, f"{calls} calls, {stepper.counts}, expected {expected}"


SHORTEST, MOVED = 1e-3, 1e-9  # s, and the correction of a state


@pytest.mark.parametrize(
    ("noisy", "moved", "rtol"),
    [
        pytest.param(DOP853.C[5] * SHORTEST, 0.0, 1e-12, id="in a stage"),
        pytest.param(SHORTEST + MOVED, MOVED, 1e-6, id="where the step is corrected"),
    ],
)
def test_noise_in_the_shortest_step_is_stepped_over(noisy: float, moved: float, rtol: float) -> None:
    """y' is 1, but 1e9 at the state of the sixth stage of the first, shortest step, or at the state to which
    this step is corrected: the change of slope by the correction counts as an error of the step. There
    the integrator tries the lengths of JUMPS, each of which is a rejected step. No other step is noisy. Each
    correction adds ``moved`` to y, so that y(1) is 1 plus ``moved`` for each step, to rounding."""

    def rhs(t: float, y: np.ndarray) -> np.ndarray:
        return np.array([1.0 if abs(y[0] - noisy) > MOVED / 2 else 1e9])

    correct = (lambda t, y: y + moved) if moved else None
    stepper = Adaptive(rhs, correct, rtol, SHORTEST, np.inf, Counts())
    y = stepper.advance(np.zeros(1), 0.0, 1.0)
    assert stepper.counts.rejected == len(JUMPS), f"{stepper.counts}"
    assert abs(y[0] - 1.0 - moved * stepper.counts.steps) < 1e-12


def test_failed_correction_of_a_state_ends_the_run_with_its_reason() -> None:
    """The correction after a step raises Failed with outcome NOT_CONVERGED and "no way"; so does the run."""

    def refuse(t: float, y: np.ndarray) -> np.ndarray:
        raise Failed(Outcome.NOT_CONVERGED, t, "no way")

    with pytest.raises(Failed, match="no way") as failure:
        Adaptive(oscillator, refuse, 1e-6, 1e-3, np.inf, Counts()).advance(cosine(0.0), 0.0, 1.0)
    assert failure.value.outcome is Outcome.NOT_CONVERGED


def test_noise_over_an_interval_near_the_shortest_step_is_stepped_over() -> None:
    """The interval is 1.005 shortest steps and every slope is noise of ±1000: fewer than 1000 evaluations
    suffice, where one step could be tried again without end."""
    shortest, calls = 1e-3, 0

    def rhs(t: float, y: np.ndarray) -> np.ndarray:
        nonlocal calls
        calls += 1
        assert calls < 1000, "the same step is tried again and again"
        return np.array([1.0 + 1e3 * (-1) ** calls])

    y = adaptive(rhs, 1e-12, min_step=shortest).advance(np.zeros(1), 0.0, 1.005 * shortest)
    assert np.isfinite(y).all(), y


def test_motion_that_is_not_finite_after_half_a_second_fails_there() -> None:
    """y' = 1 + 0 · √(0.5 - t) is NaN from t = 0.5 s on; the last finite state is within 0.05 s before it."""

    def rhs(t: float, y: np.ndarray) -> np.ndarray:
        with np.errstate(all="ignore"):
            return np.sqrt(0.5 - np.array([t])) * 0 + 1

    with pytest.raises(Failed, match="not finite after") as failure:
        adaptive(rhs).advance(np.zeros(1), 0.0, 1.0)
    assert failure.value.outcome is Outcome.NOT_FINITE, f"{failure.value.outcome}"
    assert 0.45 < failure.value.t <= 0.5, f"reached {failure.value.t}, the right-hand side ends at 0.5"


def test_rk4_has_fourth_order_and_divides_the_interval_evenly() -> None:
    """Steps of at most 11 and 5.5 ms divide 1 s into 91 and 182 equal ones, of length h. A step on y' = A y,
    x = cos 5 t, is by definition a product with Σ (h A)ᵏ / k! up to k = 4, to rounding (1e-12). Errors of the
    next order leave the measured order within 0.2 of 4."""
    steps, errors, matrix = {0.011: 91, 0.0055: 182}, [], np.array([[0.0, 1.0], [-25.0, 0.0]])
    for longest, n in steps.items():
        counts = Counts()
        y = rk4(oscillator, lambda t, y: y, cosine(0.0), 0.0, 1.0, longest, counts)
        errors.append(abs(y - cosine(1.0)).max())
        assert counts.steps == n and counts.rhs == 4 * n, f"{counts}"
        step = sum(np.linalg.matrix_power(matrix / n, k) / math.factorial(k) for k in range(5))
        assert y == pytest.approx(np.linalg.matrix_power(step, n) @ cosine(0.0), abs=1e-12)
    order = np.log2(errors[0] / errors[1])
    assert 3.8 < order < 4.2, f"errors {errors} of steps {steps}: order {order:.2f}"


def test_solution_with_a_pole_ends_at_the_pole():
    """y' = y², y(0) = 1: y = 1 / (1 - t) is 10 at 0.9, and the solution ends at t = 1, to 1e-5."""
    solution = Solution(lambda y: y**2, np.array([1.0]), 0.1)
    assert abs(solution(np.array([0.9]))[0, 0] - 10) < 1e-12
    with pytest.raises(NoSolution) as ended:
        solution(np.array([1.1]))
    assert ended.value.until == pytest.approx(1.0, abs=1e-5)


def test_picards_panels_are_exact_to_rounding_over_many_periods():
    """``Solution`` iterates by Picard's method on panels of time. For y'' = -y from (0, 1) it is the sine
    over 48 periods to 1e-14, 50 roundings of doubles, as it computes in extended precision."""
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


def test_solution_is_continued_until_its_state_meets_a_condition():
    """The returned state (t, t²) has y₀ ≥ 3."""
    end = parabola().reach(lambda y: y[0] >= 3.0)
    assert end[0] >= 3.0 and float(end[1]) == pytest.approx(float(end[0]) ** 2)
