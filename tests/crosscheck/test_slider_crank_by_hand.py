"""Slider-cranks in a plane / lengths, angles of the rod, parts and poses worked out by hand."""

from __future__ import annotations

import math
from importlib import import_module
from typing import Any

import numpy as np
import pytest

from crosscheck.judge.constraints import closure
from crosscheck.judge.truth.planar_slider_crank import Lengths, _chained, parts_of, planar_slider_crank
from mbref import rotations
from mbref.scene import Body, Distance, Driver, Fixed, Revolute, Scene, Spherical, Translational, Universal

X, Y, Z, O = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)


# --- lengths and angles -----------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("a", "b", "h", "equal", "fully"),
    [
        (1.0, 1.0, 0.0, True, True),
        (1.0, 1.0 + 0.9e-13, 0.0, True, True),
        (1.0, 1.0 - 0.9e-13, 0.0, True, True),
        (1.0, 1.0 - 1.1e-13, 0.0, False, False),
        (2.0, 2.0, -1.9e-13, True, True),
        (2.0, 2.0, 2e-13, True, True),
        (2.0 + 1.9e-13, 2.0, 0.0, True, True),
        (2.0, 2.0, 2.1e-13, False, False),
        (0.5, 1.0, 0.25, False, True),
        (0.5, 1.0, -0.5, False, False),
        (0.5, 1.0, 0.49, False, True),
        (0.5, 1.0, -0.49, False, True),
        (1.5, 1.0, 0.0, False, False),
    ],
)
def test_cranks_that_turn_fully(a, b, h, equal, fully):
    """Crank and offset are shorter than the rod, or crank and rod are equal to 1e-13."""
    found = Lengths(a, b, h, 0.3, 0.4)
    assert (found.equal(), found.turns_fully()) == (equal, fully)


def test_lengths_that_are_equal_to_the_last_digit(monkeypatch):
    monkeypatch.setattr(import_module(Lengths.__module__), "SAME_LENGTH", 0.0)
    assert Lengths(0.7, 0.7, 0.0, 0.3, 0.4).equal() and not Lengths(0.7, 0.7, 1e-300, 0.3, 0.4).equal()


@pytest.mark.parametrize(("phi0", "side"), [(0.2, 1.0), (math.pi - 0.2, -1.0), (-3.0, -1.0)])
@pytest.mark.parametrize("h", [0.3, -0.2])
def test_angles_of_the_rod(phi0, side, h):
    """b sin φ = h - a sin θ on the side of the start, and derivatives by differences."""
    lengths, theta, step = Lengths(0.5, 1.25, h, 0.7, phi0), np.array([-2.0, 0.0, 0.9, 2.5]), 1e-3
    phi, slope, bend = lengths.rod(theta)
    assert (
        1.25 * np.sin(phi) == pytest.approx(h - 0.5 * np.sin(theta)) and (np.sign(np.cos(phi)) == side).all()
    )
    values = [lengths.rod(theta + k * step) for k in (-2, -1, 1, 2)]
    first = [(v[0] - 8 * v[1] + 8 * v[2] - v[3]) / (12 * step) for v in zip(*values, strict=True)]
    assert slope == pytest.approx(first[0], abs=1e-9) and bend == pytest.approx(first[1], abs=1e-9)


@pytest.mark.parametrize(
    ("phi0", "slope"),
    [(-0.7, -1.0), (0.7 + math.pi, 1.0), (0.7 - math.pi, 1.0), (-0.7 + 2 * math.pi, -1.0)],
)
def test_a_rod_as_long_as_the_crank(phi0, slope):
    """It turns by the opposite angle, or it is folded and turns with the crank."""
    theta = np.array([0.7, 1.7, 4.0])
    phi, first, second = Lengths(2.0, 2.0, 0.0, 0.7, phi0).rod(theta)
    assert phi == pytest.approx(phi0 + slope * (theta - 0.7))
    assert first.tolist() == [slope] * 3 and second.tolist() == [0.0] * 3


