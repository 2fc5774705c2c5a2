"""Exudyn's reactions satisfy the equations of Newton and Euler of the body that the joint holds."""

import numpy as np
import pytest

from crosscheck.engine import Setting
from crosscheck.engines.exudyn.adapter import ENGINE
from mbref import rotations
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import JOINT_TYPES, Driver, Moment, Revolute, Scene, Sine
from tests.crosscheck.measured import MARGIN
from tests.crosscheck.tree_scenes import INERTIA, body
from tests.helpers.parts import X

MEASURED = 1.6e-10  # measured difference / largest force or moment
SIDEWAYS = (0.6, 0.0, 0.8)  # an axis along no coordinate axis
BODY = body("b", (0.0, 0.2, 0.0), (0.3, -0.5, 0.8), mass=2.0)
ANCHOR, OTHER = (0.1, 0.1, -0.2), (0.3, -0.1, 0.1)
PLACES = {"anchor": ANCHOR, "anchors": (ANCHOR, OTHER), "axis": SIDEWAYS, "axes": (X, (0.0, 1.0, 1.0))}
UNDRIVEN = [(name, False) for name in JOINT_TYPES]
DRIVEN = [(name, True) for name, kind in JOINT_TYPES.items() if kind.facts.driven]


def needed_wrench(scene: Scene, trajectory: Trajectory) -> np.ndarray:
    """Return force and moment (k, 6) about the anchor on the second body by the run's accelerations."""
    held, joint = scene.body[0], scene.joint[0]
    turn = rotations.to_matrix(trajectory.orientation[:, 0])
    inertia = turn @ np.array(INERTIA) @ np.swapaxes(turn, 1, 2)
    w, alpha = trajectory.angular_velocity[:, 0], trajectory.angular_acceleration[:, 0]
    force = held.mass * (trajectory.acceleration[:, 0] - np.array(scene.gravity))
    spin = np.einsum("kij,kj->ki", inertia, w)
    moment = np.einsum("kij,kj->ki", inertia, alpha) + np.cross(w, spin) - np.array(scene.load[0].moment)
    anchors = joint.anchor_pair
    point = np.array(anchors[1])
    if joint.bodies[1] == "b":
        start = rotations.to_matrix(np.array(held.orientation))
        point = trajectory.position[:, 0] + turn @ start.T @ (point - np.array(held.position))
    moment = moment - np.cross(point - trajectory.position[:, 0], force)
    return np.concatenate([force, moment], axis=1) * (1 if joint.bodies[1] == "b" else -1)


@pytest.mark.parametrize("bodies", [("ground", "b"), ("b", "ground")])
@pytest.mark.parametrize(("kind", "driven"), [*UNDRIVEN, *DRIVEN])
def test_exudyns_reaction_causes_the_acceleration_of_the_body(kind, driven, bodies):
    """F = m (a - g), and M = J α + ω × J ω less the applied moment, about the joint's anchor. The difference
    is at most ten times the measured 1.6e-10 of the largest force or moment."""
    scene = Scene(
        name="held",
        body=(BODY,),
        gravity=(1.0, -9.81, 2.0),
        joint=(JOINT_TYPES[kind].at("J", bodies, **PLACES),),
        driver=(Driver(joint="J", polynomial=(0.0, 3.0)),) if driven else (),
        load=(Moment(body="b", moment=(0.3, 0.5, -0.4)),),
    )
    trajectory = ENGINE.run(scene, np.linspace(0, 0.4, 5), Setting("tuned", {"step": 1e-3}))
    assert trajectory.outcome is Outcome.COMPLETED, trajectory.message
    needed = needed_wrench(scene, trajectory)
    assert np.abs(trajectory.reactions["J"] - needed).max() < MARGIN * MEASURED * np.abs(needed).max()


def test_exudyn_gives_no_accelerations_and_reactions_with_an_accelerating_driver():
    """Exudyn's initial multipliers lack the driver's acceleration, here of a sine. With a driver of constant
    rate both are given."""
    joint = Revolute.at("J", ("ground", "b"), **PLACES)
    shaken, turned = (
        ENGINE.run(
            Scene(name="driven", body=(BODY,), joint=(joint,), driver=(Driver(joint="J", **law),)),
            np.linspace(0, 0.1, 3),
            Setting("tuned", {"step": 1e-3}),
        )
        for law in ({"sine": Sine(amplitude=0.1, frequency=3.0)}, {"polynomial": (0.0, 3.0)})
    )
    assert shaken.reactions is None and shaken.acceleration is None
    assert turned.reactions is not None and turned.acceleration is not None
