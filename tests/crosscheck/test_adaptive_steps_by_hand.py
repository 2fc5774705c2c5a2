"""Steps of adaptive length that are settled / errors, step lengths and counts worked out by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import DOP853

from crosscheck.engines import sampling
from crosscheck.engines.sampling import Adaptive, Counts, Failed
from mbref.trajectory import Outcome


def adaptive(rhs: Any = lambda t, y: y, settle: Any = None, **parts: Any) -> Adaptive:
    given = {"rtol": 1e-6, "min_step": 1e-3, "max_step": 0.5, "counts": Counts(), **parts}
    return Adaptive(rhs, settle, **given)


def test_a_step_is_a_step_of_dop853():
    """State and error of SciPy's integrator for y'' = -y, with rtol and a hundredth of it as atol."""
    made = adaptive(lambda t, y: np.array([y[1], -y[0]]))
    y = np.array([1.0, 0.5])
    new, slope, error = made._attempt(0.0, y, made._evaluate(0.0, y), 0.4)
    other = DOP853(made.rhs, 0.0, y, 10.0, rtol=1e-6, atol=1e-8, first_step=0.4)
    scale = 1e-8 + 1e-6 * np.maximum(np.abs(y), np.abs(new))
    assert new == pytest.approx(
        [math.cos(0.4) + 0.5 * math.sin(0.4), 0.5 * math.cos(0.4) - math.sin(0.4)], abs=1e-9
    )
    assert slope == pytest.approx(made.rhs(0.4, new))
    other.step()
    assert error == pytest.approx(other._estimate_error_norm(other.K, 0.4, scale), rel=1e-10)
    assert made.counts.rhs == 1 + 11 + 1


def test_a_slope_that_never_changes_has_no_error():
    made = adaptive(lambda t, y: np.ones(1))
    assert made._attempt(0.0, np.zeros(1), np.ones(1), 0.25)[0] == pytest.approx([0.25])
    assert made._attempt(0.0, np.zeros(1), np.ones(1), 0.25)[2] < 1e-6
    assert adaptive(lambda t, y: 0 * y)._attempt(0.0, np.ones(2), np.zeros(2), 0.25)[2] == 0.0


def test_the_error_of_a_settled_state():
    """Settling moves a state of two numbers by (0.3, 0.4), so that the slope y changes by as much; the error
    is the larger of both estimates."""
    made = adaptive(settle=lambda t, y: y + np.array([0.3, 0.4]))
    weight = np.array([10.0, 20.0])
    y = np.array([1.0, 2.0])
    for error, wanted in ((1.0, math.sqrt((9 + 64) / 2)), (7.0, 7.0)):
        settled, slope, found = made._settled(made.settle, 0.5, y, y, weight, error)
        assert settled.tolist() == [1.3, 2.4] and slope.tolist() == [1.3, 2.4]
        assert found == pytest.approx(wanted)

    def fails(t: float, y: np.ndarray) -> np.ndarray:
        raise Failed(Outcome.NOT_CONVERGED, t, "no")

    kept, slope, error = made._settled(fails, 0.5, y, 2 * y, weight, 1.0)
    assert kept is y and slope.tolist() == [2.0, 4.0] and error == math.inf


def test_the_weight_of_a_settled_step():
    """A step of 0.4 s; the scale is 1e-6 (0.01 + |y|) for the state (0, 3), which does not move."""
    made = adaptive(
        lambda t, y: 1e-3 * (y - np.array([0.0, 3.0])), settle=lambda t, y: y + np.array([0.0, 1e-3])
    )
    _, _, error = made._attempt(0.0, np.array([0.0, 3.0]), np.zeros(2), 0.4)
    assert error == pytest.approx(0.4 * 1e-6 / (1e-6 * 3.01) / math.sqrt(2), rel=1e-6)


def test_a_motion_to_the_next_sample():
    """exp(1) from 0 to 1 s; the steps end there, and their length is kept for the next sample."""
    made = adaptive(rtol=1e-9)
    assert made.advance(np.ones(1), 0.0, 1.0)[0] == pytest.approx(math.e, rel=1e-8)
    assert made.counts.steps >= 2 and made.counts.rejected == 0
    kept, before = made.step, made.counts.steps
    assert kept > made.min_step
    made.advance(np.ones(1), 1.0, 1.0 + 0.5 * kept)
    assert made.counts.steps == before + 1, "one step to a near sample"
    assert made.step >= kept, "a step cut off at a sample does not shorten the next one"


