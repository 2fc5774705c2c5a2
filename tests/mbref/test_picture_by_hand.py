"""Whole pictures / panels, titles, axes, scale bars, lines of time and bodies worked out by hand.

A rod from (0, 0, 0) to (2, 0, 0) and a body from there to (2, 1, 0) on a page of 240 px with margins of
20 px: 100 px a metre, (x, y, z) at (20 + 100 x, 120 - 100 y), 140 px high.
"""

from __future__ import annotations

import math
import re
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from mbref.drawing import picture
from mbref.drawing.picture import Form, Layer, Look, Panel
from mbref.drawing.shapes import Shape, attack, shapes
from mbref.drawing.svg import COLOURS, GREY
from mbref.drawing.timeline import Timeline
from mbref.drawing.view import View
from mbref.scene import Body, Distance, Force, Moment, Revolute, Scene, Spherical, Spring
from mbref.trajectory import Outcome, Trajectory

Z = (0.0, 0.0, 1.0)
HINGE = Revolute(name="A", bodies=("ground", "rod"), anchor=(0.0, 0.0, 0.0), axis=Z)
BALL = Spherical(name="B", bodies=("rod", "c"), anchor=(2.0, 0.0, 0.0))
BODIES = tuple(
    Body(name=name, mass=1.0, inertia=(1.0, 1.0, 1.0), position=place)
    for name, place in (("rod", (1.0, 0.0, 0.0)), ("c", (2.0, 1.0, 0.0)))
)
SCENE = Scene(name="s", body=BODIES, joint=(HINGE, BALL))
FORM = Form(width=240.0, margin=20.0, tallest=300.0)
XY = View.parse("xy")
SVG = "{http://www.w3.org/2000/svg}"


