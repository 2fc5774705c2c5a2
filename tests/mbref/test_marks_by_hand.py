"""Symbols of joints, loads and drivers / points on the page worked out by hand.

The page has 100 px a metre: (x, y, z) is at (100 x, 500 - 100 y). Body b begins at (1, 2, 0) and moves by
0.5 m, then by -0.2 m along x.
"""

from __future__ import annotations

import math
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from mbref.drawing import marks
from mbref.drawing.marks import ACTION, Stage
from mbref.drawing.svg import GREY, INK, PAPER
from mbref.drawing.timeline import Timeline
from mbref.drawing.view import Page, View
from mbref.scene import (
    Body,
    Coupling,
    Cylindrical,
    Distance,
    Driver,
    Fixed,
    Force,
    Inline,
    JointForce,
    JointTorque,
    Moment,
    Planar,
    Revolute,
    Scene,
    SlideSpring,
    Spherical,
    Spring,
    TorsionSpring,
    Translational,
    Universal,
)
from mbref.trajectory import Trajectory

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
PLACE = (1.0, 2.0, 0.0)  # at (100, 300)
PAIR = ("ground", "b")
BODIES = (
    Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=PLACE),
    Body(name="c", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(4.0, 1.0, 0.0)),
)
MOVES = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [-0.2, 0.0, 0.0]])


def stage(view: str = "xy", timeline: Timeline | None = None, **parts: Any) -> Stage:
    scene = Scene(name="s", body=BODIES, **parts)
    place = np.stack([np.array(PLACE) + MOVES, np.tile([4.0, 1.0, 0.0], (3, 1))], axis=1)
    turn, zero = np.tile([1.0, 0.0, 0.0, 0.0], (3, 2, 1)), np.zeros((3, 2, 3))
    motion = Trajectory("s", "e", "1", "m", {}, np.arange(3.0), ("b", "c"), place, turn, zero, zero)
    return Stage(
        scene, motion, Page(View.parse(view), 100.0, np.array([0.0, 5.0]), 0.0, 500.0, 500.0), timeline
    )


def drawn(parts: Any) -> list[ElementTree.Element]:
    text = parts if isinstance(parts, str) else "".join(parts)
    return list(ElementTree.fromstring(f"<svg>{text}</svg>"))


def points(element: ElementTree.Element) -> np.ndarray:
    return np.array([[float(x) for x in pair.split(",")] for pair in element.attrib["points"].split()])


def of_joint(joint: Any, view: str = "xy") -> list[ElementTree.Element]:
    return drawn(marks.joint_mark(stage(view, joint=(joint,)), joint))


# --- the ground -------------------------------------------------------------------------------------------
@pytest.mark.parametrize("bodies", [PAIR, PAIR[::-1]])
def test_a_hatched_triangle_below_a_joint_to_the_ground(bodies):
    hinge = Revolute(name="J", bodies=bodies, anchor=PLACE, axis=Z)
    triangle, hatch = drawn(marks.ground_mark(stage(joint=(hinge,)), hinge))
    assert triangle.attrib["d"] == "M100.0 300.0l-10 16h20z" and triangle.attrib["fill"] == PAPER
    assert hatch.attrib["d"] == (
        "M87.0 316.0h26M91.0 316.0l-5 6M97.0 316.0l-5 6M103.0 316.0l-5 6M109.0 316.0l-5 6"
    )


def test_the_triangle_is_at_the_end_of_a_rod_that_is_on_the_ground():
    rod = Distance(name="J", bodies=("b", "ground"), anchors=(PLACE, (3.0, 1.0, 0.0)))
    triangle, _ = drawn(marks.ground_mark(stage(joint=(rod,)), rod))
    assert triangle.attrib["d"].startswith("M300.0 400.0l")


