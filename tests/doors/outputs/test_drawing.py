"""Pictures: names, bars and signs at their places; views; animations that follow the poses of a motion."""

import dataclasses
import itertools
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from mbref import rotations
from mbref.motions.drawing.film import png
from mbref.motions.drawing.marks import SIGNS
from mbref.motions.drawing.picture import moving, side_by_side, still
from mbref.motions.drawing.shapes import at_rest, shapes
from mbref.motions.drawing.timeline import Timeline
from mbref.motions.drawing.view import Page, View, view_of
from mbref.scene import JOINT_TYPES, LOAD_TYPES, Scene
from mbref.scenes import SCENES
from tests.helpers.parts import X, Y, Z, spring

LETTER, LINE_HEIGHT = 7.4, 15.0  # px, of a mean letter and a line of sans-serif text of 13 px
CLEAR = 3.5  # px, least distance between a bar's middle line, 6 px wide, and the box of a name
SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture
def turning():
    """A four-bar and a motion that turns its pose at t = 0 as one rigid body by 1 rad in 300 samples."""
    scene = SCENES["four_bar"]()
    start, turn = at_rest(scene), np.linspace(0.0, 1.0, 300)
    c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
    x, y = start.position[0, :, 0], start.position[0, :, 1]
    position = np.stack([c * x - s * y, s * x + c * y, 0 * s * x], axis=2)
    half = np.stack([np.cos(turn / 2), 0 * turn, 0 * turn, np.sin(turn / 2)], axis=1)
    orientation = rotations.multiply(half[:, None], start.orientation)
    zeros = np.zeros_like(position)
    return scene, dataclasses.replace(
        start, times=turn, position=position, orientation=orientation, velocity=zeros, angular_velocity=zeros
    )


def texts(picture: str) -> list[str]:
    return [node.text or "" for node in ET.fromstring(picture).iter(f"{SVG}text")]


@pytest.mark.parametrize("name", SCENES)
def test_picture_of_a_scene_names_every_body_and_joint(name):
    """The texts of the SVG, split at commas, are the names of the scene."""
    scene = SCENES[name]()
    words = {word for text in texts(still(scene)) for word in text.split(", ")}
    assert {body.name for body in scene.body} | {joint.name for joint in scene.joint} <= words


def labels(picture: str) -> dict[str, np.ndarray]:
    """Return the middles (k, 2), px, of the names of joints and bodies in each frame."""
    found = {}
    for group in ET.fromstring(picture).iter(f"{SVG}g"):
        text, motion = group.find(f"{SVG}text"), group.find(f"{SVG}animateTransform")
        if text is not None:
            start = group.attrib["transform"].removeprefix("translate(").rstrip(")")
            frames = start if motion is None else motion.attrib["values"]
            found.setdefault(text.text, np.array([f.split(",") for f in frames.split(";")], dtype=float))
    return found


def overlapping(found: dict[str, np.ndarray]) -> list[tuple[str, str]]:
    """Return pairs of names of which one covers a part of the other in some frame."""
    pairs = []
    for (first, a), (second, b) in itertools.combinations(found.items(), 2):
        reach = np.array([LETTER * (len(first) + len(second)), 2 * LINE_HEIGHT]) / 2
        if (np.abs(a - b) < reach).all(axis=1).any():
            pairs.append((first, second))
    return pairs


@pytest.mark.parametrize("name", SCENES)
def test_names_in_a_picture_do_not_overlap(name):
    """Boxes of the texts, of LETTER px a letter and one LINE_HEIGHT, are apart."""
    found = labels(still(SCENES[name]()))
    assert len(found) > 1 and not overlapping(found)


def lines_of(root: ET.Element) -> list[ET.Element]:
    """Return the lines of bars in a part of a picture: they are 6 px wide."""
    return [node for node in root.iter(f"{SVG}polyline") if node.get("stroke-width") == "6"]