def motion(*shifts: tuple[float, float], times: tuple[float, ...] = ()) -> Trajectory:
    """The rod at rest; body c is shifted by (x, y) at each sample."""
    k = len(shifts)
    place = np.tile([[1.0, 0.0, 0.0], [2.0, 1.0, 0.0]], (k, 1, 1))
    place[:, 1, :2] += np.array(shifts).reshape(k, 2)
    zero, turn = np.zeros((k, 2, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (k, 2, 1))
    given = np.array(times or np.arange(k), dtype=float)
    return Trajectory("s", "e", "1", "m", {}, given, ("rod", "c"), place, turn, zero, zero)


STILL = motion((0.0, 0.0))


def root(svg: str) -> ElementTree.Element:
    return ElementTree.fromstring(svg)


def made(*panels: Panel, form: Form = FORM, timeline: Timeline | None = None, **more: Any) -> Any:
    given = panels or (Panel([Layer(STILL)]),)
    return root(picture.picture(SCENE, given, "words", timeline, XY, form, **more))


def texts(element: ElementTree.Element) -> dict[str, tuple[float, float]]:
    return {
        text.text or "": (float(text.attrib["x"]), float(text.attrib["y"]))
        for text in element.iter(f"{SVG}text")
    }


def boxes(element: ElementTree.Element) -> list[tuple[str, ...]]:
    """Place and size of each panel."""
    return [
        tuple(box.attrib[n] for n in ("x", "y", "width", "height"))
        for box in element.iter(f"{SVG}svg")
        if box is not element
    ]


def lines(element: ElementTree.Element) -> list[list[list[float]]]:
    return [
        [[float(x) for x in pair.split(",")] for pair in line.attrib["points"].split()]
        for line in element.iter(f"{SVG}polyline")
    ]


# --- the page ---------------------------------------------------------------------------------------------
def test_a_panel_without_a_title():
    whole = made()
    assert whole.attrib["viewBox"] == "0 0 240 170" and whole.find(f"{SVG}title").text == "words"
    assert boxes(whole) == [("0", "0.0", "240", "140.0")]
    assert lines(whole) == [[[20.0, 120.0], [220.0, 120.0]], [[220.0, 120.0], [220.0, 20.0]]]
    first, *_ = whole.find(f"{SVG}svg")
    assert first.attrib["d"].startswith("M20.0 120.0l-10 16"), "the ground is below the bodies"


def test_axes_and_scale():
    """Arrows of 30 px from (30, 144), letters 10 px farther; 1 m of at most 1.1 m, 40 px from the edge."""
    whole = made()
    assert texts(whole) == {"x": (70.0, 148.0), "y": (30.0, 108.0), "1 m": (150.0, 143.0)}
    paths = [path.attrib["d"] for path in whole.findall(f"{SVG}path")]
    assert paths == ["M30.0 144.0L51.0 144.0", "M30.0 144.0L30.0 123.0", "M100.0 146.0v8m0 -4h100.0m0 -4v8"]


@pytest.mark.parametrize(("elevation", "is_seen"), [(79, False), (78, True)])
def test_an_axis_along_the_line_of_sight(elevation, is_seen):
    """cos 79° = 0.191 and cos 78° = 0.208: 20 % of an axis must be seen."""
    view = View.parse(f"-90,{elevation}")
    found = texts(root(picture.picture(SCENE, [Panel([Layer(STILL)])], "w", None, view, FORM)))
    assert ("z" in found) is is_seen and {"x", "y"} <= set(found)


def test_three_panels_with_titles_in_two_columns():
    """Two lines of 1.5 · 20 px and 6 px above each panel of 140 px."""
    form = FORM._replace(letters=20, columns=2)
    panels = [Panel([Layer(STILL)], title) for title in (["one", "more"], ["two"], ["three"])]
    whole = made(*panels, form=form)
    assert whole.attrib["viewBox"] == "0 0 480 442"
    assert [box[:2] for box in boxes(whole)] == [("0", "66.0"), ("240", "66.0"), ("0", "272.0")]
    assert {n: p for n, p in texts(whole).items() if len(n) > 1} == {
        "one": (120.0, 30.0),
        "more": (120.0, 60.0),
        "two": (360.0, 30.0),
        "three": (120.0, 236.0),
        "1 m": (390.0, 415.0),
    }


def test_paths_are_grey_lines_below_the_bodies():
    path = np.array([[0.0, 0.5, 0.0], [1.0, 1.0, 0.0]])
    first, *others = lines(made(Panel([Layer(STILL)], paths=[path])))
    assert first == [[20.0, 70.0], [120.0, 20.0]] and len(others) == 2


def test_layers_lie_on_top_of_each_other():
    """The second motion is 0.5 m lower: the page shows both, with 100 px a metre."""
    low = motion((0.0, -1.5))
    found = lines(made(Panel([Layer(STILL, more=()), Layer(low, more=())])))
    assert [line[-1][1] for line in found] == [120.0, 20.0, 120.0, 170.0]


def test_all_panels_show_the_motions_that_are_asked():
    high = motion((0.0, 1.0), (0.0, 0.0))
    assert boxes(made(shown=[high])) == [("0", "0.0", "240", "240.0")]
    assert boxes(made(shown=[])) == [("0", "0.0", "240", "140.0")]


def page(*bodies: Body, **parts: Any) -> Any:
    scene = Scene(name="s", body=bodies or BODIES, **parts)
    zero = np.zeros((1, len(scene.body), 3))
    place = np.array([[b.position for b in scene.body]])
    turn = np.tile([1.0, 0.0, 0.0, 0.0], (1, len(scene.body), 1))
    run = Trajectory("s", "e", "1", "m", {}, np.zeros(1), (), place, turn, zero, zero)
    return picture._page(scene, run, None, FORM)


def test_ends_on_the_ground_are_on_the_page():
    """A rod to (0, 2, 0), and a spring to (0, -1, 0): heights of 2 m and 3 m at 100 px a metre."""
    rod = Distance(name="D", bodies=("ground", "c"), anchors=((0.0, 2.0, 0.0), (2.0, 1.0, 0.0)))
    spring = Spring(
        bodies=("c", "ground"), points=((2.0, 1.0, 0.0), (0.0, -1.0, 0.0)), stiffness=1.0, natural_length=1.0
    )
    assert page(joint=(HINGE, BALL)).height == pytest.approx(140.0)
    assert page(joint=(HINGE, BALL, rod)).height == pytest.approx(240.0)
    wide = page(joint=(HINGE, BALL, rod), load=(spring,))
    assert wide.scale == pytest.approx(260 / 3) and wide.height == pytest.approx(300.0)


def test_a_page_is_seen_along_the_axes_of_revolute_joints():
    assert page(joint=(HINGE, BALL)).view == XY
    oblique = HINGE.model_copy(update={"axis": (0.0, 1.0, 0.0)})
    assert page(joint=(oblique, BALL)).view != XY


# --- moving pictures --------------------------------------------------------------------------------------
def test_a_moving_picture_has_a_still_one_at_the_farthest_sample():
    """The second motion is farthest from the first at its second sample."""
    other = motion((0.0, 0.0), (-0.6, 0.0), (0.5, 0.0))
    base = motion((0.0, 0.0), (0.0, 0.0), (0.0, 0.0))
    line = Timeline(np.array([0.0, 1.0, 2.0]), np.arange(3), 4.0)
    whole = made(Panel([Layer(base, more=()), Layer(other, more=())]), timeline=line)
    moving, still = (group for group in whole.findall(f"{SVG}g"))
    assert len(list(moving.iter(f"{SVG}animate"))) == 1 and not list(still.iter(f"{SVG}animate"))
    [animate] = moving.iter(f"{SVG}animate")
    ends = [frame.split()[-1] for frame in animate.attrib["values"].split(";")]
    scale = 200 / 2.5
    assert ends == [f"{20 + scale * x:.1f},20.0" for x in (2.0, 1.4, 2.5)]
    assert lines(still)[-1][-1] == [20 + scale * 1.4, 20.0]
    assert texts(whole)["2 s in 4 s"] == (120.0, 20 + scale + 20 + 30 - 16)


def test_the_line_of_time():
    """Marks at a quarter and at half of 4 s; the label is 3 letters of 12 px wide."""
    line = Timeline(np.array([1.0, 3.0, 5.0]), np.arange(3), 4.0, (2.0, 3.0), "hit")
    whole = made(Panel([Layer(motion((0, 0), (0, 0), (0, 0)), more=())]), timeline=line)
    assert whole.attrib["viewBox"] == "0 0 240 212"
    left, right, y = 40 + 0.56 * 12 * 3, 180.0, 184.0
    paths = [path.attrib["d"] for path in whole.iter(f"{SVG}path")]
    ticks = "".join(f"M{left + share * (right - left):.1f} 177.0v14" for share in (0.25, 0.5))
    assert paths.count(f"M{left:.1f} 184.0H180.0{ticks}") == 2
    found = texts(whole)
    assert found["hit"] == (14.0, y + 4) and found["1 s"] == (round(left, 1), y + 20)
    assert found["5 s"] == (right, y + 20) and found["4 s in 4 s"] == (120.0, 154.0)
    moving, still = whole.findall(f"{SVG}g")
    dots = [group[-1] for group in (moving, still)]
    assert dots[1].attrib["transform"] == f"translate({left:.1f},184.0)" and len(dots[1]) == 1
    assert dots[0][0].attrib == {"r": "5", "fill": COLOURS[1]}
    values = dots[0][1].attrib["values"].split(";")
    assert values == [f"{left + s * (right - left):.1f},184.0" for s in (0.0, 0.5, 1.0)]


def test_times_without_marks_have_no_line():
    line = Timeline(np.array([1.0, 3.0]), np.arange(2), 4.0)
    whole = made(Panel([Layer(motion((0, 0), (0, 0)), more=())]), timeline=line)
    assert whole.attrib["viewBox"] == "0 0 240 170" and not list(whole.iter(f"{SVG}circle"))


def test_a_motion_that_ends_early_stays_at_its_last_sample():
    found = picture._at(motion((0, 0), (1, 0), (2, 0)), np.array([0, 2, 4]))
    assert found.position[:, 1, 0].tolist() == [2.0, 4.0, 4.0] and found.times.tolist() == [0.0, 2.0, 2.0]
    assert (found.scene, found.engine, found.version, found.bodies) == ("s", "e", "1", ("rod", "c"))
    assert found.velocity.shape == (3, 2, 3) and found.orientation.shape == (3, 2, 4)


def test_the_farthest_sample_is_of_any_body_and_any_motion():
    base = motion((0, 0), (0, 0), (0, 0))
    first, second = motion((0, 0), (1, 0), (0, 0)), motion((0, 0), (0, 0), (0, 1.1))
    assert picture._furthest([base, first, second]) == 2 and picture._furthest([base, first]) == 1
    assert picture._furthest([first, base]) == 1 and picture._furthest([first]) == 0


def test_the_longest_motion_gives_the_times():
    short, long = motion((0, 0), times=(9.0,)), motion((0, 0), (0, 0))
    assert picture.longest([short, long, short]).tolist() == [0.0, 1.0]


def test_pictures_have_titles_and_refuse_motions_without_samples():
    words = "s: 2 bodies, 2 joints"
    run = motion((0, 0), (0.5, 0))
    for svg in (picture.still(SCENE, XY, 240.0), picture.moving(SCENE, run, XY, 240.0)):
        assert root(svg).find(f"{SVG}title").text == words
        assert {"A", "B", "rod", "c"} <= set(texts(root(svg)))
        assert root(svg).attrib["viewBox"].startswith("0 0 240 ")
    empty = motion()
    empty = Trajectory(**{**vars(empty), "outcome": Outcome.CRASHED})
    for make in (picture.moving, lambda *given: list(picture.frames(*given))):
        with pytest.raises(
            ValueError, match="motion of 's' has no sample to draw: the process ended without"
        ):
            make(SCENE, empty)
    with pytest.raises(ValueError, match="no sample"):
        picture.side_by_side(SCENE, {"a": run, "b": empty}, "w")


def test_pictures_of_a_film_show_one_part_of_space():
    pictures = [root(svg) for svg in picture.frames(SCENE, motion((0, 0), (-1.0, 0), (0, 0.5)), XY)]
    assert len(pictures) == 3 and len({svg.attrib["viewBox"] for svg in pictures}) == 1
    scale = (520 - 128) / 1.5  # of all samples, which are 1.5 m high
    tops = np.array([lines(svg)[1][-1] for svg in pictures])
    assert tops[:, 0] == pytest.approx(360 + scale * np.array([1.0, 0.0, 1.0]), abs=0.06)
    assert tops[:, 1] == pytest.approx(64 + scale * np.array([0.5, 0.5, 0.0]), abs=0.06)


def test_motions_side_by_side_are_as_long_as_the_longest():
    short, long = motion((0, 0), (0.2, 0)), motion((0, 0), (0.1, 0), (0.3, 0))
    whole = root(picture.side_by_side(SCENE, {"one": short, "two": long}, "w", XY))
    assert [box[:3] for box in boxes(whole)][:2] == [("0", "36.0", "360"), ("360", "36.0", "360")]
    assert {"one", "two", "2 s in 4 s"} <= set(texts(whole)) and "rod" not in texts(whole)


# --- bodies -----------------------------------------------------------------------------------------------
def drawn(shape: Shape, look: Look, count: int = 1) -> list[ElementTree.Element]:
    stage = SimpleNamespace(timeline=None)
    frames = np.tile(np.array([[10.0 * k, 20.0] for k in range(len(shape.points))]), (1, 1, 1))
    text = picture._body(shape, frames, look.colour, look.thickness, "", stage)
    return list(ElementTree.fromstring(f"<svg>{text}</svg>"))


TRIANGLE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]])