def test_a_rod_at_a_singular_position_is_not_folded():
    """At θ₀ = 90° both branches meet; the one with the slider in motion is taken."""
    for theta0, slope in ((math.pi / 2, -1.0), (math.pi / 2 - 1e-3, 1.0)):
        assert Lengths(1.0, 1.0, 0.0, theta0, theta0 - math.pi).rod(np.array([theta0]))[1].tolist() == [slope]
    assert Lengths(1.0, 1.0, 0.0, math.pi / 2, -math.pi / 2 + 0.4e-9).rod(np.array([1.0]))[1].tolist() == [
        -1.0
    ]


def test_a_path_by_an_angle():
    """(1, 2, 3) at the angle, its derivatives (4, 5, 6) and (7, 8, 9) by it: slope 2, bend 10."""
    path = tuple(np.array([row]) for row in ([1.0, 2, 3], [4.0, 5, 6], [7.0, 8, 9]))
    found = _chained(path, np.array([2.0]), np.array([10.0]))
    assert [part.tolist() for part in found] == [[[1, 2, 3]], [[8, 10, 12]], [[68, 82, 96]]]


# --- parts ------------------------------------------------------------------------------------------------
def body(name: str, *place: float, **parts: Any) -> Body:
    return Body(**{"name": name, "mass": 2.0, "inertia": (0.3, 0.4, 0.5), "position": place, **parts})


def pin(name: str, first: str, second: str, *anchor: float, axis: tuple[float, ...] = Z) -> Revolute:
    return Revolute(name=name, bodies=(first, second), anchor=anchor, axis=axis)


# crank of (0.3, 0.4) m about z at (1, 0, 0); the rod of (1.2, -0.2) m; its line is along x or is tilted
def linkage(
    order: str = "crs", line: tuple[float, ...] = X, axis: tuple[float, ...] = (0.0, 0.0, 2.0)
) -> Scene:
    parts = {
        "c": body("crank", 1.1, 0.3, 0.2, orientation=(0.8, 0.6, 0.0, 0.0)),
        "r": body("rod", 2.0, 0.5, 0.1, orientation=(0.8, 0.0, 0.0, 0.6)),
        "s": body("block", 2.7, 0.1, 0.3, orientation=(0.6, 0.0, 0.8, 0.0)),
    }
    joints = (
        pin("A", "crank", "ground", 1.0, 0.0, 0.0, axis=axis),
        pin("B", "rod", "crank", 1.3, 0.4, 0.0),
        Spherical(name="C", bodies=("rod", "block"), anchor=(2.5, 0.2, 0.0)),
        Translational(name="D", bodies=("ground", "block"), anchor=(2.5, 0.2, 0.0), axis=line),
    )
    return Scene(name="s", body=tuple(parts[name] for name in order), joint=joints, gravity=O)


def changed(scene: Scene, place: int, joint: Any) -> Scene:
    return scene.with_(joint=(*scene.joint[:place], joint, *scene.joint[place + 1 :]))


def test_parts_of_a_slider_crank():
    for order in ("crs", "src", "rsc"):
        found = parts_of(linkage(order), Revolute)
        assert [found.crank, found.rod, found.slider] == [order.index(name) for name in "crs"]
        assert [joint.name for joint in found[3:]] == list("ABCD")
    given = linkage()
    assert parts_of(given, Universal) is None
    cross = Universal(name="B", bodies=("crank", "rod"), anchor=(1.3, 0.4, 0.0), axes=(Z, X))
    assert parts_of(changed(given, 1, cross), Universal).pin is cross
    assert parts_of(given.with_(body=given.body[:2], joint=given.joint[:2]), Revolute) is None
    assert parts_of(given.with_(joint=given.joint[:3]), Revolute) is None
    rail = given.joint[3]
    for joint in (
        rail.model_copy(update={"bodies": ("rod", "block")}),
        rail.model_copy(update={"bodies": ("ground", "crank")}),
        Fixed(name="D", bodies=("ground", "block"), anchor=O),
    ):
        assert parts_of(changed(given, 3, joint), Revolute) is None, joint
    more = pin("E", "ground", "rod", 0.0, 0.0, 0.0)
    assert parts_of(changed(given, 2, more), Revolute) is None, "two pivots"
    stay = Distance(name="E", bodies=("rod", "block"), anchors=(O, X))
    assert parts_of(given.with_(joint=(*given.joint, stay)), Revolute) is None, "five joints"
    assert parts_of(given.with_(body=(*given.body, body("more", 9.0, 0.0, 0.0))), Revolute) is None
    distance = Distance(name="C", bodies=("rod", "block"), anchors=(O, X))
    assert parts_of(changed(given, 2, distance), Revolute) is None
    other = Spherical(name="C", bodies=("crank", "block"), anchor=O)
    assert parts_of(changed(given, 2, other), Revolute) is None
    assert parts_of(changed(given, 0, pin("A", "rod", "crank", 0.0, 0.0, 0.0)), Revolute) is None, "no pivot"


