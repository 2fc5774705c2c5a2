"""Closed forms of the judge against formulas, and scenes that have no closed form."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from crosscheck.judge.constraints import closure
from crosscheck.judge.truth import closed_form
from crosscheck.judge.truth.free_body import free_body
from crosscheck.judge.truth.locked import locked
from crosscheck.judge.truth.one_dof import one_dof
from crosscheck.judge.truth.parallelogram import parallelogram
from crosscheck.judge.truth.spatial_slider_crank import spatial_slider_crank
from mbref import rotations
from mbref.scene import (
    Body,
    Coupling,
    Cylindrical,
    Driver,
    Factor,
    JointForce,
    JointTorque,
    Moment,
    Revolute,
    Scene,
    Spherical,
    Translational,
    Universal,
)

X, Y, Z, O = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)


def body(name: str, *place: float, **parts: Any) -> Body:
    given = {"mass": 2.0, "inertia": (0.3, 0.4, 0.5), "position": place or X}
    return Body(name=name, **{**given, **parts})


def pin(name: str, first: str, second: str, *anchor: float, axis: tuple[float, ...] = Z) -> Revolute:
    return Revolute(name=name, bodies=(first, second), anchor=anchor, axis=axis)


def scene(bodies: Any, joints: Any, **parts: Any) -> Scene:
    return Scene(name="s", body=tuple(bodies), joint=tuple(joints), **{"gravity": O, **parts})


PENDULUM = scene([body("bar", 0.0, -2.0, 0.5)], [pin("A", "ground", "bar", 0.0, 0.0, 0.5)])
# cranks of 1 m at (0, 0, 0) and (3, 0, 0) that point upwards, and a coupler between their ends
BOX = scene(
    [body("left", 0.0, 0.5, 0.0), body("top", 1.5, 1.2, 0.0), body("right", 3.0, 0.5, 0.0)],
    [
        pin("A", "ground", "left", 0.0, 0.0, 0.0),
        pin("B", "left", "top", 0.0, 1.0, 0.0),
        pin("C", "top", "right", 3.0, 1.0, 0.0),
        pin("D", "right", "ground", 3.0, 0.0, 0.0, axis=(0.0, 0.0, -2.0)),
    ],
)


# --- which scenes have a closed form ----------------------------------------------------------------------


@pytest.mark.parametrize(
    "parts",
    [
        {"load": (Moment(body="bar", moment=Z, factor=Factor(start=0.5)),)},
        {"load": (JointTorque(joint="A", torque=1.0),)},
        {"load": (Moment(body="bar", moment=Z), JointForce(joint="B", force=1.0))},
        {"driver": (Driver(joint="A", table=((0.0, 0.0), (1.0, 1.0), (2.0, 0.0), (3.0, 1.0))),)},
        {"joint": (PENDULUM.joint[0].model_copy(update={"armature": 0.5}),)},
        {"coupling": (Coupling(name="G", joints=("B", "B"), ratio=1.0),)},
    ],
)
def test_a_pendulum_with_a_part_outside_its_closed_form_has_none(parts):
    """The cylindrical joint on the hinge's axis constrains nothing: with it the closed form remains."""
    sleeve = Cylindrical(name="B", bodies=("ground", "bar"), anchor=(0.0, 0.0, 0.5), axis=Z)
    given = PENDULUM.with_(joint=(*PENDULUM.joint, sleeve))
    assert closed_form(given).name == "pendulum"
    changes = {**parts, "joint": (*parts.get("joint", PENDULUM.joint), sleeve)}
    assert closed_form(given.with_(**changes)) is None


def test_a_parallelogram_without_masses_has_a_closed_form_only_if_it_is_driven():
    driver = Driver(joint="A", polynomial=(0.0, 1.0))
    plain = tuple(Body(name=b.name, position=b.position) for b in BOX.body)
    assert closed_form(BOX.with_(body=plain)) is None
    assert closed_form(BOX.with_(body=plain, driver=(driver,))).name == "parallelogram"