def test_a_plate_a_bar_and_a_block():
    """A plate's edge has two thirds of the thickness of a bar, a block's edge has half of it."""
    [plate] = drawn(Shape("p", TRIANGLE), Look("red", 6.0))
    assert plate.tag == "polygon" and plate.attrib["points"] == "0.0,20.0 10.0,20.0 20.0,20.0"
    assert plate.attrib["stroke-width"] == "4" and plate.attrib["fill"] == plate.attrib["stroke"] == "red"
    [bar] = drawn(Shape("b", TRIANGLE[:2]), Look("red", 6.0))
    assert (bar.tag, bar.attrib["stroke-width"], bar.attrib["fill"]) == ("polyline", "6", "none")
    [block] = drawn(Shape("c", TRIANGLE[:1]), Look("red", 6.0))
    assert block.attrib["transform"] == "translate(0.0,20.0)" and block[0].attrib["stroke-width"] == "3"
    assert [block[0].attrib[n] for n in ("x", "y", "width", "height")] == ["-17", "-12", "34", "24"]


@pytest.mark.parametrize(
    ("look", "colours", "opacity"),
    [
        (Look(), list(COLOURS[:2]), None),
        (Look("red"), ["red", "red"], None),
        (Look(opacity=0.45678), list(COLOURS[:2]), "0.457"),
        (Look(opacity=1.0, thickness=2.0), list(COLOURS[:2]), None),
    ],
)
def test_the_look_of_a_layer(look, colours, opacity):
    found = [*made(Panel([Layer(STILL, look, more=())])).iter(f"{SVG}polyline")]
    assert [line.attrib["stroke"] for line in found] == colours
    assert {line.attrib.get("opacity") for line in found} == {opacity}
    assert {line.attrib["stroke-width"] for line in found} == {f"{look.thickness:g}"}


