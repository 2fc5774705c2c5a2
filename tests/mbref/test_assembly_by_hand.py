"""Lengths of links and exchanges of joints / displacements, sets and messages worked out by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from mbref.design import assemble as assembly
from mbref.design import exchange
from mbref.design.assemble import assemble
from mbref.design.exchange import REMOVED, Weaker
from mbref.scene import (
    Body,
    Cylindrical,
    Driver,
    JointForce,
    Revolute,
    Scene,
    SceneError,
    Spherical,
    TorsionSpring,
    Translational,
)

O, Z = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def body(name: str, *place: float, mass: float = 2.0) -> Body:
    return Body(name=name, mass=mass, inertia=(0.1, 0.1, 0.1), position=place)


def pin(name: str, first: str, second: str, *anchor: float) -> Revolute:
    return Revolute(name=name, bodies=(first, second), anchor=anchor, axis=Z)


# a crank of 1 m upwards from the origin, a coupler of 2 m, a rocker of 1 m downwards to (2, 0, 0)
BOX = Scene(
    name="box",
    body=(body("crank", 0.0, 0.5, 0.0), body("coupler", 1.0, 1.0, 0.0), body("rocker", 2.0, 0.5, 0.0)),
    joint=(
        pin("A", "ground", "crank", 0.0, 0.0, 0.0),
        pin("B", "crank", "coupler", 0.0, 1.0, 0.0),
        pin("C", "coupler", "rocker", 2.0, 1.0, 0.0),
        pin("D", "rocker", "ground", 2.0, 0.0, 0.0),
    ),
)


# --- lengths ----------------------------------------------------------------------------------------------
def test_two_points_move_by_half_of_the_change_each():
    points = np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0]])
    found = assembly._with_distances("b", points, [(0, 1)], [6.0])
    assert found == pytest.approx(np.array([[-0.3, -0.4, 0.0], [3.3, 4.4, 0.0]]), abs=1e-14)
    assert points[0].tolist() == [0.0, 0.0, 0.0], "the given points stay"
    same = assembly._with_distances("b", points, [(0, 1)], [5.0])
    assert same.tolist() == points.tolist()


def test_a_triangle_with_equal_changes():
    """An equilateral triangle of 1 m grows to 1.1 m about its middle."""
    angles = math.pi / 6 + 2 * math.pi / 3 * np.arange(3)
    corners = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1) / math.sqrt(3)
    found = assembly._with_distances("b", corners, [(0, 1), (1, 2), (2, 0)], [1.1] * 3)
    assert found == pytest.approx(1.1 * corners, abs=1e-12)
    with pytest.raises(SceneError, match=r"body\[b\]: no link has these lengths between its joints"):
        assembly._with_distances("b", corners, [(0, 1), (1, 2), (2, 0)], [1.0, 1.0, 2.5])
    with pytest.raises(SceneError, match="no link has these lengths"):
        assembly._with_distances("b", np.zeros((2, 3)), [(0, 1)], [1.0])


def test_the_coupler_is_longer_by_a_fifth():
    """The crank and the rocker turn, the loop closes, and the differences are listed."""
    found = assemble(BOX, {("B", "C"): 2.4})
    assert found.lengths == {"B–C": (2.0, pytest.approx(2.4))}
    joint = {j.name: np.array(j.anchor) for j in found.scene.joint}
    assert np.linalg.norm(joint["C"] - joint["B"]) == pytest.approx(2.4)
    assert np.linalg.norm(joint["B"]) == pytest.approx(1.0)
    assert np.linalg.norm(joint["C"] - [2, 0, 0]) == pytest.approx(1.0)
    assert joint["A"].tolist() == [0, 0, 0] and joint["D"].tolist() == [2, 0, 0]
    assert joint["B"][1] > 0.9 and joint["C"][1] > 0.9, "on the branch above the ground"
    assert found.joints["B"] == pytest.approx(np.linalg.norm(joint["B"] - [0, 1, 0]))
    assert found.joints["A"] == 0.0
    assert joint["B"] == pytest.approx([-0.2, math.sqrt(0.96), 0.0], abs=1e-6), "both ends move alike"
    moved, turned = found.bodies["crank"]
    assert turned == pytest.approx(math.asin(0.2), abs=1e-6)
    assert moved == pytest.approx(2 * 0.5 * math.sin(math.asin(0.2) / 2), abs=1e-6)
    assert found.bodies["coupler"][1] == pytest.approx(0.0, abs=1e-6)
    assert [b.mass for b in found.scene.body] == [2.0] * 3


def test_the_ground_between_two_joints_gets_a_length():
    found = assemble(BOX, {("A", "D"): 2.2})
    joint = {j.name: np.array(j.anchor) for j in found.scene.joint}
    assert joint["D"] - joint["A"] == pytest.approx([2.2, 0, 0], abs=1e-12)
    assert joint["A"] == pytest.approx([-0.1, 0, 0], abs=1e-12)
    assert found.joints["A"] == pytest.approx(0.1) and found.lengths["A–D"][1] == pytest.approx(2.2)


def test_the_link_that_two_joints_share():
    assert assembly._shared(BOX, "B", "C") == "coupler" and assembly._shared(BOX, "A", "D") == "ground"
    twice = BOX.with_(joint=(*BOX.joint, pin("E", "ground", "crank", 0.0, 0.5, 0.0)))
    assert assembly._shared(twice, "A", "E") == "crank", "a body comes before the ground"
    for pair, says in (
        (("A", "C"), "length A-C: the joints 'A' and 'C' share no link"),
        (("A", "X"), "length A-X: no joint 'X'; joints: A, B, C, D"),
        (("Y", "A"), "no joint 'Y'"),
    ):
        with pytest.raises(SceneError, match=says):
            assembly._shared(BOX, *pair)


def test_loops_that_cannot_be_closed():
    """The ground of 2 m and the coupler may differ by at most 2 m: at 4.1 m the loop opens near the end."""
    with pytest.raises(SceneError) as caught:
        assemble(BOX, {("B", "C"): 4.1})
    [fault] = caught.value.faults
    assert "the loops cannot be closed with these lengths; at 100 % of the changes 0.0" in fault
    with pytest.raises(SceneError, match="at 50 % of the changes"):
        assemble(BOX, {("B", "C"): 6.1})


# --- exchanges --------------------------------------------------------------------------------------------
def weaker(*lost: Any) -> Weaker:
    return Weaker(np.zeros((0, 3)), np.array(lost, dtype=float).reshape(-1, 2))


E1, E2 = (1.0, 0.0), (0.0, 1.0)
CHOICES = {
    "A": {"spherical": weaker(E1), "inline": weaker(E1, E2)},
    "B": {"cylindrical": weaker(E2), "spherical": weaker((2.0, 0.0))},
    "C": {"spherical": weaker((0.0, 3.0))},
}


def test_the_smallest_sets_of_exchanges():
    """One joint ends both dependences; without it, pairs whose lost rows are independent."""
    assert exchange._smallest(CHOICES, 2, 6) == [{"A": "inline"}]
    assert list(exchange._of_size(CHOICES, 2, 2)) == [
        {"A": "spherical", "B": "cylindrical"},
        {"A": "spherical", "C": "spherical"},
        {"B": "spherical", "C": "spherical"},
    ]
    without = {"A": {"spherical": weaker(E1)}, **{name: CHOICES[name] for name in "BC"}}
    assert exchange._smallest(without, 2, 2) == [
        {"A": "spherical", "B": "cylindrical"},
        {"A": "spherical", "C": "spherical"},
    ]
    assert exchange._smallest({"A": {"spherical": weaker(E1)}}, 2, 6) == []
    assert exchange._smallest({}, 1, 6) == []


@pytest.mark.parametrize("count", [4, 5])
def test_sets_of_up_to_four_joints_are_searched(count):
    rows = np.eye(count)
    choices = {f"J{k}": {"spherical": Weaker(np.zeros((0, 3)), rows[k : k + 1])} for k in range(count)}
    found = exchange._smallest(choices, count, 6)
    assert found == ([{f"J{k}": "spherical" for k in range(4)}] if count == 4 else [])
    assert exchange._joint_by_joint(choices, count) == {f"J{k}": "spherical" for k in range(count)}


def test_exchanges_joint_by_joint():
    """The exchange that loses most rows comes first; removals come last."""
    assert exchange._joint_by_joint(CHOICES, 2) == {"A": "inline"}
    choices = {
        "A": {REMOVED: weaker(E1, E2)},
        "B": {"spherical": weaker(E1)},
        "C": {"spherical": weaker((1.0, 1.0))},
    }
    assert exchange._joint_by_joint(choices, 2) == {"B": "spherical", "C": "spherical"}
    assert exchange._joint_by_joint({**choices, "C": {"spherical": weaker((5.0, 0.0))}}, 2) is None
    assert exchange._joint_by_joint({"B": {"spherical": weaker(E1)}}, 2) is None


@pytest.mark.parametrize(
    ("lost", "is_kept"),
    [
        ([[1.0, 0.0]], True),
        ([[0.9e-6, 0.0]], False),
        ([[1.1e-6, 0.0]], True),
        ([[1.0, 0.0], [2.0, 0.0]], False),
        ([[1.0, 0.0], [0.0, 1.0]], True),
    ],
)
def test_the_rank_without_some_rows(lost, is_kept):
    assert exchange._keep_rank(np.array(lost)) is is_kept


def test_dependences_of_rows():
    """The third row is the sum of the first two: one vanishing combination, (1, 1, -1) / √3."""
    rows = {"A": np.array([[1.0, 0, 0], [0, 1.0, 0]]), "B": np.array([[1.0, 1.0, 0]])}
    found, number = exchange._dependences(rows)
    assert number == 1
    combination = np.concatenate([found["A"], found["B"]]).ravel()
    assert combination / combination[0] == pytest.approx([1, 1, -1])
    assert np.linalg.norm(combination) == pytest.approx(1.0)
    cure = {
        "B": {"x": Weaker(np.zeros((0, 3)), found["B"])},
        "A": {"y": Weaker(rows["A"][:1], found["A"][1:])},
    }
    assert exchange._is_cure(rows, cure, {"B": "x"}) and exchange._is_cure(rows, cure, {"A": "y"})
    assert not exchange._is_cure(rows, cure, {}) and not exchange._is_cure(rows, cure, {"A": "y", "B": "x"})


def test_joint_types_that_can_have_a_driver_or_a_load():
    """A driver of an angle needs a revolute or cylindrical joint; a force along the axis a slide as well."""
    joints = (
        pin("R", "ground", "b", *O),
        Translational(name="T", bodies=("ground", "b"), anchor=O, axis=Z),
        Cylindrical(name="C", bodies=("ground", "b"), anchor=O, axis=Z),
        Spherical(name="S", bodies=("ground", "b"), anchor=O),
    )
    scene = Scene(name="s", body=(body("b", *O),), joint=joints)
    driven = scene.with_(driver=(Driver(joint="R", polynomial=(0.0, 1.0)),))
    assert exchange._bearing(driven, "R") == ["revolute", "cylindrical"]
    assert len(exchange._bearing(driven, "C")) == 9, "nothing acts on it"
    sprung = scene.with_(load=(TorsionSpring(joint="C", stiffness=1.0), JointForce(joint="C", force=1.0)))
    assert exchange._bearing(sprung, "C") == ["cylindrical"] and len(exchange._bearing(sprung, "R")) == 9
    pushed = scene.with_(load=(JointForce(joint="T", force=1.0),))
    assert exchange._bearing(pushed, "T") == ["translational", "cylindrical"]
