"""Names of joints and bodies, placed such that they cover neither each other nor the symbols of joints."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from mbref.motions.drawing import svg
from mbref.motions.drawing.marks import Stage
from mbref.motions.drawing.shapes import anchors, shapes
from mbref.motions.drawing.svg import COLOURS, INK
from mbref.motions.joint_motion import carried

LETTER, LINE_HEIGHT = 7.4, 15.0  # px; mean width of a letter, and height of a line
SIGN = 8.0  # px; half the width of a joint's symbol
# cost of the area by which a name covers a name, a symbol or a bar
OVER_NAME, OVER_SIGN, OVER_BAR = 8.0, 3.0, 1.0
BEADS = 25  # number of boxes that represent a bar
ANCHOR = 9.0  # px; distance from an anchor to the nearest edge of its name
# directions: left or right, up or down
AROUND = ((-1, -1), (1, -1), (-1, 1), (1, 1), (0, -1), (0, 1), (-1, 0), (1, 0))
RINGS = (1.0, 2.0, 3.5)  # distances from an anchor / ANCHOR
ALONG = (0.5, 0.35, 0.65, 0.25, 0.75)  # positions along a bar / its length
GAPS = (7.0, 16.0, 30.0)  # px, between a bar and the box of its name


class Label(NamedTuple):
    """A name, its style, and the possible positions (c, k, 2), px, of its centre in each of k frames, best
    first."""

    words: str
    look: str
    places: np.ndarray

    @property
    def half(self) -> np.ndarray:
        """Half the width and height (2,), px."""
        return np.array([LETTER * len(self.words), LINE_HEIGHT]) / 2


def names(stage: Stage) -> Iterator[str]:
    """Yield the names of joints and bodies. A name stays near its moving joint or body."""
    size, taken = np.array([stage.page.width, stage.page.height]), list(_parts(stage))
    for label in (*_of_joints(stage), *_of_bodies(stage)):
        cost = sum((weight * _overlap(label, *box) for weight, *box in taken), _outside(label, size))
        best = label.places[int(np.argmin(cost))]
        taken.append((OVER_NAME, best, label.half))
        yield svg.follow(best, svg.text(0, 4, label.words, label.look), stage.timeline)


def _parts(stage: Stage) -> Iterator[tuple[float, np.ndarray, np.ndarray]]:
    """Yield boxes that names should not cover: weight, centre (k, 2) and half the size (2,), px."""
    for joint in stage.scene.joint:
        for body, point in anchors(joint):
            yield OVER_SIGN, stage.place(body, point), np.array([SIGN, SIGN])
    for load in stage.scene.load:
        if load.type == "moment":
            position = stage.scene.body[stage.scene.body_index(load.body)].position
            yield OVER_SIGN, stage.place(load.body, position), np.array([22.0, 22.0])
    for b, shape in enumerate(shapes(stage.scene)):
        frames = stage.page.pixels(carried(shape.points, stage.motion, b))
        if frames.shape[1] == 1:
            yield OVER_SIGN, frames[:, 0], np.array([19.0, 14.0])
        for start, end in itertools.pairwise(np.swapaxes(frames, 0, 1)):
            for part in np.linspace(0.05, 0.95, BEADS):
                yield OVER_BAR, start + part * (end - start), np.array([3.0, 3.0])


def _overlap(label: Label, middle: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Return the area (c,), px², that each position of a label has in common with a box, summed over
    frames."""
    sides = label.half + half - np.abs(label.places - middle)
    area: np.ndarray = np.clip(sides, 0.0, None).prod(axis=2).sum(axis=1)
    return area


def _outside(label: Label, size: np.ndarray) -> np.ndarray:
    """Return the area (c,), px², by which each position of a label leaves the page, summed over frames."""
    low, high = label.half - label.places, label.places + label.half - size
    beyond: np.ndarray = np.clip(np.maximum(low, high), 0.0, None).max(axis=2).sum(axis=1)
    return LINE_HEIGHT * beyond


def _of_joints(stage: Stage) -> Iterator[Label]:
    """Yield the names of joints, preferably above and left of them; joints that stay together share a
    label."""
    places = {joint.name: stage.place(*anchors(joint)[1]) for joint in stage.scene.joint}
    while places:
        place = next(iter(places.values()))
        near = [n for n, other in places.items() if other is place or np.abs(place - other).max() < LETTER]
        words = ", ".join(near)
        reach = np.array([LETTER * len(words) / 2, LINE_HEIGHT / 2])
        offsets = [np.array(side) * (reach + ring * ANCHOR) for ring in RINGS for side in AROUND]
        yield Label(words, f'fill="{INK}" font-weight="600"', np.stack([place + o for o in offsets]))
        places = {name: other for name, other in places.items() if name not in near}


def _of_bodies(stage: Stage) -> Iterator[Label]:
    """Yield the names of bodies: next to the longest part of a bar, inside a plate, near a block."""
    for b, shape in enumerate(shapes(stage.scene)):
        frames = stage.page.pixels(carried(shape.points, stage.motion, b))
        look = f'fill="{COLOURS[b % len(COLOURS)]}"'
        yield Label(shape.name, look, _places(shape.name, shape.is_plate, frames))


def _places(name: str, is_plate: bool, frames: np.ndarray) -> np.ndarray:
    """Return the possible centres (c, k, 2), px, of the name of a body with points (k, n, 2)."""
    half = np.array([LETTER * len(name), LINE_HEIGHT]) / 2
    if frames.shape[1] == 1:
        side = half[0] + 25.0
        offsets = [(0.0, 26.0), (0.0, -26.0), (side, 0.0), (-side, 0.0), (0.0, 44.0)]
        return np.stack([frames[:, 0] + np.array(offset) for offset in offsets])
    bar = _longest_part(frames)
    start, along = bar[:, 0], bar[:, 1] - bar[:, 0]
    across = np.stack([along[:, 1], -along[:, 0]], axis=1)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    reach = np.abs(across) @ half  # half the width of the name's box across the bar
    beside = [
        start + a * along + side * (reach + gap)[:, None] * across
        for gap in GAPS
        for a in ALONG
        for side in (1.0, -1.0)
    ]
    middle = [frames[:, :-1].mean(axis=1)] if is_plate else []
    side = np.linalg.norm(along, axis=1)[:, None] / 2 + half[0] + GAPS[1]
    level = [start + along / 2 + sign * side * np.array([1.0, 0.0]) for sign in (1.0, -1.0)]
    return np.stack([*middle, *beside, *level])


def _longest_part(frames: np.ndarray) -> np.ndarray:
    """Return the neighbouring points (k, 2, 2) of a line (k, n, 2) that are farthest apart in the first
    frame."""
    parts = np.hypot(*np.diff(frames[0], axis=0).T)
    i = int(np.argmax(parts > 0.99 * parts.max()))
    return frames[:, i : i + 2]
