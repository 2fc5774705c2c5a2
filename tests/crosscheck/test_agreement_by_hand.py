"""Comparison of a scene with its MJCF model / masses, springs, ranks and messages worked out by hand.

Body a turns by 90° about z from its start at (1, 0, 0) and moves to (0, 2, 1); body b turns by 90° about x
from its start at (3, 0, 0) and moves to (1, 1, 0).
"""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.engines.mujoco.importing import agreement, chains
from crosscheck.engines.mujoco.importing.agreement import Agreement
from crosscheck.engines.mujoco.importing.groups import Piece
from mbref.scene import (
    Body,
    Cylindrical,
    JointTorque,
    Moment,
    Revolute,
    Scene,
    SceneError,
    SlideSpring,
    Spring,
    TorsionSpring,
)

HALF = math.sqrt(0.5)
X, Y, Z, O = np.eye(3)[0], np.eye(3)[1], np.eye(3)[2], np.zeros(3)
BODIES = tuple(
    Body(name=name, mass=mass, inertia=(2.0, 3.0, 4.0), position=place)
    for name, mass, place in (("a", 2.0, (1.0, 0.0, 0.0)), ("b", 3.0, (3.0, 0.0, 0.0)))
)
PLACES = np.array([[0.0, 2.0, 1.0], [1.0, 1.0, 0.0]])
POSE = PLACES, np.array([[HALF, 0.0, 0.0, HALF], [HALF, HALF, 0.0, 0.0]])
MOTION = np.array([[0.1, 0.2, 0.3, 0.5, -0.4, 0.6], [0.7, -0.3, 0.2, -0.2, 0.8, 0.1]])
SHAFT = Cylindrical(name="J", bodies=("a", "b"), anchor=(2.0, 0.0, 0.0), axis=(0.0, 0.0, 5.0))


def scene(*loads: Any, **parts: Any) -> Scene:
    return Scene(
        **{
            "name": "s",
            "body": BODIES,
            "joint": (SHAFT,),
            "load": loads,
            "gravity": (0.0, 0.0, -10.0),
            **parts,
        }
    )


def pushes(*loads: Any, **parts: Any) -> np.ndarray:
    """Forces and moments (2, 6) about the centres, without the weights."""
    found = agreement._pushes(scene(*loads, **parts), POSE, MOTION).reshape(2, 6).copy()
    assert agreement._pushes(scene(**parts), POSE, MOTION).tolist() == [
        0,
        0,
        -20,
        0,
        0,
        0,
        0,
        0,
        -30,
        0,
        0,
        0,
    ]
    found[:, 2] += [20.0, 30.0]
    return found


def wrench(body: int, force: np.ndarray, point: np.ndarray, moment: np.ndarray = O) -> np.ndarray:
    return np.concatenate([force, moment + np.cross(point - PLACES[body], force)])


def rate(body: int, point: np.ndarray) -> np.ndarray:
    return MOTION[body, :3] + np.cross(MOTION[body, 3:], point - PLACES[body])


# --- masses and loads -------------------------------------------------------------------------------------
def test_the_mass_matrix_in_world_axes():
    """Principal moments 2, 3, 4: a quarter turn about z exchanges the first two, about x the last two."""
    found = agreement._masses(scene(), POSE[1])
    assert np.diag(found) == pytest.approx([2, 2, 2, 3, 2, 4, 3, 3, 3, 2, 4, 3])
    assert np.abs(found - np.diag(np.diag(found))).max() < 1e-15


def test_inertial_forces_have_gyroscopic_moments():
    drift = np.arange(12.0)
    found = agreement._inertial(agreement._masses(scene(), POSE[1]), MOTION, drift).reshape(2, 6)
    for k, (mass, moments) in enumerate(((2.0, [3, 2, 4]), (3.0, [2, 4, 3]))):
        spin = MOTION[k, 3:]
        assert found[k, :3] == pytest.approx(mass * drift[6 * k : 6 * k + 3])
        wanted = moments * drift[6 * k + 3 : 6 * k + 6] + np.cross(spin, moments * spin)
        assert found[k, 3:] == pytest.approx(wanted)


@pytest.mark.parametrize("ends", [("a", "b"), ("b", "a"), ("ground", "b"), ("a", "ground")])
def test_a_damped_spring(ends):
    """Points (1.5, 0, 0) on a and (3, 0, 0.5) on b are at (0, 2.5, 1) and (1, 0.5, 0) now."""
    start = {"a": (1.5, 0.0, 0.0), "b": (3.0, 0.0, 0.5), "ground": (0.3, 0.2, 0.1)}
    now = {
        "a": np.array([0.0, 2.5, 1.0]),
        "b": np.array([1.0, 0.5, 0.0]),
        "ground": np.array([0.3, 0.2, 0.1]),
    }
    spring = Spring(
        bodies=ends, points=[start[name] for name in ends], stiffness=7.0, damping=2.0, natural_length=0.5
    )
    p, q = (now[name] for name in ends)
    u, v = (O if name == "ground" else rate("ab".index(name), now[name]) for name in ends)
    length = np.linalg.norm(q - p)
    along = (q - p) / length
    pull = (7.0 * (length - 0.5) + 2.0 * (v - u) @ along) * along
    wanted = np.zeros((2, 6))
    for name, sign in zip(ends, (1, -1), strict=True):
        if name != "ground":
            k = "ab".index(name)
            wanted[k] += wrench(k, sign * pull, now[name])
    assert pushes(spring) == pytest.approx(wanted, abs=1e-12)


