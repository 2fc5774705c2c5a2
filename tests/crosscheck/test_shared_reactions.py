"""Reactions that redundant joints share / shares worked out by hand."""

from typing import Any

import numpy as np
import pytest

from crosscheck.judge import joint_reactions
from crosscheck.judge.constraints import initial_poses
from mbref.motions.trajectory import Trajectory
from mbref.scene import Body, Revolute, Scene


def body(name: str, x: float, **parts: Any) -> Body:
    return Body(name=name, **{"mass": 2.0, "inertia": (1.0, 1.0, 1.0), "position": (x, 0.0, 0.0), **parts})


def hinge(name: str, first: str, second: str, x: float = 0.0, z: float = 0.0) -> Revolute:
    return Revolute(name=name, bodies=(first, second), anchor=(x, 0.0, z), axis=(0.0, 0.0, 1.0))


DOOR = Scene(
    name="door",
    body=(body("a", 1.0), body("b", 3.0)),
    joint=(hinge("A", "ground", "a"), hinge("B", "ground", "a", z=2.0), hinge("C", "a", "b", x=2.0)),
    gravity=(0.0, 0.0, 0.0),
)
POSE = initial_poses(DOOR)


def run(**forces: tuple[float, ...]) -> Trajectory:
    """Both bodies at rest at three times; joints with the given wrenches."""
    place, turn = np.stack([POSE[0]] * 3), np.stack([POSE[1]] * 3)
    still, times = np.zeros((3, 2, 3)), np.array([0.0, 0.5, 1.0])
    reactions = {name: np.tile(wrench, (3, 1)).astype(float) for name, wrench in forces.items()} or None
    made = Trajectory("door", "e", "1", "m", {}, times, ("a", "b"), place, turn, still, still)
    return made if reactions is None else Trajectory(**{**vars(made), "reactions": reactions})


ONE = run(A=(0, 0, 3, 0, 0, 0), B=(0, 0, 1, 0, 0, 0), C=(7, 0, 0, 0, 0, 0))
OTHER = run(A=(0, 0, 1, 0, 0, 0), B=(0, 0, 3, 0, 0, 0), C=(7, 0, 0, 0, 0, 0))


def test_reactions_that_hinges_share_are_listed_by_joint_and_run():
    """Hinges A and B share the force along their axis: A has 3 N or 1 N of 4 N. C's reaction is unique and
    not listed; nor is a run without reactions."""
    found = joint_reactions.side_by_side(DOOR, {"one": ONE, "none": run(), "other": OTHER}, 1)
    assert set(found) == {"A", "B"}
    assert found["A"] == pytest.approx({"one": 3.0, "other": 1.0})


def test_hinges_that_share_a_force_otherwise_have_equal_unique_reactions():
    """Shares of A differ by 2 N of the largest force, 7 N; C's reaction and the resultants are equal."""
    compared = joint_reactions.compare(DOOR, ONE, OTHER)
    assert compared.joints["C"].shared == 0 and compared.joints["C"].unique == 0.0
    assert compared.joints["A"].chosen == pytest.approx(2 / 7) and compared.resultant == pytest.approx(0.0)