@pytest.mark.parametrize("kind", [Translational, Cylindrical, Inline])
@pytest.mark.parametrize("bodies", [PAIR, PAIR[::-1]])
def test_a_guide_is_longer_than_the_travel(kind, bodies):
    """From 0.2 m behind to 0.5 m ahead of the anchor, and 42 px more at both ends."""
    slide = kind(name="J", bodies=bodies, anchor=PLACE, axis=(2.0, 0.0, 0.0))
    [guide] = drawn(marks.ground_mark(stage(joint=(slide,)), slide))
    assert points(guide).tolist() == [[38.0, 300.0], [192.0, 300.0]] and guide.attrib["stroke"] == GREY


def test_a_plane_on_the_ground_has_a_triangle():
    plane = Planar(name="J", bodies=PAIR, anchor=PLACE, axis=Z)
    assert len(drawn(marks.ground_mark(stage(joint=(plane,)), plane))) == 2


# --- joints -----------------------------------------------------------------------------------------------
BALLS = {
    "revolute": (Revolute(name="J", bodies=PAIR, anchor=PLACE, axis=Z), "5.5", PAPER),
    "spherical": (Spherical(name="J", bodies=PAIR, anchor=PLACE), "5.5", INK),
    "cylindrical": (Cylindrical(name="J", bodies=PAIR, anchor=PLACE, axis=X), "4", PAPER),
    "planar": (Planar(name="J", bodies=PAIR, anchor=PLACE, axis=Z), "4", GREY),
    "inline": (Inline(name="J", bodies=PAIR, anchor=PLACE, axis=X), "3.5", INK),
    "distance": (Distance(name="J", bodies=PAIR, anchors=((3.0, 1.0, 0.0), PLACE)), "3.5", PAPER),
    "universal": (Universal(name="J", bodies=PAIR, anchor=PLACE, axes=(X, Y)), "6.5", PAPER),
}


@pytest.mark.parametrize("kind", BALLS)
def test_the_sign_of_a_joint_is_on_its_second_body(kind):
    joint, radius, fill = BALLS[kind]
    *_, sign = of_joint(joint)
    circle = sign[0]
    assert sign.attrib["transform"] == "translate(100.0,300.0)"
    assert (circle.attrib["r"], circle.attrib["fill"]) == (radius, fill)


def test_signs_without_a_ball():
    [weld] = of_joint(Fixed(name="J", bodies=PAIR, anchor=PLACE))
    assert weld[0].tag == "rect" and weld[0].attrib["x"] == "-5.5" and weld[0].attrib["width"] == "11"
    *_, slide = of_joint(Translational(name="J", bodies=PAIR, anchor=PLACE, axis=X))
    assert not list(slide)


@pytest.mark.parametrize(
    ("axis", "ends"),
    [
        ((3.0, 0.0, 0.0), [[80.0, 300.0], [120.0, 300.0]]),
        ((0.0, 3.0, 4.0), [[100.0, 312.0], [100.0, 288.0]]),
        (Z, None),
        ((0.0, 0.0, -2.0), None),
    ],
)
def test_the_axis_of_a_hinge(axis, ends):
    """20 px to both sides, and none if it points to the reader or away."""
    *axes, _ = of_joint(Revolute(name="J", bodies=PAIR, anchor=PLACE, axis=axis))
    assert [points(line).tolist() for line in axes] == ([] if ends is None else [ends])


def test_both_axes_of_a_universal_joint():
    """The first stands on the ground, and the second moves with body b."""
    cross = Universal(name="J", bodies=PAIR, anchor=PLACE, axes=(X, Y))
    line = Timeline(np.arange(3.0), np.arange(3), 4.0)
    first, second, _ = drawn(marks.joint_mark(stage(timeline=line, joint=(cross,)), cross))
    assert points(first).tolist() == [[80.0, 300.0], [120.0, 300.0]] and not list(first)
    assert points(second).tolist() == [[100.0, 320.0], [100.0, 280.0]]
    assert (
        second[0].attrib["values"] == "100.0,320.0 100.0,280.0;150.0,320.0 150.0,280.0;80.0,320.0 80.0,280.0"
    )