def test_a_free_body_falls_and_spins_uniformly_about_a_principal_axis():
    """It falls by g t² / 2 and turns about z at 2 rad/s; a moment of 1.5 N m on 0.5 kg m² adds 3 rad/s²."""
    falling = scene(
        [body("bar", velocity=(1.0, 0.0, 0.0), angular_velocity=(0.0, 0.0, 2.0))],
        [],
        gravity=(0.0, -10.0, 0.0),
    )
    found = free_body(falling).poses(np.array([0.0, 0.5]))
    assert found.position[1, 0] == pytest.approx([1.5, -1.25, 0.0])
    assert found.velocity[1, 0] == pytest.approx([1.0, -5.0, 0.0])
    assert found.acceleration[1, 0] == pytest.approx([0.0, -10.0, 0.0])
    assert found.angular_velocity[1, 0] == pytest.approx([0.0, 0.0, 2.0])
    assert found.orientation[1, 0] == pytest.approx([math.cos(0.5), 0.0, 0.0, math.sin(0.5)])
    pushed = falling.with_(load=(Moment(body="bar", moment=(0.0, 0.0, 1.5)),))
    found = free_body(pushed).poses(np.array([0.5]))
    assert found.angular_velocity[0, 0] == pytest.approx([0.0, 0.0, 3.5]), "2 rad/s + 3 rad/s² · 0.5 s"
    assert found.angular_acceleration[0, 0] == pytest.approx([0.0, 0.0, 3.0])


def test_a_body_on_one_hinge_or_on_two_coaxial_hinges_is_not_locked():
    """Two hinges have ten constraint rows, of which five are redundant: one freedom is left."""
    assert locked(PENDULUM) is None
    assert locked(PENDULUM.with_(joint=(*PENDULUM.joint, pin("B", "ground", "bar", 0.0, 0.0, 0.0)))) is None


# --- slider-cranks in space -------------------------------------------------------------------------------


# crank of 0.4 m along x about y; the rod of 1.2, 0.3 and 0.5 m ends on a line along z or x
def spatial(line: tuple[float, ...], order: str = "crs", reverse: bool = False, way: float = 1.0) -> Scene:
    parts = {
        "c": body("crank", 0.1, 0.05, 0.0, orientation=(0.8, 0.6, 0.0, 0.0)),
        "r": body("rod", 0.9, 0.2, 0.3, orientation=(0.8, 0.0, 0.6, 0.0)),
        "s": body("block", 1.5, 0.3, 0.7, orientation=(0.6, 0.0, 0.0, 0.8)),
    }
    bodies = ("rod", "crank") if reverse else ("crank", "rod")
    axes = ((0.0, 1.2, 1.6), (0.3, -0.8 * way, 0.6 * way))
    joints = (
        pin("A", "ground", "crank", 0.0, 0.0, 0.0, axis=(0.0, 3.0, 0.0)),
        Universal(name="B", bodies=bodies, anchor=(0.4, 0.0, 0.0), axes=axes[::-1] if reverse else axes),
        Spherical(name="C", bodies=("rod", "block"), anchor=(1.6, 0.3, 0.5)),
        Translational(name="D", bodies=("ground", "block"), anchor=(1.6, 0.3, 0.5), axis=line),
    )
    return scene([parts[name] for name in order], joints)


