"""Machine code generated for a scene against the general kernels, which serve every scene. The general
kernels are the truth here; other tests compare them with closed forms."""

import numpy as np
import pytest

from mbref.kernels.compilation import PLAIN

if PLAIN:
    pytest.skip("without compilation there is no generated code", allow_module_level=True)

from crosscheck.conformance.mechanisms.random_mechanisms import random_mechanism
from crosscheck.judge.constraints import scene_length
from mbref.method import Method
from mbref.motions.trajectory import Outcome
from mbref.scenes import SCENES
from mbref.simulation.simulate import Limits, simulate

ORDER_16 = Method.parse("taylor[order=16]")
CRANKS = ("planar_slider_crank", "spatial_slider_crank", "spatial_slider_crank_driven", "slider_crank_chain")
MECHANISMS = (*CRANKS, "bricard", "heavy_top")
ROUNDING = 1e-11  # of positions over the length: both codes sum one series in different orders


def difference(scene, method=ORDER_16, rtol=1e-11):
    """Return the largest difference of positions over 0.02 s by generated code and by the general kernels,
    over the mechanism's length. Both runs must complete."""
    times = [0.0, 0.01, 0.02]
    limits = (Limits(rtol=rtol, code=code) for code in ("generic", "generated"))
    generic, own = (simulate(scene, method, times, each) for each in limits)
    assert generic.outcome == own.outcome == Outcome.COMPLETED, own.message
    return np.abs(generic.position - own.position).max() / scene_length(scene)


@pytest.mark.parametrize("seed", (3, 11, 17, 21))
def test_generated_code_moves_random_mechanisms_without_springs_as_the_general_kernels(seed):
    """``difference`` is of positions by both codes, over the length; rounding is left."""
    scene = random_mechanism(seed)
    loads = tuple(load for load in scene.load if not hasattr(load, "stiffness"))
    assert difference(scene.with_(load=loads)) <= ROUNDING


@pytest.mark.parametrize("name", ("bricard", "bennett"))
def test_generated_code_follows_a_motion_that_turns_back(name):
    """Generated code uses the power equation, except at low speed, where the motion turns back: the
    velocities, projected on their first values, change their sign. General kernels give equal positions."""
    times, rtol = np.linspace(0.0, 4.0, 41), 1e-11
    limits = (Limits(rtol=rtol, code=code) for code in ("generic", "generated"))
    generic, own = (simulate(SCENES[name](), "taylor", times, each) for each in limits)
    along = (own.velocity * own.velocity[1]).sum(axis=(1, 2))
    assert own.outcome == Outcome.COMPLETED and along.min() < 0.0 < along.max(), "it turns back"
    assert np.abs(generic.position - own.position).max() < ROUNDING  # m; links have about 1 m


@pytest.mark.parametrize("name", (*MECHANISMS, "four_bar", "planar_slider_crank_equal", "four_bar_gravity"))
def test_runs_by_generated_code_and_general_kernels_agree_in_poses_reactions_and_steps(name):
    """Positions (m) and quaternions agree to 100 times rounding. Accelerations and reactions agree to 1e-5 of
    the largest value, or of 1 if that is larger, as singular positions magnify rounding. Numbers of steps may
    differ by a twentieth, or by one for each crossing: rounding decides on the step after a crossing."""
    times = np.linspace(0.0, 0.2, 5)
    limits = (Limits(rtol=1e-11, code=code) for code in ("generic", "generated"))
    generic, own = (simulate(SCENES[name](), ORDER_16, times, each) for each in limits)
    assert generic.outcome == own.outcome and len(own.times) == len(times), own.message
    assert np.abs(generic.position - own.position).max() < 100 * ROUNDING
    assert np.abs(generic.orientation - own.orientation).max() < 100 * ROUNDING
    forces = [(own.reactions[joint], generic.reactions[joint]) for joint in own.reactions or ()]
    for mine, theirs in ((own.acceleration, generic.acceleration), *forces):
        assert np.abs(mine - theirs).max() <= 1e-5 * max(1.0, np.abs(theirs).max())
    apart = abs(generic.cost.steps - own.cost.steps)
    assert apart <= max(generic.cost.steps / 20, len(generic.crossings or ()))


@pytest.mark.parametrize("order", (4, 5, 12, 13, 30))
def test_generated_code_of_low_and_high_orders_moves_as_the_general_kernels(order):
    """Errors of the truncated series, about rtol 1e-5, are equal in both, so that rounding is left."""
    scene = SCENES["spatial_slider_crank_gravity"]()
    assert difference(scene, Method.parse(f"taylor[order={order}]"), rtol=1e-5) <= ROUNDING