def steps_of(made: Adaptive, t1: float) -> list[float]:
    """Lengths of the attempted steps from 0 on."""
    tried: list[float] = []
    whole = made._attempt

    def attempt(t: float, y: np.ndarray, f: np.ndarray, h: float) -> Any:
        tried.append(h)
        return whole(t, y, f, h)

    made._attempt = attempt  # type: ignore[method-assign]
    made.advance(np.ones(1), 0.0, t1)
    return tried


def test_steps_grow_tenfold_up_to_the_longest():
    """An error of zero: 0.01, 0.1, 0.5 (the longest), and what is left."""
    found = steps_of(adaptive(lambda t, y: 0 * y, min_step=0.01), 1.0)
    assert found == pytest.approx([0.01, 0.1, 0.5, 0.39])


@pytest.mark.parametrize(("end", "steps"), [(0.1009, [0.1009]), (0.1011, [0.1, 0.0011])])
def test_a_step_may_be_a_hundredth_longer_to_end_at_a_sample(end, steps):
    made = adaptive(lambda t, y: 0 * y, min_step=0.1, max_step=0.1)
    assert steps_of(made, end) == pytest.approx(steps)


def test_rejected_steps_are_shorter():
    """Errors of 256 and 1 over the tolerance: the length times 0.45, then times 0.9."""
    made = adaptive(min_step=1e-3, step=0.4)
    errors = iter([256.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    tried: list[float] = []

    def attempt(t: float, y: np.ndarray, f: np.ndarray, h: float) -> Any:
        tried.append(h)
        return y, y, next(errors)

    made._attempt = attempt  # type: ignore[method-assign]
    made.advance(np.ones(1), 0.0, 0.35 + 0.4)
    assert tried == pytest.approx([0.4, 0.18, 0.162, 0.408])
    assert (made.counts.steps, made.counts.rejected) == (3, 1)


def test_the_shortest_step_that_fails_is_exchanged_for_the_best_of_longer_ones():
    """Lengths of 1 to 4 times the shortest; the error is least at 2.4 times."""
    made = adaptive(min_step=0.01, step=0.01)
    tried: list[float] = []

    def attempt(t: float, y: np.ndarray, f: np.ndarray, h: float) -> Any:
        tried.append(h)
        return y + h, y, 2.0 + abs(h - 0.024)

    made._attempt = attempt  # type: ignore[method-assign]
    h, new, _, error = made._jump(0.0, np.zeros(1), np.zeros(1), 1.0)
    assert tried == pytest.approx(0.01 * np.linspace(1, 4, 16)) and made.counts.rejected == 16
    assert h == pytest.approx(0.024) and new[0] == h and error == pytest.approx(2.0)
    tried.clear()
    assert made._jump(0.5, np.zeros(1), np.zeros(1), 0.515)[0] == pytest.approx(0.015), "up to the sample"
    assert max(tried) == pytest.approx(0.015)


def test_a_motion_that_is_not_finite():
    def lost(t: float, y: np.ndarray, f: np.ndarray, h: float) -> Any:
        return y, y, math.nan

    made = adaptive()
    made._attempt = lost  # type: ignore[method-assign]
    with pytest.raises(Failed, match=r"the motion is not finite after 0\.25 s") as caught:
        made._jump(0.25, np.zeros(1), np.zeros(1), 1.0)
    assert (caught.value.outcome, caught.value.t) == (Outcome.NOT_FINITE, 0.25)

    def settle(t: float, y: np.ndarray) -> np.ndarray:
        raise Failed(Outcome.NOT_CONVERGED, t, "does not close")

    made = adaptive(settle=settle)
    made._attempt = lost  # type: ignore[method-assign]
    with pytest.raises(Failed, match="does not close") as caught:
        made._jump(0.25, np.zeros(1), np.zeros(1), 1.0)
    assert caught.value.t == pytest.approx(0.251)


def test_a_motion_with_too_many_steps(monkeypatch):
    monkeypatch.setattr(sampling, "MAX_STEPS", 3)
    made = adaptive(lambda t, y: 0 * y, max_step=0.01, min_step=0.01)
    with pytest.raises(Failed, match=r"3 steps have only reached 0\.03 s") as caught:
        made.advance(np.ones(1), 0.0, 1.0)
    assert caught.value.outcome is Outcome.STEP_FAILED and caught.value.t == pytest.approx(0.03)
