"""Slides that become many times longer than the mechanism was are no singular positions."""

import numpy as np
import pytest

import mbref
from mbref.scene import Scene
from tests.helpers.parts import Entry, X, hinge, joint
from tests.helpers.power_balance import panel_times, unbalanced
from tests.helpers.spinning import spinning_mechanism

SPEED, START, END = 10.0, 0.1, 0.7  # rad/s of the arm, m from its axis, s
TIMES = np.linspace(0.0, END, 8)


def beads(joints: list[Entry], length: float) -> Scene:
    """Return two beads on an arm that turns at a constant speed; nothing holds them along the arm. They are
    at START · length from the axis at the start, and the joints connect them."""
    moving = {"position": (START * length, 0.0, 0.0), "velocity": (0.0, SPEED * START * length, 0.0)}
    turning = {"mass": 1.0, "inertia": (0.1 * length**2,) * 3, "angular_velocity": (0.0, 0.0, SPEED)}
    bodies = [{"name": "arm", "position": (0.0, 0.0, 0.0), **turning}]
    bodies += [{"name": name, **moving, **turning} for name in ("bead", "follower")]
    rail = joint("S", "cylindrical", "arm", "bead", axis=X)
    joints = [hinge("A", "ground", "arm", (0, 0, 0)), rail, *joints]
    driver = [{"joint": "A", "polynomial": (0.0, SPEED)}]
    return Scene(name="beads", duration=END, gravity=(0, 0, 0), body=bodies, joint=joints, driver=driver)


def open_tree(length: float) -> Scene:
    """Return beads without a closed loop: the follower slides on the other bead."""
    at = (START * length, 0.0, 0.0)
    return beads([joint("T", "cylindrical", "bead", "follower", at, axis=X)], length)


def closed_loop(length: float) -> Scene:
    """Return beads that two ball joints connect, which close a loop."""
    r = START * length
    anchors = {"T": (r, 0.0, 0.0), "U": (r, 0.0, r)}
    return beads([joint(k, "spherical", "bead", "follower", at) for k, at in anchors.items()], length)


@pytest.mark.parametrize("length", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("scene", [open_tree, closed_loop])
def test_beads_on_a_turning_arm_move_out_to_548_times_their_distance_as_their_closed_form(scene, length):
    """The distance from the axis is r = r₀ cosh ωt, up to cosh 7 = 548 times r₀, at every size of the
    mechanism, none singular. Relative errors are below a tenth of rtol, 1e-9."""
    motion = mbref.simulate(scene(length), times=TIMES)
    assert motion.outcome == mbref.Outcome.COMPLETED, motion.message
    distance = np.linalg.norm(motion.position[:, 1:], axis=2)
    expected = START * length * np.cosh(SPEED * TIMES)[:, None]
    assert distance == pytest.approx(np.broadcast_to(expected, distance.shape), rel=1e-10)


@pytest.mark.parametrize("seed", [27, 51, 63, 99])
def test_spinning_trees_with_long_slides_are_followed_to_the_end(seed):
    """The mechanisms of these seeds are open trees, which have no singular position, and slide out to more
    than 40 m. In each tenth of a second the mean power of loads is the change of energy over the time, within
    rtol, 1e-9, of the largest power."""
    scene = spinning_mechanism(seed)
    motion = mbref.simulate(scene, times=panel_times(4.0, 40))
    assert motion.outcome == mbref.Outcome.COMPLETED, motion.message
    assert np.abs(motion.position).max() > 40.0  # m; the trees are 1 m large at the start
    falling = [body.mass * motion[body.name].velocity @ np.array(scene.gravity) for body in scene.body]
    assert unbalanced(motion.columns(), np.abs(falling).max()) < 1e-9  # measured: 3e-10
