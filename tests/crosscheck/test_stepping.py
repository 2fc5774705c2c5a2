"""Stepping between samples / closed forms: the integrators run outside the engines."""

import numpy as np
import pytest
from scipy.integrate import DOP853

from crosscheck.engines.shared.sampling import JUMPS, Adaptive, Counts, Failed, rk4, step_count
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
    """x = cos 5 t, in intervals of 0.7, 0.001 and 2.299 s."""
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


def test_noise_in_one_stage_of_the_shortest_step_is_stepped_over() -> None:
    """y' = 1, except for 1e9 where the sixth stage of the first, shortest step evaluates it: y(1) is 1. The
    lengths of JUMPS are tried there, and each counts as a rejected step; no other step meets the noise."""
    shortest = 1e-3
    noisy = DOP853.C[5] * shortest

    def rhs(t: float, y: np.ndarray) -> np.ndarray:
        return np.array([1.0 if abs(y[0] - noisy) > 1e-9 else 1e9])

    stepper = adaptive(rhs, 1e-12, min_step=shortest)
    y = stepper.advance(np.zeros(1), 0.0, 1.0)
    assert stepper.counts.rejected == len(JUMPS), f"{stepper.counts}"
    assert abs(y[0] - 1.0) < 1e-12, f"y(1) = {y[0]}, expected 1"  # tolerance


def test_noise_where_a_shortest_step_is_corrected_does_not_spoil_the_result() -> None:
    """y' = 1, except for 1e9 just where the first, shortest step is corrected. Each step is corrected by
    1e-9: y(1) is 1 and 1e-9 a step, to rounding."""
    shortest, moved = 1e-3, 1e-9

    def rhs(t: float, y: np.ndarray) -> np.ndarray:
        return np.array([1.0 if abs(y[0] - shortest - moved) > moved / 2 else 1e9])

    stepper = Adaptive(rhs, lambda t, y: y + moved, 1e-6, shortest, np.inf, Counts())
    y = stepper.advance(np.zeros(1), 0.0, 1.0)
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
    """On x = cos 5 t over 1 s, whose length is no multiple of the steps of 11 and 5.5 ms. Errors of the next
    order leave the measured order within 0.2 of 4."""
    steps, errors = (0.011, 0.0055), []
    for h in steps:
        counts = Counts()
        y = rk4(oscillator, lambda t, y: y, cosine(0.0), 0.0, 1.0, h, counts)
        errors.append(abs(y - cosine(1.0)).max())
        assert counts.steps == step_count(0.0, 1.0, h) and counts.rhs == 4 * counts.steps, f"{counts}"
    order = np.log2(errors[0] / errors[1])
    assert 3.8 < order < 4.2, f"errors {errors} of steps {steps}: order {order:.2f}"