@pytest.mark.parametrize("kind", [Translational, Cylindrical])
def test_a_sleeve(kind):
    """15 px to both sides; the inner line is 11 % shorter at both ends."""
    outer, inner, _ = of_joint(kind(name="J", bodies=PAIR, anchor=PLACE, axis=(5.0, 0.0, 0.0)))
    assert points(outer).tolist() == [[85.0, 300.0], [115.0, 300.0]] and outer.attrib["stroke"] == INK
    assert points(inner) == pytest.approx(np.array([[86.65, 300.0], [113.35, 300.0]]), abs=0.06)
    assert inner.attrib["stroke"] == PAPER


def test_a_line_that_carries_a_point():
    """34 px to both sides of the anchor, on the first body, without a sleeve or an axis."""
    line, sign = of_joint(Inline(name="J", bodies=PAIR, anchor=PLACE, axis=(5.0, 0.0, 0.0)))
    assert points(line).tolist() == [[66.0, 300.0], [134.0, 300.0]] and line.attrib["stroke"] == GREY
    assert sign.tag == "g"


def test_a_rod_of_constant_length():
    rod, _ = of_joint(Distance(name="J", bodies=PAIR, anchors=((3.0, 1.0, 0.0), PLACE)))
    assert points(rod).tolist() == [[300.0, 400.0], [100.0, 300.0]]


def test_a_plane_across_its_normal():
    """A square of 68 px, whose diagonals are 96 px long, and no axis."""
    square, _ = of_joint(Planar(name="J", bodies=PAIR, anchor=PLACE, axis=(0.0, 0.0, 7.0)))
    corners = points(square)
    assert square.tag == "polygon" and corners.mean(axis=0).tolist() == [100.0, 300.0]
    assert sorted(map(tuple, np.abs(corners - [100, 300]).tolist())) == [(34.0, 34.0)] * 4
    sides = np.diff([*corners, corners[0]], axis=0)
    assert np.abs(sides).sum(axis=1).tolist() == [68.0] * 4, "no side is a diagonal"
    seen = points(of_joint(Planar(name="J", bodies=PAIR, anchor=PLACE, axis=(0.0, 3.0, 4.0)))[0])
    assert np.ptp(seen, axis=0) == pytest.approx([68.0, 68.0 * 0.8], abs=0.1)


@pytest.mark.parametrize("kind", [Planar, Inline])
def test_a_plane_and_a_line_move_with_the_first_body(kind):
    line = Timeline(np.arange(3.0), np.arange(3), 4.0)
    for bodies, moves in ((("b", "c"), True), (("c", "b"), False)):
        joint = kind(name="J", bodies=bodies, anchor=PLACE, axis=X)
        first, *_ = drawn(marks.joint_mark(stage(timeline=line, joint=(joint,)), joint))
        assert bool(list(first)) is moves


def test_a_joint_between_two_bodies_is_drawn_at_its_second_body():
    line = Timeline(np.arange(3.0), np.arange(3), 4.0)
    ball = Spherical(name="J", bodies=("c", "b"), anchor=PLACE)
    [sign] = drawn(marks.joint_mark(stage(timeline=line, joint=(ball,)), ball))
    assert sign[-1].attrib["values"] == "100.0,300.0;150.0,300.0;80.0,300.0"


# --- couplings and drivers --------------------------------------------------------------------------------
SHAFT = Revolute(name="A", bodies=PAIR, anchor=PLACE, axis=(0.0, 0.0, 2.0))
SECOND = Cylindrical(name="B", bodies=("ground", "c"), anchor=(4.0, 1.0, 0.0), axis=(3.0, 0.0, 0.0))