def test_colours_begin_again_after_the_last():
    many = [
        Body(name=f"b{k}", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(float(k), 0.0, 0.0)) for k in range(8)
    ]
    scene = Scene(name="s", body=tuple(many))
    svg = picture.picture(scene, [Panel([Layer(picture.at_rest(scene), more=())])], "w", view=XY, form=FORM)
    strokes = re.findall(r'<rect x="-17"[^>]* stroke="(#\w+)"', svg)
    assert strokes == [*COLOURS, COLOURS[0]]


def test_symbols_are_drawn_in_order():
    """Couplings, loads, joints, and drivers."""
    moment = Moment(body="c", moment=Z)
    scene = SCENE.with_(load=(moment, moment))
    stage = picture.Stage(scene, STILL, page(joint=(HINGE, BALL)), None)
    kinds = [re.search(r"<(path|circle)", part)[1] for part in picture.signs(stage)]
    assert kinds == ["path", "path", "circle", "circle"]


# --- shapes -----------------------------------------------------------------------------------------------
def test_points_of_shapes():
    """Springs and forces act on bodies at points that their outlines reach."""
    spring = Spring(
        bodies=("c", "rod"), points=((3.0, 1.0, 0.0), (1.0, 1.0, 0.0)), stiffness=1.0, natural_length=1.0
    )
    force = Force(body="c", point=(2.0, 3.0, 0.0), force=Z)
    rod, c = shapes(SCENE.with_(load=(spring, force, Moment(body="rod", moment=Z))))
    assert rod.is_plate and {tuple(p) for p in rod.points} == {(-1, 0, 0), (1, 0, 0), (0, 1, 0)}
    assert c.is_plate and {tuple(p) for p in c.points} == {(0, -1, 0), (1, 0, 0), (0, 2, 0)}
    assert attack(Moment(body="rod", moment=Z)) == [] and attack(force) == [("c", (2.0, 3.0, 0.0))]
    assert attack(spring) == [("c", (3.0, 1.0, 0.0)), ("rod", (1.0, 1.0, 0.0))]


