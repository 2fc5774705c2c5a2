"""Names in pictures / boxes that they avoid and places that they take, worked out by hand.

The page has 100 px a metre: (x, y, z) is at (100 x, 500 - 100 y). Body b is at (100, 300), (150, 300) and
(80, 300) in three frames, and body c is at (400, 400).
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from mbref.drawing import labels
from mbref.drawing.svg import COLOURS, INK
from mbref.scene import Distance, Force, Moment, Revolute, Spherical, Spring
from tests.mbref.test_marks_by_hand import PAIR, PLACE, Z, stage

HINGE = Revolute(name="ab", bodies=PAIR, anchor=PLACE, axis=Z)
FRAMES = np.array([[100.0, 300.0], [150.0, 300.0], [80.0, 300.0]])


def test_places_around_a_joint():
    """Half a name of two letters is 7.4 px by 7.5 px; its box is 9, 18 and 31.5 px from the joint."""
    [label] = labels._of_joints(stage(joint=(HINGE,)))
    assert label.words == "ab" and label.look == f'fill="{INK}" font-weight="600"'
    sides = [(-1, -1), (1, -1), (-1, 1), (1, 1), (0, -1), (0, 1), (-1, 0), (1, 0)]
    rings = [(7.4 + gap, 7.5 + gap) for gap in (9.0, 18.0, 31.5)]
    wanted = np.array([(x * across, y * down) for across, down in rings for x, y in sides])
    assert label.places - FRAMES == pytest.approx(np.repeat(wanted[:, None], 3, axis=1))


@pytest.mark.parametrize(("apart", "words"), [(0.073, ["ab, J"]), (0.075, ["ab", "J"])])
def test_joints_that_stay_together_share_a_name(apart, words):
    """A letter is 7.4 px wide; the ball is at the end of the rod that moves with the hinge."""
    x, y, z = PLACE
    ball = Spherical(name="J", bodies=("c", "b"), anchor=(x, y + apart, z))
    found = list(labels._of_joints(stage(joint=(HINGE, ball))))
    assert [label.words for label in found] == words
    still = Spherical(name="J", bodies=("b", "ground"), anchor=PLACE)
    assert len(list(labels._of_joints(stage(joint=(HINGE, still))))) == 2, "they part in the second frame"


def boxes(**parts: Any) -> list[tuple[float, list[list[float]], list[float]]]:
    return [
        (weight, middle.tolist(), half.tolist()) for weight, middle, half in labels._parts(stage(**parts))
    ]


def test_boxes_of_joints_blocks_moments_and_bars():
    """A block for a body with one point, 25 boxes of 6 px along a bar from 5 to 95 % of its length."""
    corner = [[400.0, 400.0]] * 3
    found = boxes(joint=(HINGE,), load=(Moment(body="c", moment=Z),))
    assert found == [
        (3.0, [[100.0, 300.0]] * 3, [8.0, 8.0]),
        (3.0, FRAMES.tolist(), [8.0, 8.0]),
        (3.0, corner, [22.0, 22.0]),
        (3.0, FRAMES.tolist(), [19.0, 14.0]),
        (3.0, corner, [19.0, 14.0]),
    ]
    rod = Distance(name="D", bodies=("c", "ground"), anchors=((3.0, 1.0, 0.0), (0.0, 0.0, 0.0)))
    bars = [box for box in boxes(joint=(rod,)) if box[0] == 1.0]
    assert len(bars) == 25 and all(half == [3.0, 3.0] for _, _, half in bars)
    ends = sorted(bars[k][1][0][0] for k in (0, -1))
    assert ends == pytest.approx([305.0, 395.0]) and bars[0][1][0][1] == 400.0


def placed(**parts: Any) -> dict[str, tuple[float, float]]:
    found = {}
    for text in labels.names(stage(**parts)):
        x, y = map(float, re.search(r"translate\(([-\d.]+),([-\d.]+)\)", text).groups())
        words = re.search(r">([^<>]+)</text>", text)[1]
        assert 'y="4.0"' in text and 'x="0.0"' in text
        found[words] = (x, y)
    return found


def test_names_keep_to_their_first_free_place():
    """Only the symbol of the joint and the blocks of both bodies are on the page; names of 1 or 2 letters."""
    found = placed(joint=(HINGE,))
    assert found["ab"] == (74.6, 274.5), "in the second ring, since the block is 19 px by 14 px"
    assert set(found) == {"ab", "b", "c"} and found["c"] == (400.0, 426.0)


def test_names_do_not_cover_each_other():
    """Two joints of one place on the page with different bodies: the second name takes the next place."""
    other = Revolute(name="cd", bodies=("ground", "c"), anchor=(4.0, 1.0, 0.0), axis=Z)
    third = Revolute(name="ef", bodies=("b", "ground"), anchor=(4.1, 1.0, 0.0), axis=Z)
    found = placed(joint=(other, third))
    middle = np.array([found[name] for name in ("cd", "ef")])
    apart = np.abs(middle[0] - middle[1])
    assert apart[0] >= 14.8 or apart[1] >= 15.0, found


def test_names_of_bodies_have_their_colours():
    labelled = list(labels._of_bodies(stage(joint=(HINGE,))))
    assert [(label.words, label.look) for label in labelled] == [
        ("b", f'fill="{COLOURS[0]}"'),
        ("c", f'fill="{COLOURS[1]}"'),
    ]
    assert labelled[1].places[0].tolist() == [[400.0, 426.0]] * 3


def test_a_point_of_a_load_makes_a_bar():
    """A force at the end of a body, and a spring on the ground, leave one bar of one body."""
    force = Force(body="c", point=(4.0, 2.0, 0.0), force=Z)
    spring = Spring(
        bodies=("ground", "c"), points=((0.0, 0.0, 0.0), (4.0, 1.0, 0.0)), stiffness=1.0, natural_length=1.0
    )
    weights = [weight for weight, *_ in boxes(load=(force, spring))]
    assert weights.count(1.0) == 25 and weights.count(3.0) == 1