def test_a_dotted_line_between_coupled_joints():
    gear = Coupling(name="G", joints=("A", "B"), ratio=2.0)
    [line] = drawn(marks.coupling_mark(stage(joint=(SHAFT, SECOND), coupling=(gear,)), gear))
    assert points(line).tolist() == [[100.0, 300.0], [400.0, 400.0]]


def test_a_spiral_for_a_screw():
    """2¼ turns from 8 px to 17 px."""
    screw = Coupling(name="G", joints=("B", "B"), ratio=2.0)
    [sign] = drawn(marks.coupling_mark(stage(joint=(SHAFT, SECOND), coupling=(screw,)), screw))
    assert sign.attrib["transform"] == "translate(400.0,400.0)" and sign[0].attrib["stroke"] == INK
    spiral = points(sign[0])
    assert spiral[0].tolist() == [8.0, 0.0] and spiral[-1].tolist() == [0.0, 17.0]
    turned = np.unwrap(np.arctan2(spiral[:, 1], spiral[:, 0]))
    assert turned[-1] == pytest.approx(4.5 * math.pi, abs=0.01) and len(spiral) == 60
    assert np.diff(turned) == pytest.approx(np.full(59, 4.5 * math.pi / 59), abs=0.02)


def of_driver(view: str = "xy", **parts: Any) -> ElementTree.Element:
    driver = Driver(**{"joint": "A", **parts})
    [sign] = drawn(marks.driver_mark(stage(view, joint=(SHAFT, SLIDE), driver=(driver,)), driver))
    return sign


SLIDE = Translational(name="S", bodies=("ground", "c"), anchor=(4.0, 1.0, 0.0), axis=(0.0, 2.0, 0.0))
ROUND = {  # the sense of a turn of 15 px is in the arc's first point
    1.0: "M0 15.0A15 15 0 1 0 -15.0 0",
    -1.0: "M0 -15.0A15 15 0 1 1 -15.0 0",
}


@pytest.mark.parametrize(
    ("polynomial", "sense"), [((0.0, 2.0), 1.0), ((0.0, -2.0), -1.0), ((0.0, 0.0, 3.0), 1.0), ((0.0,), 1.0)]
)
def test_a_driver_turns_in_the_direction_of_its_initial_rate(polynomial, sense):
    sign = of_driver(polynomial=polynomial)
    assert sign.attrib["transform"] == "translate(100.0,300.0)"
    assert sign[0].attrib["d"] == ROUND[sense] and sign[0].attrib["stroke"] == ACTION


@pytest.mark.parametrize(("rate", "end"), [(1.0, "0.0,-52.0"), (-1.0, "0.0,52.0")])
def test_a_driver_pushes_along_its_axis(rate, end):
    sign = of_driver(joint="S", polynomial=(0.0, rate))
    assert sign.attrib["transform"] == "translate(400.0,400.0)"
    assert sign[1].attrib["points"].split()[0] == end, "the tip of an arrow of 52 px"


def test_an_axis_that_is_seen_from_the_side_has_two_heads():
    """The axis z points upwards in the view xz: arrows of 0.8 · 52 px, and of 52 px from 0.6 · 52 px."""
    shaft, head, second_shaft, second_head = of_driver("xz", polynomial=(0.0, 1.0))
    assert head.attrib["points"].split()[0] == "0.0,-41.6"
    assert second_head.attrib["points"].split()[0] == "0.0,-52.0"
    assert shaft.attrib["d"].startswith("M0.0 0.0L") and second_shaft.attrib["d"].startswith("M0.0 -31.2L")


@pytest.mark.parametrize(("cosine", "is_turn"), [(0.69, False), (0.71, True), (-0.69, False), (-0.71, True)])
def test_an_axis_that_nearly_faces_the_reader_is_a_turn(cosine, is_turn):
    axis = np.array([math.sqrt(1 - cosine**2), 0.0, cosine])
    arc = drawn(marks._turning(stage(), axis, 15.0))
    assert (len(arc) == 2) is is_turn
    if is_turn:
        assert arc[0].attrib["d"] == ROUND[math.copysign(1.0, cosine)]