def test_points_are_in_the_frame_of_a_turned_body():
    half = math.sqrt(0.5)
    turned = BODIES[0].model_copy(update={"orientation": (half, 0.0, 0.0, half)})
    rod, _ = shapes(SCENE.with_(body=(turned, BODIES[1])))
    assert sorted(map(tuple, rod.points.tolist())) == [(0.0, -1.0, 0.0), (0.0, 1.0, 0.0)]


@pytest.mark.parametrize(("off", "is_plate"), [(1e-7, False), (1e-5, True)])
def test_points_on_a_line_are_a_bar(off, is_plate):
    joints = [
        Spherical(name=f"J{k}", bodies=("ground", "rod"), anchor=(float(k), off * (k == 1), 0.0))
        for k in range(3)
    ]
    rod, _ = shapes(SCENE.with_(joint=tuple(joints)))
    assert rod.is_plate is is_plate
    if not is_plate:
        assert np.abs(np.diff(rod.points[:, 0])) == pytest.approx([1.0, 1.0]), "in order along the line"


def test_a_body_without_joints_is_a_block():
    rod, c = shapes(SCENE.with_(joint=(HINGE,)))
    assert c.points.tolist() == [[0.0, 0.0, 0.0]] and len(rod.points) == 2
    centred = HINGE.model_copy(update={"anchor": (1.0, 0.0, 0.0)})
    assert len(shapes(SCENE.with_(joint=(centred,)))[0].points) == 1, "a joint at the centre of mass"


def test_a_line_with_two_equal_points_is_no_plate():
    assert not Shape("s", TRIANGLE[[0, 1, 0]]).is_plate and Shape("s", TRIANGLE).is_plate
    assert not Shape("s", TRIANGLE[[0, 1, 2, 1]]).is_plate


def test_grey_is_the_colour_of_axes():
    assert made().findall(f"{SVG}path")[0].attrib["stroke"] == GREY