@pytest.mark.parametrize("ends", [("a", "b"), ("b", "a"), ("ground", "a"), ("a", "ground")])
def test_a_damped_torsion_spring(ends):
    """About z: body a has turned by 90°; b has turned about x only."""
    hinge = Revolute(name="J", bodies=ends, anchor=O.tolist(), axis=(0.0, 0.0, 2.0))
    twist = TorsionSpring(joint="J", stiffness=8.0, damping=0.5, natural_angle=0.25)
    spins = {"a": MOTION[0, 3:], "b": MOTION[1, 3:], "ground": O}
    axis = {"a": Z, "b": -Y, "ground": Z}[ends[0]]
    angle = {
        ("a", "b"): -math.pi / 2,
        ("b", "a"): math.pi / 2,
        ("ground", "a"): math.pi / 2,
        ("a", "ground"): -math.pi / 2,
    }
    moment = (8.0 * (angle[ends] - 0.25) + 0.5 * axis @ (spins[ends[1]] - spins[ends[0]])) * axis
    wanted = np.zeros((2, 6))
    for name, sign in zip(ends, (1, -1), strict=True):
        if name != "ground":
            wanted["ab".index(name), 3:] += sign * moment
    assert pushes(twist, joint=(hinge,)) == pytest.approx(wanted, abs=1e-12)


@pytest.mark.parametrize("ends", [("a", "b"), ("b", "a"), ("ground", "b"), ("a", "ground")])
def test_a_damped_slide_spring(ends):
    """Along y: the anchor (2, 0, 0) is at (0, 3, 1) on a and at (0, 1, 0) on b; y is -x on a and z on b."""
    slide = Cylindrical(name="J", bodies=ends, anchor=(2.0, 0.0, 0.0), axis=(0.0, 3.0, 0.0))
    spring = SlideSpring(joint="J", stiffness=6.0, damping=0.7, natural_displacement=0.4)
    now = {
        "a": np.array([0.0, 3.0, 1.0]),
        "b": np.array([0.0, 1.0, 0.0]),
        "ground": np.array([2.0, 0.0, 0.0]),
    }
    axis = {"a": -X, "b": Z, "ground": Y}[ends[0]]
    p, q = (now[name] for name in ends)
    u, v = (O if name == "ground" else rate("ab".index(name), now[name]) for name in ends)
    spin = O if ends[0] == "ground" else MOTION["ab".index(ends[0]), 3:]
    speed = axis @ (v - u) + np.cross(spin, axis) @ (q - p)
    push = (6.0 * (axis @ (q - p) - 0.4) + 0.7 * speed) * axis
    wanted = np.zeros((2, 6))
    for name, sign in zip(ends, (1, -1), strict=True):
        if name != "ground":
            k = "ab".index(name)
            wanted[k] += wrench(k, sign * push, q)
    assert pushes(spring, joint=(slide,)) == pytest.approx(wanted, abs=1e-12)


def test_actuators_are_off():
    assert not pushes(Moment(body="a", moment=(0.0, 0.0, 1.0)), JointTorque(joint="J", torque=1.0)).any()


# --- comparisons ------------------------------------------------------------------------------------------
def comparison(**parts: Any) -> Agreement:
    made = Agreement.__new__(Agreement)
    names = {0: "first", 1: "second"}
    made.model = SimpleNamespace(
        dof_jntid=np.array([0, 1]), joint=lambda j: SimpleNamespace(name=names[j]), jnt_bodyid=[0, 1], nv=2
    )
    made.poses = SimpleNamespace(
        extent=1.0, mass=lambda: np.eye(2), jacobian=lambda: np.zeros((0, 2)), **parts
    )
    return made


@pytest.mark.parametrize(("off", "is_same"), [(3.9e-8, True), (4.1e-8, False)])
def test_numbers_that_differ_name_the_joint(monkeypatch, off, is_same):
    """1e-8 of the largest entry, 4."""
    monkeypatch.setattr(agreement, "joint_name", lambda model, j: repr(model.joint(j).name))
    ours = np.array([1.0, 4.0])
    theirs = ours + np.array([0.0, off])
    if is_same:
        comparison()._same(ours, theirs, "springs")
        return
    for one, other in ((ours, theirs), (theirs, ours)):
        with pytest.raises(
            SceneError, match=r"joint 'second': the scene's springs and the file's differ by 1\.02e-08"
        ):
            comparison()._same(one, other, "springs")
    with pytest.raises(SceneError, match="joint 'first'"):
        comparison()._same(np.diag(ours), np.array([[1.0, 1e-3], [0.0, 4.0]]), "mass matrix")