@pytest.mark.parametrize("q", [-0.7, 0.0, 0.4])
@pytest.mark.parametrize(
    ("line", "order", "reverse", "way"),
    [
        ((2.0, 0.0, 0.0), "crs", False, 1.0),
        ((-2.0, 0.0, 0.0), "src", True, 1.0),
        ((0.0, 0.0, 1.0), "rcs", False, -1.0),
        ((0.6, 0.0, 0.8), "scr", True, -1.0),
    ],
)
def test_path_of_a_spatial_slider_crank_keeps_its_joints_and_matches_differences(
    line, order, reverse, way, q
):
    """Poses at crank angle q close the joints; their derivatives by q are differences of fourth order.

    Only a driver of the hinge A prescribes q.
    """
    given = spatial(line, order, reverse, way)
    path, h = spatial_slider_crank(given), 1e-4
    places = q + h * np.arange(-2, 3)
    pose = path.poses(places.astype(np.longdouble))
    turns = rotations.from_matrix(pose.rotation.astype(float))
    gaps = closure(given, np.zeros(5), pose.position.astype(float), turns)
    assert max(np.abs(gap).max() for gap in gaps.values()) < 1e-13 and path.family == "spatial_slider_crank"
    if q == 0.0:
        starts = [[b.position for b in given.body], [b.orientation for b in given.body]]
        assert pose.position[2].astype(float) == pytest.approx(np.array(starts[0]), abs=1e-15)
        assert rotations.to_matrix(np.array(starts[1])) == pytest.approx(pose.rotation[2].astype(float))
    weights = np.array([1, -8, 0, 8, -1]) / (12 * h)
    slopes = [np.tensordot(weights, getattr(pose, name), 1) for name in ("position", "rotation", "spin")]
    assert slopes[0].astype(float) == pytest.approx(pose.dposition[2].astype(float), rel=1e-8, abs=1e-8)
    rate = slopes[1] @ np.swapaxes(pose.rotation[2], 1, 2)
    spin = np.stack([rate[:, 2, 1], rate[:, 0, 2], rate[:, 1, 0]], axis=1)
    assert spin.astype(float) == pytest.approx(pose.spin[2].astype(float), rel=1e-8, abs=1e-8)
    assert slopes[2].astype(float) == pytest.approx(pose.dspin[2].astype(float), rel=1e-8, abs=1e-8)
    second = np.tensordot(weights, pose.dposition, 1)
    assert second.astype(float) == pytest.approx(pose.ddposition[2].astype(float), rel=1e-8, abs=1e-8)
    crank, rod, block = (order.index(name) for name in "crs")  # the rod turns about no fixed axis
    assert pose.turn[2, [crank, block]].tolist() == [q, 0.0] and math.isnan(pose.turn[2, rod])
    signs = [path.driven_sign(Driver(joint=name, polynomial=(0.0, 1.0))) for name in "AD"]
    assert signs == [1.0, None]


# --- motions along a path ---------------------------------------------------------------------------------
def test_a_weightless_pendulum_turns_at_constant_speed():
    """2 m at -3 rad/s: 6 m/s, and 18 m/s² towards the hinge, at any time; full turns are counted."""
    moving = PENDULUM.with_(body=(body("bar", 0.0, -2.0, 0.5, angular_velocity=(0.0, 0.0, -3.0)),))
    truth = one_dof(moving, parallelogram(moving))
    found = truth.poses(np.array([0.0, math.pi / 6]))
    assert found.position[:, 0] == pytest.approx(np.array([[0, -2, 0.5], [-2, 0, 0.5]]), abs=1e-12)
    assert found.velocity[:, 0] == pytest.approx(np.array([[-6, 0, 0], [0, 6, 0.0]]), abs=1e-11)
    assert found.acceleration[:, 0] == pytest.approx(np.array([[0, 18, 0], [18, 0, 0.0]]), abs=1e-11)
    assert found.angular_velocity[:, 0] == pytest.approx(np.tile([0.0, 0.0, -3.0], (2, 1)))
    assert found.angular_acceleration[:, 0] == pytest.approx(np.zeros((2, 3)), abs=1e-11)
    assert truth.coordinate(np.array([0.0, 0.5])) == pytest.approx(np.array([[0.0, -3.0], [-1.5, -3.0]]))
    late = truth.coordinate(np.array([100.0, 0.25, 40.0]))
    assert late == pytest.approx(np.array([[-300.0, -3.0], [-0.75, -3.0], [-120.0, -3.0]]))
    forwards = PENDULUM.with_(body=(body("bar", 0.0, -2.0, 0.5, angular_velocity=(0.0, 0.0, 3.0)),))
    late = one_dof(forwards, parallelogram(forwards)).coordinate(np.array([100.0, 0.0]))
    assert late == pytest.approx(np.array([[300.0, 3.0], [0.0, 3.0]]))
