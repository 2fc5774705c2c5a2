"""Pictures / pixels, boxes of names, views and timelines worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mbref.drawing import labels, svg
from mbref.drawing.labels import Label
from mbref.drawing.timeline import Timeline
from mbref.drawing.view import Page, View, round_length, view_of


# --- names ------------------------------------------------------------------------------------------------
def label(words: str, *places: tuple[float, float]) -> Label:
    """A name with positions in one frame."""
    return Label(words, "", np.array(places, dtype=float)[:, None])


def test_a_name_is_as_wide_as_its_letters():
    assert label("rod", (0, 0)).half == pytest.approx([3 * 7.4 / 2, 7.5])


def test_the_area_that_a_name_has_in_common_with_a_box():
    """A name of 14.8 px by 15 px at four places, and a box of 10 px by 20 px at the origin."""
    name = label("ab", (0, 0), (10, 0), (10, 12.5), (12.4, 0))
    area = labels._overlap(name, np.zeros((1, 2)), np.array([5.0, 10.0]))
    assert area == pytest.approx([12.4 * 17.5, 2.4 * 17.5, 2.4 * 5.0, 0.0])
    twice = Label("ab", "", np.array([[[0.0, 0.0], [10.0, 0.0]]]))
    assert labels._overlap(twice, np.zeros((2, 2)), np.array([5.0, 10.0])) == pytest.approx([14.8 * 17.5])


def test_the_area_by_which_a_name_leaves_the_page():
    """A page of 100 px by 50 px; the wider of the two excesses counts, times the height of a line."""
    name = label("ab", (50, 25), (5.4, 25), (94.6, 45), (50, 2.5), (-0.6, 0.5))
    wanted = [0.0, 2.0, 2.5, 5.0, 8.0]
    assert labels._outside(name, np.array([100.0, 50.0])) == pytest.approx([15 * w for w in wanted])


def test_the_longest_part_of_a_line():
    line = np.array([[0, 0], [3, 4], [3, 14], [3, 4.05], [0, 0]], dtype=float)
    frames = np.stack([line, 2 * line])
    assert labels._longest_part(frames)[:, :, 1].tolist() == [[4.0, 14.0], [8.0, 28.0]], (
        "the first within 1 %"
    )
    assert labels._longest_part(frames[:, 2:])[0].tolist() == [[3.0, 14.0], [3.0, 4.05]]


def test_places_of_the_name_of_a_block():
    places = labels._places("ab", False, np.array([[[10.0, 20.0]]]))[:, 0]
    assert places == pytest.approx(np.array([[10, 46], [10, -6], [42.4, 20], [-22.4, 20], [10, 64]]))


def test_places_of_the_name_of_a_level_bar():
    """A bar of 100 px from (0, 10): the box is 7, 16 or 30 px above and below it, or beyond its ends."""
    places = labels._places("abcd", False, np.array([[[0.0, 10.0], [100.0, 10.0]]]))[:, 0]
    along = [x for x in (50.0, 35.0, 65.0, 25.0, 75.0) for _ in range(2)]
    wanted = [
        (x, 10 + s * (7.5 + gap))
        for gap in (7.0, 16.0, 30.0)
        for x, s in zip(along, [-1, 1] * 5, strict=True)
    ]
    ends = 50 + 14.8 + 16.0
    assert places == pytest.approx(np.array([*wanted, (50 + ends, 10.0), (50 - ends, 10.0)]))


def test_places_of_the_names_of_an_upright_bar_and_of_a_plate():
    upright = labels._places("abcd", False, np.array([[[0.0, 0.0], [0.0, 100.0]]]))[:, 0]
    assert upright[0] == pytest.approx([14.8 + 7.0, 50.0]) and upright[1] == pytest.approx([-21.8, 50.0])
    outline = np.array([[[0.0, 0.0], [60.0, 0.0], [30.0, 30.0], [0.0, 0.0]]])
    plate = labels._places("abcd", True, outline)[:, 0]
    assert plate[0] == pytest.approx([30.0, 10.0]), "the middle of the corners"
    assert plate[1] == pytest.approx([30.0, -14.5])
    point = labels._places("a", False, np.array([[[5.0, 5.0], [5.0, 5.0]]]))
    assert np.isfinite(point).all(), "a bar without length"


# --- views ------------------------------------------------------------------------------------------------
def test_directions_of_views():
    for name, (right, up, out) in {
        "xy": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
        "xz": ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
        "yz": ((0, 1, 0), (0, 0, 1), (1, 0, 0)),
    }.items():
        assert View.parse(name).axes == pytest.approx(np.array([right, up, out], dtype=float))
    oblique = View.parse("oblique")
    assert (oblique.azimuth, oblique.elevation) == pytest.approx((-math.pi / 3, math.radians(22.0)))
    assert View.parse("30,-90").elevation == pytest.approx(-math.pi / 2)
    a, e = math.radians(30), math.radians(40)
    assert View.parse("30,40").axes[2] == pytest.approx(
        [math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)]
    )
    assert View.parse("30,40").axes[0] == pytest.approx([-math.sin(a), math.cos(a), 0.0])
    assert np.cross(*View.parse("30,40").axes[:2]) == pytest.approx(View.parse("30,40").axes[2])


@pytest.mark.parametrize("text", ["0,90.1", "0,-90.1", "nan,0", "inf,0", "up", "1", "1,2,3"])
def test_views_that_are_refused(text):
    with pytest.raises(ValueError, match="view: "):
        View.parse(text)


def test_the_view_of_a_planar_mechanism_is_normal_to_its_plane():
    flat = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [2.0, 0.0, 3.0]])
    assert view_of(flat, [(0.0, -2.0, 0.0)]) == View.parse("xz")
    assert view_of(flat[:, [1, 0, 2]], [(3.0, 0.0, 0.0)]) == View.parse("yz")
    assert view_of(flat[:, [0, 2, 1]], []) == View.parse("xy")
    assert view_of(flat, [(0.0, 1.0, 0.5)]) == view_of(flat + np.eye(3), []) == View.parse("oblique")
    line = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    assert view_of(line, []) == View.parse("xy"), "the last of the possible axes"
    assert view_of(line, [(0.0, 1.0, 0.0)]) == View.parse("xz")


def test_a_page_around_points():
    """2 m by 1 m on 220 px with margins of 10 px: 100 px/m, and 120 px high."""
    points = np.array([[1.0, 5.0, 9.0], [3.0, 6.0, 7.0]])
    page = Page.around(points, View.parse("xy"), 220.0, 10.0, 300.0)
    assert (page.scale, page.height, page.width) == pytest.approx((100.0, 120.0, 220.0))
    assert page.pixels(points) == pytest.approx(np.array([[10, 110], [210, 10]]))
    assert page.pixels(np.array([2.0, 5.5, 0.0])) == pytest.approx([110.0, 60.0])
    assert page.directions(np.array([1.0, 2.0, 3.0])) == pytest.approx([1.0, -2.0])
    low = Page.around(points, View.parse("xy"), 220.0, 10.0, 90.0)
    assert low.scale == pytest.approx(70.0) and low.height == pytest.approx(90.0)
    assert low.pixels(points) == pytest.approx(np.array([[40, 80], [180, 10]])), "in the middle of the width"
    level = Page.around(points * [1, 0, 0], View.parse("xy"), 220.0, 10.0, 300.0)
    assert level.height == pytest.approx(100.0), "at least a third of the tallest"
    assert level.pixels(points * [1, 0, 0])[:, 1] == pytest.approx([50.0, 50.0])


def test_round_lengths():
    for longest, wanted in (
        (1.0, 1.0),
        (1.99, 1.0),
        (2.0, 2.0),
        (4.9, 2.0),
        (5.0, 5.0),
        (9.99, 5.0),
        (0.03, 0.02),
    ):
        assert round_length(longest) == wanted
    assert round_length(0.2 * (1 - 1e-12)) == 0.2 and round_length(1e-7) == 1e-7


# --- elements ---------------------------------------------------------------------------------------------
STILL = None


def test_lines_and_texts():
    frames = np.array([[[0.0, 1.04], [2.06, 3.0]]])
    assert svg.line(frames, "a", STILL) == '<polyline points="0.0,1.0 2.1,3.0" a></polyline>'
    assert svg.line(frames, "a", STILL, closed=True) == '<polygon points="0.0,1.0 2.1,3.0" a></polygon>'
    assert svg.follow(np.array([[1.0, 2.0]]), "x", STILL) == '<g transform="translate(1.0,2.0)">x</g>'
    drawn = svg.text(1.0, 2.0, "a<b\x00", "look", "start")
    assert drawn.startswith('<text x="1.0" y="2.0" text-anchor="start" ') and drawn.endswith(
        ">a&lt;b\ufffd</text>"
    )


def test_an_arrow_and_its_head():
    """20 px to the right: the head is 9 px long and 9 px wide."""
    drawn = svg.arrow(np.array([10.0, 5.0]), np.array([30.0, 5.0]), "red", 1.5)
    assert 'd="M10.0 5.0L21.0 5.0" stroke="red" stroke-width="1.5"' in drawn
    assert 'points="30.0,5.0 21.0,9.5 21.0,0.5"' in drawn
    down = svg.arrow(np.array([0.0, 0.0]), np.array([0.0, 20.0]), "red")
    assert 'points="0.0,20.0 -4.5,11.0 4.5,11.0"' in down
    dot = svg.arrow(np.array([1.0, 2.0]), np.array([1.0, 2.9]), "red")
    assert dot == '<circle cx="1.0" cy="2.0" r="3" fill="red"/>'
    assert svg.arrow(np.array([1.0, 2.0]), np.array([1.0, 3.0]), "red").startswith("<path")


def test_a_turn_and_its_head():
    """Three quarters of a circle that ends at the left."""
    back = svg.turn(10.0, -1.0, "red")
    assert 'd="M0 -10.0A10 10 0 1 1 -10.0 0"' in back and 'points="-15.0,-1.0 -5.0,-1.0 -10.0,-9.0"' in back
    ahead = svg.turn(10.0, 1.0, "red")
    assert 'd="M0 10.0A10 10 0 1 0 -10.0 0"' in ahead and 'points="-15.0,1.0 -5.0,1.0 -10.0,9.0"' in ahead
    assert svg.turn(10.0, 0.0, "red") == ahead


# --- timelines --------------------------------------------------------------------------------------------
def test_a_timeline_shows_at_most_120_samples_in_4_to_12_seconds():
    for samples, shown, seconds, end in ((120, 120, 4.0, 1.0), (121, 61, 5.0, 5.0), (241, 81, 12.0, 30.0)):
        line = Timeline.of(np.linspace(0.0, end, samples), (0.5,), "m")
        assert (len(line.times), line.seconds) == (shown, seconds)
        assert line.samples[1] == -(-samples // 120) and (line.marks, line.label) == ((0.5,), "m")


def test_values_of_an_animation():
    line = Timeline(np.array([1.0, 2.0, 5.0]), np.arange(3), 4.0)
    assert line.fractions(np.array([1.0, 2.0, 5.0])).tolist() == [0.0, 0.25, 1.0]
    assert line.animate("x", ["a", "a", "a"]) == ""
    assert line.animate("x", ["a", "b", "a"]) == (
        '<animate attributeName="x" dur="4s" values="a;b;a" keyTimes="0;0.25;1" repeatCount="indefinite"/>'
    )
    even = Timeline(np.array([1.0, 2.0, 3.0]), np.arange(3), 4.0)
    assert "keyTimes" not in even.animate("x", ["a", "b", "a"], "animateTransform", ' type="t"')
    assert even.animate("x", ["a", "b", "a"], "animateTransform", ' type="t"').startswith(
        '<animateTransform attributeName="x" type="t" dur="4s"'
    )
    uneven = Timeline(np.array([0.0, 1.003, 2.0]), np.arange(3), 4.0)
    assert "keyTimes" in uneven.animate("x", ["a", "b", "a"]), "1.5e-3 of the time from the middle"
    assert Timeline(np.array([2.0]), np.arange(1), 4.0).fractions(np.array([2.0])).tolist() == [0.0]