def bars(picture: str) -> list[np.ndarray]:
    """Return the ends (2, 2), px, of the parts of bars."""
    lines = lines_of(ET.fromstring(picture))
    points = [np.array([p.split(",") for p in line.attrib["points"].split()], dtype=float) for line in lines]
    return [line[i : i + 2] for line in points for i in range(len(line) - 1)]


def crossed(middle: np.ndarray, half: np.ndarray, bar: np.ndarray) -> bool:
    """Return whether a bar runs through a box with a middle and half its sizes (px)."""
    along = bar[0] + np.linspace(0.0, 1.0, 500)[:, None] * (bar[1] - bar[0])
    return bool((np.abs(along - middle) < half).all(axis=1).any())


@pytest.mark.parametrize("name", SCENES)
def test_names_of_bodies_stay_clear_of_bars(name):
    """No bar's middle line comes nearer to the box of a body's name than CLEAR px."""
    picture, scene = still(SCENES[name]()), SCENES[name]()
    half = {body.name: np.array([LETTER * len(body.name), LINE_HEIGHT]) / 2 + CLEAR for body in scene.body}
    found = {word: place[0] for word, place in labels(picture).items() if word in half}
    assert found.keys() == half.keys()
    assert not [word for word, at in found.items() for bar in bars(picture) if crossed(at, half[word], bar)]


def test_names_in_an_animation_do_not_overlap_in_any_frame(turning):
    """The four-bar turns by 1 rad; boxes of names are as in the test of still pictures."""
    found = labels(moving(*turning))
    assert len(found) == len(turning[0].body) + len(turning[0].joint) and not overlapping(found)


@pytest.mark.parametrize(("gap", "names"), [(0.001, 3), (0.02, 4), (0.05, 4)], ids=["1 mm", "2 cm", "5 cm"])
def test_names_of_joints_near_each_other_do_not_overlap(gap, names):
    """A bar of 1 m has three pins, two of them near each other: 1 mm apart, less than a pixel, they share one
    name; farther apart, though their signs touch, all three and the bar have names of their own."""
    ball = {"type": "spherical", "bodies": ("ground", "bar")}
    joints = [{"name": f"pin{x:g}", "anchor": (x, 0, 0), **ball} for x in (0.0, gap, 1.0)]
    found = labels(still(Scene(name="near", body=[{"name": "bar", "position": (0.5, 0, 0)}], joint=joints)))
    assert not overlapping(found) and len(found) == names, found


def test_joints_at_one_place_share_one_label():
    """The slider's pin C and guide D are at one place; the other joints have labels of their own."""
    scene = SCENES["planar_slider_crank"]()
    assert {"A", "B", "C, D"} <= set(texts(still(scene)))


def test_bars_of_an_animation_keep_their_length_in_every_frame(turning):
    """The mechanism turns as one rigid body: lengths in px change by less than three times the 0.1 px to
    which coordinates are printed, while ends move by more than 50 px."""
    rounding, (scene, motion) = 0.1, turning
    lines = lines_of(ET.fromstring(moving(scene, motion)).find(f"{SVG}g"))
    assert len(lines) == len(scene.body)
    for line in lines:
        values = line.find(f"{SVG}animate").attrib["values"].split(";")
        frames = np.array([[p.split(",") for p in frame.split()] for frame in values], dtype=float)
        length = np.linalg.norm(frames[:, 1] - frames[:, 0], axis=1)
        assert np.ptp(length) < 3 * rounding and np.ptp(frames[:, 1, 0]) > 50


def test_animation_of_300_samples_shows_every_third_one():
    """At most 120 samples are shown, evenly chosen."""
    timeline = Timeline.of(np.linspace(0.0, 1.0, 300))
    assert timeline.samples.tolist() == list(range(0, 300, 3))


@pytest.mark.parametrize(("end", "seconds"), [(1.0, 4.0), (7.0, 7.0), (60.0, 12.0)])
def test_animation_plays_in_real_time_between_four_and_twelve_seconds(end, seconds):
    """A motion of 7 s plays for 7 s; one of 1 s is slowed to 4 s, and one of 60 s sped up to 12 s."""
    timeline = Timeline.of(np.array([0.0, end]))
    assert f'dur="{seconds:g}s"' in timeline.animate("x", ["0", "1"])