def test_independent_rows():
    assert agreement.rank(np.zeros((0, 3))) == 0 == agreement.rank(np.zeros((2, 3)))
    assert agreement.rank(np.diag([1.0, 1.1e-8])) == 2 and agreement.rank(np.diag([1.0, 0.9e-8])) == 1
    rows = np.array([[3.0, 4.0], [0.0, 1e-9], [0.0, 2.0]])
    assert agreement._unit(rows, 1e-8).tolist() == [[0.6, 0.8], [0.0, 1.0]]


def test_joints_of_the_tree_that_the_file_violates():
    """The shaft has its axis along z on a and along -y on b, and its anchors are apart."""
    with pytest.raises(SceneError, match="joint 'J': the file's motion violates the scene's joint by"):
        comparison()._tree(scene(), ["J"], POSE, np.zeros((12, 2)))
    start = np.array([b.position for b in BODIES]), np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))
    free = np.zeros((12, 2))
    free[8, 0] = 1.0  # b slides along z
    free[[7, 11], 1] = 1.0, 1.0  # b turns about z at (2, 0, 0)
    fixed = Cylindrical(name="K", bodies=("ground", "a"), anchor=O.tolist(), axis=(0.0, 0.0, 1.0))
    whole = scene(joint=(SHAFT,))
    with pytest.raises(SceneError, match="the scene's joints allow 8 motions without loops, the file's 2"):
        comparison()._tree(whole, ["J"], start, free)
    wrong = free.copy()
    wrong[6, 1] = 1.0
    with pytest.raises(SceneError, match="the scene's joints forbid motion that the file's joints allow"):
        comparison()._tree(whole, ["J"], start, wrong)
    both = np.zeros((12, 4))
    both[:, :2] = free
    both[[2, 8], 2] = 1.0
    both[[1, 5, 7, 11], 3] = 1.0, 1.0, 3.0, 1.0
    comparison()._tree(scene(joint=(SHAFT, fixed)), ["J", "K"], start, both)


def test_loops_with_other_rows():
    made = comparison()
    made._equalities = lambda: np.array([[1.0, 0.0]])  # type: ignore[method-assign]
    start = np.array([b.position for b in BODIES]), np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))
    free = np.zeros((12, 2))
    free[8, 0], free[7, 1] = 1.0, 1.0
    with pytest.raises(SceneError, match="the scene's rows have rank 1, the file's 1, together 2"):
        made._loops(scene(), ["J"], start, free)
    made._equalities = lambda: np.array([[0.0, 2.0]])  # type: ignore[method-assign]
    made._loops(scene(), ["J"], start, free)


# --- chains -----------------------------------------------------------------------------------------------
def test_chains_pass_groups_that_are_no_bodies():
    """Group 1 is a link that joint 0 moves; group 2 is a body behind it, and group 3 is on group 2."""
    kinds = ("hinge", "slide", "hinge", "ball")
    groups = SimpleNamespace(
        pieces=[Piece(1, 0), Piece(2), Piece(3)],
        members={0: [], 1: [], 2: [], 3: []},
        joints=lambda g: {1: [0], 2: [1, 2], 3: [3]}[g],
        parent=lambda g: g - 1,
        model=SimpleNamespace(jnt_type=[0, 1, 2, 3]),
    )
    mujoco = SimpleNamespace(mjtJoint=lambda k: SimpleNamespace(name=f"mjJNT_{kinds[k].upper()}"))
    data = SimpleNamespace(xanchor=np.arange(12.0).reshape(4, 3), xaxis=-np.arange(12.0).reshape(4, 3))
    second, third = chains.chains(mujoco, groups, data)
    assert second.joints == (0, 1, 2) and second.kinds == ("hinge", "slide", "hinge")
    assert [piece.group for piece in second.ends] == [0, 2] and second.anchors[1].tolist() == [3.0, 4.0, 5.0]
    assert third.joints == (3,) and [piece.group for piece in third.ends] == [2, 3]
    assert third.axes.tolist() == [[-9.0, -10.0, -11.0]]


def test_groups_without_effect():
    """Groups 1 and 3 have no mass: 1 carries 2, which has; 3 carries 4, which has none."""
    children = {0: [1, 3], 1: [2], 2: [], 3: [4], 4: []}
    groups = SimpleNamespace(
        members={g: [] for g in children}, mass=[0.0, 0.0, 1.5, 0.0, 0.0], children=children.get
    )
    assert chains.without_effect(groups, ()) == [3, 4] and chains.without_effect(groups, (4,)) == []
    assert chains.without_effect(groups, (3,)) == [4]
    assert chains.branching(groups, ()) == [] and chains.branching(groups, (3,)) == [3]
    children[1] = [2, 3]
    assert chains.branching(groups, (4,)) == [1, 4], "it carries a mass, and a link that is held"
