"""Reactions of engines against the judge's; shares of redundant hinges against statics by hand."""

import numpy as np
import pytest

from crosscheck.judge.constraints import initial_poses
from crosscheck.judge.joint_reactions import compare, shared_wrenches, side_by_side
from mbref.motions.trajectory import Trajectory
from mbref.scene import Body, Revolute, Scene, Spherical
from tests.helpers.parts import Z, block, hinge


def door(kind: type) -> Scene:
    """A door hung in two joints of one kind on a vertical axis, 1 m apart."""
    axis = {"axis": Z} if kind is Revolute else {}
    leaf = Body(name="leaf", mass=10.0, inertia=(1.2, 0.9, 0.4), position=(0.4, 0.0, 1.0))
    heights, bodies = {"low": 0.5, "high": 1.5}, ("ground", "leaf")
    hinges = [kind(name=n, bodies=bodies, anchor=(0.0, 0.0, h), **axis) for n, h in heights.items()]
    return Scene(name="door", gravity=(0.0, 0.0, -9.81), duration=0.1, body=(leaf,), joint=tuple(hinges))


def test_two_ball_hinges_share_only_the_force_along_their_line():
    """Statics leaves one component of each ball open: equal and opposite forces along the line of both, z.
    The basis has length one and this direction, to rounding."""
    shared = shared_wrenches(door(Spherical), 0.0, *initial_poses(door(Spherical)))
    for name, basis in shared.items():
        assert basis.shape == (6, 1), f"{name}: {basis.shape[1]} shared wrenches, by hand 1"
        assert abs(basis[2, 0]) == pytest.approx(1.0, abs=1e-12)


def test_two_revolute_hinges_share_all_five_components():
    """Each hinge alone holds the door: all five components are open; no moment about the axis, to 1e-12."""
    shared = shared_wrenches(door(Revolute), 0.0, *initial_poses(door(Revolute)))
    assert {name: basis.shape[1] for name, basis in shared.items()} == {"low": 5, "high": 5}
    assert max(np.abs(basis[5]).max() for basis in shared.values()) < 1e-12


# two leaves: the first on hinges A and B of the ground, the second on hinge C of the first; all axes along z
HUNG = hinge("A", "ground", "a", (0.0, 0.0, 0.0)), hinge("B", "ground", "a", (0.0, 0.0, 2.0))
LEAVES = Scene(
    name="door",
    body=(block("a", (1.0, 0.0, 0.0)), block("b", (3.0, 0.0, 0.0))),
    joint=(*HUNG, hinge("C", "a", "b", (2.0, 0.0, 0.0))),
    gravity=(0.0, 0.0, 0.0),
)
POSE = initial_poses(LEAVES)


def at_rest(**forces: tuple[float, ...]) -> Trajectory:
    """Both bodies at rest at three times; joints with the given wrenches."""
    place, turn = np.stack([POSE[0]] * 3), np.stack([POSE[1]] * 3)
    still, times = np.zeros((3, 2, 3)), np.array([0.0, 0.5, 1.0])
    reactions = {name: np.tile(wrench, (3, 1)).astype(float) for name, wrench in forces.items()} or None
    made = Trajectory("door", "e", "1", "m", {}, times, ("a", "b"), place, turn, still, still)
    return made if reactions is None else Trajectory(**{**vars(made), "reactions": reactions})


ONE = at_rest(A=(0, 0, 3, 0, 0, 0), B=(0, 0, 1, 0, 0, 0), C=(7, 0, 0, 0, 0, 0))
OTHER = at_rest(A=(0, 0, 1, 0, 0, 0), B=(0, 0, 3, 0, 0, 0), C=(7, 0, 0, 0, 0, 0))


def test_reactions_that_hinges_share_are_listed_by_joint_and_run():
    """Hinges A and B share the force along their axis: A has 3 N or 1 N of 4 N. C's reaction is unique and
    not listed; nor is a run without reactions."""
    found = side_by_side(LEAVES, {"one": ONE, "none": at_rest(), "other": OTHER}, 1)
    assert set(found) == {"A", "B"}
    assert found["A"] == pytest.approx({"one": 3.0, "other": 1.0})


def test_runs_that_divide_a_shared_force_differently_have_equal_unique_reactions():
    """Hinges A and B share 4 N: A has 3 N in one run and 1 N in the other, a difference of 2 N of the largest
    force, 7 N. C's reaction and the resultants are equal."""
    compared = compare(LEAVES, ONE, OTHER)
    assert compared.joints["C"].shared == 0 and compared.joints["C"].unique == 0.0
    assert compared.joints["A"].chosen == pytest.approx(2 / 7) and compared.resultant == pytest.approx(0.0)