def test_samples_at_unequal_intervals_are_shown_at_their_times():
    """Times 1, 1.5 and 3 s are at 0, 1/4 and all of the time shown."""
    element = Timeline.of(np.array([1.0, 1.5, 3.0])).animate("x", ["0", "1", "2"])
    assert 'keyTimes="0;0.25;1"' in element and 'values="0;1;2"' in element


def test_animation_is_replaced_by_a_still_for_readers_who_prefer_reduced_motion(turning):
    """The style of the CSS media query prefers-reduced-motion hides the first group, which moves; the second
    group stands still. A still picture has no style."""
    moves, stands = ET.fromstring(moving(*turning)).findall(f"{SVG}g")[:2]
    assert (moves.get("class"), stands.get("class")) == ("mbref-moving", "mbref-still")
    assert list(moves.iter(f"{SVG}animate")) and not list(stands.iter(f"{SVG}animate"))
    assert ".mbref-moving{display:none}" in moving(*turning) and "<style>" not in still(turning[0])


def test_motions_side_by_side_share_scale_and_time_and_a_shorter_one_stops(turning):
    """Three motions, of 300, the first 100 and all 300 samples, are two in a row; every third is a frame."""
    scene, motion = turning
    first = {name: getattr(motion, name)[:100] for name in ("times", "position", "orientation")}
    short = dataclasses.replace(motion, **first)
    picture = side_by_side(scene, {"whole": motion, "<part>": short, "again": motion}, "three")
    root = ET.fromstring(picture)
    assert {"whole", "<part>", "again"} <= set(texts(picture)) and root.find(f"{SVG}title").text == "three"
    panels = list(root.find(f"{SVG}g").findall(f"{SVG}svg"))
    moved = ([line.find(f"{SVG}animate") for line in lines_of(panel)] for panel in panels)
    frames = [[each.attrib["values"].split(";") for each in panel] for panel in moved]
    assert frames[0] == frames[2] and len(frames[0]) == len(scene.body)
    for whole, part in zip(frames[0], frames[1], strict=True):
        assert part[:33] == whole[:33] and set(part[34:]) == {part[-1]}, "it stays at its last sample"
    heights = [panel.get("y") for panel in panels]
    assert heights[0] == heights[1] != heights[2], "two in a row"


def test_only_a_link_with_three_joints_is_drawn_as_a_plate():
    """K3 of Andrews' squeezer has three; the top has one joint, and is a line to its centre."""
    plates = [shape.name for shape in shapes(SCENES["andrews_squeezer"]()) if shape.is_plate]
    assert plates == ["K3"]
    (top,) = shapes(SCENES["heavy_top"]())
    assert len(top.points) == 2 and not top.is_plate


@pytest.mark.parametrize(
    ("name", "right", "up"), [("xy", "x", "y"), ("xz", "x", "z"), ("yz", "y", "z"), ("-90,90", "x", "y")]
)
def test_named_view_has_its_two_world_axes_to_the_right_and_up(name, right, up):
    """The rows of ``axes`` are the directions to the right, up and to the viewer, a right-handed frame."""
    axes = View.parse(name).axes
    assert np.allclose(axes[0], np.eye(3)["xyz".index(right)], rtol=0, atol=1e-15)
    assert np.allclose(axes[1], np.eye(3)["xyz".index(up)], rtol=0, atol=1e-15)
    assert np.allclose(axes @ axes.T, np.eye(3), rtol=0, atol=1e-15) and np.linalg.det(axes) > 0


@pytest.mark.parametrize("text", ["front", "10", "0,91", "nan,0", "a,b"])
def test_unknown_view_is_refused(text):
    """A view is a known name, or two angles of which the second is from -90 to 90 degrees."""
    with pytest.raises(ValueError, match="view: "):
        View.parse(text)


