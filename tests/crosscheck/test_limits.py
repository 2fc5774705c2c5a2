"""The limit h → 0: the order, bias and discretisation found / those put into made-up runs."""

from dataclasses import replace

import numpy as np
import pytest

from crosscheck.judge.constraints import scene_length
from crosscheck.judge.metrics import error_series
from crosscheck.judge.richardson import limit
from crosscheck.judge.truth import truth_for
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scenes import SCENES

SCENE = SCENES["spatial_slider_crank_driven"]()
TRUTH = truth_for(SCENE).poses(np.linspace(0, 0.02, 5))


def made(step: float, order: float, bias: float, constant: float = 1e-2) -> Trajectory:
    """A run off the truth by bias + constant · step^order, shifted and turned by as much; the run of step
    0.1 has quaternions of opposite sign, which are the same orientations."""
    off = bias + constant * step**order
    turn = rotations.from_vector([0.0, off / 2, 0.0])
    sign = -1.0 if step == 0.1 else 1.0
    shift = off * scene_length(SCENE) * np.array([1.0, 0.0, 0.0])
    return replace(
        TRUTH, position=TRUTH.position + shift, orientation=sign * rotations.multiply(turn, TRUTH.orientation)
    )


@pytest.mark.parametrize("order, bias", [(1.0, 1e-4), (2.0, 0.0), (2.0, 3e-5), (4.0, 1e-6)])
def test_richardson_limit_finds_the_order_and_bias_put_into_the_runs(order: float, bias: float):
    """The limit is off the truth by the bias, and the finest run (step 0.1) off the limit by 1e-2 ·
    0.1^order. Both within 1 %, or 1e-8, of this: turns of the runs of long steps are not quite proportional.
    The order is within a thousandth."""
    steps = [0.1, 0.3, 1.0, 0.2]
    found = limit(SCENE, steps, [made(h, order, bias) for h in steps])
    error = error_series(SCENE, found.motion, TRUTH).max()
    assert found.order == pytest.approx(order, rel=1e-3), found.order
    assert found.discretisation == pytest.approx(1e-2 * 0.1**order, rel=1e-2), found.discretisation
    assert error == pytest.approx(bias, rel=1e-2, abs=1e-8), f"limit off by {error:.2e}, bias put in {bias:g}"


STEPS = [1.0, 0.5, 0.25]
WANDERING = [made(h, 1.0, off) for h, off in zip(STEPS, (0.0, 1e-3, -2e-2), strict=True)]


@pytest.mark.parametrize(
    "runs",
    [WANDERING, [made(0.5, 1.0, 1e-3)] * 3, [made(h, 1.0, 0.0) for h in STEPS[:2]]],
    ids=["differences that grow", "equal runs", "two runs"],
)
def test_runs_that_follow_no_power_of_the_step_have_no_limit(runs):
    """Runs off the truth by constant · step¹ have one."""
    assert limit(SCENE, STEPS, [made(h, 1.0, 0.0) for h in STEPS]) is not None
    assert limit(SCENE, STEPS[: len(runs)], runs) is None