# --- loads ------------------------------------------------------------------------------------------------
def of_load(load: Any) -> ElementTree.Element:
    [sign] = drawn(marks.load_mark(stage(joint=(SHAFT, SLIDE, SECOND), load=(load,)), load))
    return sign


def test_an_arrow_of_a_force():
    sign = of_load(Force(body="b", point=(3.0, 2.5, 0.0), force=(0.0, 30.0, 40.0)))
    assert sign.attrib["transform"] == "translate(300.0,250.0)"
    assert sign[1].attrib["points"].split()[0] == "0.0,-31.2", "0.6 of 52 px is seen"
    assert sign[1].attrib["fill"] == ACTION


@pytest.mark.parametrize("size", [5.0, -5.0])
def test_a_moment_turns_about_the_centre_of_its_body(size):
    sign = of_load(Moment(body="c", moment=(0.0, 0.0, size)))
    assert sign.attrib["transform"] == "translate(400.0,400.0)"
    assert sign[0].attrib["d"] == ROUND[math.copysign(1.0, size)].replace("15", "20")


def test_a_zero_moment_is_a_turn():
    assert len(list(of_load(Moment(body="c", moment=(0.0, 0.0, 0.0))))) == 2


def test_the_zigzag_of_a_spring():
    """Twelve points from 15 to 85 % of the length, of which the inner ten are 7 px aside in turn."""
    spring = Spring(
        bodies=("ground", "b"), points=((2.0, 0.0, 0.0), PLACE), stiffness=1.0, natural_length=1.0
    )
    flat = Spring(bodies=("c", "b"), points=((2.0, 2.0, 0.0), PLACE), stiffness=1.0, natural_length=1.0)
    assert points(of_load(spring))[[0, -1]].tolist() == [[200.0, 500.0], [100.0, 300.0]]
    path = points(of_load(flat))
    assert len(path) == 14 and path[[0, -1]].tolist() == [[200.0, 300.0], [100.0, 300.0]]
    assert path[1:-1, 0] == pytest.approx(200.0 - np.linspace(15.0, 85.0, 12), abs=0.06)
    assert path[1:-1, 1].tolist() == [300.0, *[293.0, 307.0] * 5, 300.0]


def test_a_zigzag_without_length():
    point = np.zeros((1, 2))
    assert np.isfinite(marks._zigzag(point, point)).all()
    tall = marks._zigzag(point, np.array([[0.0, -1e-9]]))[0]
    assert tall[2:4, 0] == pytest.approx([7.0, -7.0]), "a direction counts from 1e-9 px on"


@pytest.mark.parametrize("size", [5.0, -5.0])
def test_torques_and_forces_of_joints(size):
    turn = of_load(JointTorque(joint="A", torque=size))
    assert turn.attrib["transform"] == "translate(100.0,300.0)"
    assert turn[0].attrib["d"] == ROUND[math.copysign(1.0, size)]
    push = of_load(JointForce(joint="S", force=size))
    assert push.attrib["transform"] == "translate(400.0,400.0)"
    assert push[1].attrib["points"].split()[0] == ("0.0,-52.0" if size > 0 else "0.0,52.0")


def test_springs_of_joints():
    spiral = of_load(TorsionSpring(joint="A", stiffness=1.0))
    assert spiral.attrib["transform"] == "translate(100.0,300.0)" and spiral[0].attrib["stroke"] == ACTION
    zigzag = of_load(SlideSpring(joint="S", stiffness=1.0))
    path = points(zigzag[0])
    assert zigzag.attrib["transform"] == "translate(400.0,400.0)" and len(path) == 10
    assert path[[0, -1]].tolist() == [[0.0, 0.0], [0.0, -52.0]] and zigzag[0].attrib["stroke"] == ACTION
    assert path[2:-2, 0].tolist() == [7.0, -7.0] * 3