def test_planar_mechanism_is_viewed_along_its_normal_and_a_spatial_one_obliquely():
    """Three points in the plane y = 0 are planar with a hinge across it, and spatial with a hinge along it;
    three points in an oblique plane are viewed obliquely, too."""
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 1.0]])
    assert view_of(points, [(0.0, 2.0, 0.0)]) == View.parse("xz")
    assert view_of(points, [(0.0, 0.0, 1.0)]) == View.parse("oblique")
    assert view_of(points + np.diag([0.0, 0.5, 0.0]), []) == View.parse("oblique")


def test_page_shows_all_points_within_its_margins():
    """Random points in space lie on a page of at most 600 by 400 px within margins of 40 px, to rounding."""
    points = np.random.default_rng(1).normal(size=(30, 3)) * np.array([5.0, 1.0, 0.1])
    page = Page.around(points, View.parse("oblique"), 600.0, 40.0, 400.0)
    margin, seen = 40 - 1e-9, page.pixels(points)  # px
    assert (seen >= margin).all() and (seen <= np.array([page.width, page.height]) - margin).all()


def test_every_joint_type_is_drawn_by_a_sign_of_its_own():
    """Pictures of two bodies with a joint of each type between them differ from each other."""
    assert set(SIGNS) == set(JOINT_TYPES)
    ends = {"anchor": X, "anchors": [X, [2.0, 0, 0]], "axis": Z, "axes": [Z, Y]}
    ends |= {"normal": Y, "along": X, "radius": 0.3}
    bodies = [{"name": n, "position": [x, 0.2, 0.1]} for n, x in (("a", 0.5), ("b", 1.5))]
    pictures = set()
    for joint in JOINT_TYPES.values():
        made = joint.at("J", ("a", "b"), **ends)
        pictures.add(still(Scene(name="pair", body=bodies, joint=(made,)), View.parse("oblique")))
    assert len(pictures) == len(JOINT_TYPES), "two joint types look the same"


def test_every_load_and_driver_has_a_picture_of_its_own():
    """Pictures of one mechanism differ with the kind and sense of its load or driver, and without any."""
    scene = SCENES["planar_slider_crank"]().with_(load=())
    loads = [
        {"type": "force", "body": "rod", "point": [0.5, 0, 0], "force": [0, 1, 0]},
        *({"type": "moment", "body": "crank", "moment": [0, 0, sense]} for sense in (-1, 1)),
        *({"type": "joint_torque", "joint": "A", "torque": sense} for sense in (-1, 1)),
        *({"type": "joint_force", "joint": "D", "force": sense} for sense in (-1, 1)),
        spring("ground", (1, 0, 0), "slider", (0.7, 0, 0), 1.0, 1.0),
        {"type": "rotational_damper", "bodies": ["crank", "rod"], "damping": 1},
        {"type": "point_damper", "bodies": ["crank", "rod"], "point": [0.5, 0, 0], "damping": 1},
        *({"type": f"{k}_spring", "joint": j, "stiffness": 1} for k, j in (("torsion", "A"), ("slide", "D"))),
    ]
    pictures = {still(scene.with_(load=(load,))) for load in loads}
    drivers = [{"joint": joint, "polynomial": [0.0, rate]} for joint, rate in (("A", 1), ("A", -1), ("D", 1))]
    pictures |= {still(scene.with_(driver=(driver,))) for driver in drivers} | {still(scene)}
    assert {load["type"] for load in loads} == set(LOAD_TYPES)
    assert len(pictures) == len(loads) + len(drivers) + 1


def test_png_has_two_pixels_for_each_of_the_svg():
    """Bytes 16 to 24 of a PNG are its width and height (PNG specification, IHDR)."""
    picture = still(SCENES["four_bar"](), width=300.0)
    data = png(picture)
    height = float(ET.fromstring(picture).attrib["height"])
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    assert (int.from_bytes(data[16:20]), int.from_bytes(data[20:24])) == (600, 2 * height)
