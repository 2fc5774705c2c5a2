"""Stepping between samples / closed forms: the integrators run outside the engines."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import DOP853

from crosscheck.engines.driver_motion import fastest_rate
from crosscheck.engines.sampling import Adaptive, Counts, Failed, rk4, step_count
from mbref.scene import Scene
from mbref.trajectory import Outcome, Trajectory


def oscillator(t: float, y: np.ndarray) -> np.ndarray:
    """x'' = -25 x, from x = 1 at rest: x = cos 5t."""
    return np.array([y[1], -25 * y[0]])


def cosine(t: float) -> np.ndarray:
    return np.array([np.cos(5 * t), -5 * np.sin(5 * t)])


def adaptive(rhs, rtol: float = 1e-9, **options) -> Adaptive:
    limits = {"min_step": 1e-4, "max_step": np.inf} | options
    return Adaptive(rhs, None, rtol, limits["min_step"], limits["max_step"], Counts())


@pytest.mark.parametrize(("stiffness", "rate", "runs"), [(1e8, 5e2, 1), (1.0, 3.0, 1), (0.0, 2e3, 2)])
def test_a_stated_rate_asks_for_no_second_coarse_run(stiffness: float, rate: float, runs: int) -> None:
    """A mass on a stiff spring turns slowly; without one the body spins faster than 2000 steps resolve."""
    scene = Scene(
        name="mass",
        duration=2.0,
        body=[{"name": "m", "mass": 400.0, "inertia": (1, 1, 1), "position": (1.0, 0.0, 0.0)}],
        load=[
            {
                "type": "spring",
                "bodies": ("ground", "m"),
                "damping": 0.0,
                "points": ((0, 0, 0), (1, 0, 0)),
                "stiffness": stiffness,
                "natural_length": 1.0,
            }
        ],
    )
    asked = []

    def coarse(step: float) -> Trajectory:
        asked.append(step)
        spin = np.array([[[3.0 if stiffness else 2e3, 0.0, 0.0]]])
        place, turn = np.ones((1, 1, 3)), np.array([[[1.0, 0.0, 0.0, 0.0]]])
        return Trajectory("mass", "", "", "", {}, np.zeros(1), ("m",), place, turn, place, spin)

    assert fastest_rate(scene, coarse) == pytest.approx(rate)
    assert len(asked) == runs, asked


@pytest.mark.parametrize("rtol", [1e-4, 1e-7, 1e-10])
def test_adaptive_steps_and_cosine(rtol: float) -> None:
    stepper, y = adaptive(oscillator, rtol), cosine(0.0)
    for t0, t1 in ((0.0, 0.7), (0.7, 0.701), (0.701, 3.0)):
        y = stepper.advance(y, t0, t1)
        gap = abs(y - cosine(t1)).max()
        assert gap < 10 * rtol, f"{gap:.1e} from the cosine at {t1}, tolerance {rtol:.0e}"


def test_right_hand_sides_are_counted() -> None:
    calls = 0

    def counted(t: float, y: np.ndarray) -> np.ndarray:
        nonlocal calls
        calls += 1
        return oscillator(t, y)

    stepper = adaptive(counted)
    stepper.advance(cosine(0.0), 0.0, 2.0)
    expected = 12 * (stepper.counts.steps + stepper.counts.rejected) + 1
    assert stepper.counts.rhs == calls == expected, f"{calls} calls, {stepper.counts}, expected {expected}"


def test_noise_at_one_position_is_stepped_over() -> None:
    """The slope is garbage where a stage of the first and shortest step evaluates it."""
    shortest = 1e-3
    noisy = DOP853.C[5] * shortest

    def rhs(t: float, y: np.ndarray) -> np.ndarray:
        return np.array([1.0 if abs(y[0] - noisy) > 1e-9 else 1e9])

    stepper = adaptive(rhs, 1e-12, min_step=shortest)
    y = stepper.advance(np.zeros(1), 0.0, 1.0)
    assert stepper.counts.rejected >= 4, f"the noise was not met: {stepper.counts}"
    assert abs(y[0] - 1.0) < 1e-12, f"y(1) = {y[0]}, expected 1"


def test_step_does_not_go_on_from_where_settling_finds_noise() -> None:
    """The slope is garbage just where the first and shortest step would be settled."""
    shortest, moved = 1e-3, 1e-9

    def rhs(t: float, y: np.ndarray) -> np.ndarray:
        return np.array([1.0 if abs(y[0] - shortest - moved) > moved / 2 else 1e9])

    stepper = Adaptive(rhs, lambda t, y: y + moved, 1e-6, shortest, np.inf, Counts())
    y = stepper.advance(np.zeros(1), 0.0, 1.0)
    gap = abs(y[0] - 1.0 - moved * stepper.counts.steps)
    assert gap < 1e-12, f"{gap:.1e} from the time it is: {stepper.counts}"


def test_state_that_cannot_be_settled_says_why() -> None:
    def refuse(t: float, y: np.ndarray) -> np.ndarray:
        raise Failed(Outcome.NOT_CONVERGED, t, "no way")

    with pytest.raises(Failed, match="no way"):
        Adaptive(oscillator, refuse, 1e-6, 1e-3, np.inf, Counts()).advance(cosine(0.0), 0.0, 1.0)


def test_noise_before_a_sample_that_a_stretched_step_reaches_is_stepped_over() -> None:
    """The interval is a little longer than the shortest step, which would be tried for ever."""
    shortest, calls = 1e-3, 0

    def rhs(t: float, y: np.ndarray) -> np.ndarray:
        nonlocal calls
        calls += 1
        assert calls < 1000, "the same step is tried again and again"
        return np.array([1.0 + 1e3 * (-1) ** calls])

    y = adaptive(rhs, 1e-12, min_step=shortest).advance(np.zeros(1), 0.0, 1.005 * shortest)
    assert np.isfinite(y).all(), y


def test_a_motion_that_ends_is_not_finite_and_says_when() -> None:
    def rhs(t: float, y: np.ndarray) -> np.ndarray:
        with np.errstate(all="ignore"):
            return np.sqrt(0.5 - np.array([t])) * 0 + 1

    with pytest.raises(Failed, match="not finite after") as failure:
        adaptive(rhs).advance(np.zeros(1), 0.0, 1.0)
    assert failure.value.outcome is Outcome.NOT_FINITE, f"{failure.value.outcome}"
    assert 0.45 < failure.value.t <= 0.5, f"reached {failure.value.t}, the right-hand side ends at 0.5"


def test_fixed_steps_have_fourth_order_and_divide_the_interval() -> None:
    steps, errors = (0.011, 0.0055), []
    for h in steps:
        counts = Counts()
        y = rk4(oscillator, lambda t, y: y, cosine(0.0), 0.0, 1.0, h, counts)
        errors.append(abs(y - cosine(1.0)).max())
        assert counts.steps == step_count(0.0, 1.0, h) and counts.rhs == 4 * counts.steps, f"{counts}"
    order = np.log2(errors[0] / errors[1])
    assert 3.8 < order < 4.2, f"errors {errors} of steps {steps}: order {order:.2f}"