# --- poses ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("q", [0.0, 1.3, -2.2])
@pytest.mark.parametrize(
    ("order", "line", "axis"),
    [("crs", X, (0.0, 0.0, 2.0)), ("src", (-3.0, 0.0, 0.0), Z), ("rcs", (0.8, 0.1, 0.0), (0.0, 0.0, -1.0))],
)
def test_the_path_of_a_planar_slider_crank(order, line, axis, q):
    """Its joints stay closed, and rates and second derivatives are differences of its poses."""
    given = linkage(order, line, axis)
    path, h = planar_slider_crank(given), 1e-3
    pose = path.poses((q + h * np.arange(-2, 3)).astype(np.longdouble))
    place = pose.position.astype(float)
    gaps = closure(given, np.zeros(5), place, rotations.from_matrix(pose.rotation.astype(float)))
    assert max(np.abs(gap).max() for gap in gaps.values()) < 1e-13 and path.family == "planar_slider_crank"
    weights = np.array([1, -8, 0, 8, -1]) / (12 * h)
    pairs = ("position", "dposition"), ("dposition", "ddposition"), ("spin", "dspin")
    for values, rates in ((getattr(pose, of), getattr(pose, by)) for of, by in pairs):
        slope = np.tensordot(weights, values, 1)
        assert slope.astype(float) == pytest.approx(rates[2].astype(float), abs=1e-8)
    rate = np.tensordot(weights, pose.rotation, 1) @ np.swapaxes(pose.rotation[2], 1, 2)
    spin = np.stack([rate[:, 2, 1], rate[:, 0, 2], rate[:, 1, 0]], axis=1)
    assert spin.astype(float) == pytest.approx(pose.spin[2].astype(float), abs=1e-8)
    turn = np.tensordot(weights, pose.turn, 1)
    assert (turn[:, None] * path.axis).astype(float) == pytest.approx(spin.astype(float), abs=1e-8)
    if q == 0.0:
        assert place[2] == pytest.approx(np.array([b.position for b in given.body]))
        turns = rotations.to_matrix(np.array([b.orientation for b in given.body]))
        assert pose.rotation[2].astype(float) == pytest.approx(turns)
        assert pose.turn[2].astype(float) == pytest.approx([0.0] * 3, abs=1e-15)
    signs = [path.driven_sign(Driver(joint=name, polynomial=(0.0, 1.0))) for name in "ABD"]
    assert signs == [-1.0, None, None], "the second body of the pivot is the ground"


def test_a_crank_that_points_backwards():
    """The rod points forwards; after a turn of 0.5 rad the joints are closed."""
    given = changed(linkage(), 0, pin("A", "crank", "ground", 1.6, 0.0, 0.0))
    pose = planar_slider_crank(given).poses(np.array([0.0, 0.5]))
    turns = rotations.from_matrix(pose.rotation.astype(float))
    gaps = closure(given, np.zeros(2), pose.position.astype(float), turns)
    assert max(np.abs(gap).max() for gap in gaps.values()) < 1e-13


def test_linkages_that_have_no_path():
    given = linkage()
    assert planar_slider_crank(given.with_(joint=given.joint[:3])) is None
    for tilt, has_path in ((0.9e-9, True), (1.1e-9, False)):
        assert (planar_slider_crank(linkage(line=(1.0, 0.0, tilt))) is not None) is has_path
    centred = changed(given, 1, pin("B", "rod", "crank", 1.0, 0.0, 5.0))
    assert planar_slider_crank(centred) is None, "the crank has no length across its axis"
    short = changed(given, 2, Spherical(name="C", bodies=("rod", "block"), anchor=(1.4, 0.4, 0.0)))
    assert planar_slider_crank(short) is None, "the rod is shorter than the crank"
