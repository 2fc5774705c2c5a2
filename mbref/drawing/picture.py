"""The picture of a scene, still or moving: bodies, joints, ground and loads, and axes with a length."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from mbref.drawing import svg
from mbref.drawing.marks import Stage, driver_mark, ground_mark, joint_mark, joint_names, load_mark
from mbref.drawing.shapes import Shape, anchors, at_rest, attack, moved, shapes
from mbref.drawing.svg import COLOURS, GREY, INK
from mbref.drawing.view import Page, View, view_of
from mbref.scene import GROUND, Scene
from mbref.trajectory import Trajectory

WIDTH, TALLEST, MARGIN, FOOT = 720.0, 520.0, 64.0, 30.0  # px
PANEL, NARROW, HEAD, LARGE, COLUMNS = 360.0, 44.0, 34.0, 20, 2  # of a picture side by side, px; panels a row
FRAMES = 120  # of a moving picture at most
SHORTEST, LONGEST = 4.0, 12.0  # s of one round of a moving picture


def still(scene: Scene, view: View | None = None, width: float = WIDTH) -> str:
    """The scene at t = 0 as SVG, across its plane unless a view is given."""
    return _picture(scene, at_rest(scene), view, width, 0.0)


def moving(scene: Scene, motion: Trajectory, view: View | None = None, width: float = WIDTH) -> str:
    """The motion as SVG that moves by itself, in real time where one round of it takes 4 to 12 s.

    Samples are shown as they are, at most 120 of them, evenly in time where the trajectory is.
    Raises ValueError where the trajectory has no sample.
    """
    _check(motion)
    return _picture(scene, thinned(motion), view, width, _round(motion.times))


def side_by_side(
    scene: Scene, motions: Mapping[str, Trajectory], words: str, view: View | None = None
) -> str:
    """Motions over the same time as one SVG that moves by itself, two in a row, each below its title.

    All show the same part of space.  A motion that ended early stays at its last sample; where the reader
    asks for no motion, all stand where one is furthest from the first.  Raises ValueError where a trajectory
    has no sample.
    """
    for motion in motions.values():
        _check(motion)
    times = max((motion.times for motion in motions.values()), key=len)
    held = [
        thinned(_samples(m, np.minimum(np.arange(len(times)), len(m.times) - 1))) for m in motions.values()
    ]
    page, apart = _page(scene, held, view, PANEL, NARROW), [_furthest(held)]
    moving = [list(_parts(Stage(scene, motion, page, _round(times)))) for motion in held]
    resting = [list(_parts(Stage(scene, _samples(motion, apart), page, 0.0))) for motion in held]
    parts = svg.moving_or_still(_placed(moving, page.height), _placed(resting, page.height))
    for k, title in enumerate(motions):
        x, y = _corner(k, page.height)
        parts.append(svg.text(x + PANEL / 2, y + HEAD - 10, title, f'fill="{INK}" font-size="{LARGE}"'))
    width, height = PANEL * COLUMNS, _corner(len(held) + COLUMNS - 1, page.height)[1]
    parts += _caption(page.scale, width, height, times, _round(times), LARGE)
    return svg.document(width, height + FOOT, parts, words)


def _placed(panels: Sequence[Sequence[str]], height: float) -> Iterator[str]:
    """Panels of a height (px) in rows, each below room for its title."""
    for k, parts in enumerate(panels):
        x, y = _corner(k, height)
        yield f'<g transform="translate({x:g} {y + HEAD:.1f})">{"".join(parts)}</g>'


def _corner(k: int, height: float) -> tuple[float, float]:
    """The upper left corner, px, of the k-th panel, from 0."""
    return PANEL * (k % COLUMNS), (HEAD + height) * (k // COLUMNS)


def _check(motion: Trajectory) -> None:
    if not motion.times.size:
        raise ValueError(f"the motion of {motion.scene!r} has no sample to draw: {motion.outcome.sentence}")


def thinned(motion: Trajectory) -> Trajectory:
    """The trajectory with every n-th of its samples only, at most 120."""
    return _samples(motion, slice(None, None, math.ceil(len(motion.times) / FRAMES)))


def _samples(motion: Trajectory, chosen: Any) -> Trajectory:
    """The poses and velocities of a trajectory at some of its samples, given as an index of arrays."""
    keys = ("times", "position", "orientation", "velocity", "angular_velocity")
    return Trajectory(
        scene=motion.scene, engine=motion.engine, version=motion.version, method=motion.method, settings={},
        bodies=motion.bodies, outcome=motion.outcome, t_end=motion.t_end,
        **{key: getattr(motion, key)[chosen] for key in keys},
    )  # fmt: skip


def _furthest(motions: Sequence[Trajectory]) -> int:
    """The sample at which a body is furthest from its place in the first motion."""
    places = np.array([motion.position for motion in motions])
    return int(np.linalg.norm(places - places[0], axis=-1).max(axis=(0, 2)).argmax())


def _round(times: np.ndarray) -> float:
    """Seconds of one round of a motion over times (k,)."""
    return float(np.clip(times[-1] - times[0], SHORTEST, LONGEST))


def _picture(scene: Scene, motion: Trajectory, view: View | None, width: float, seconds: float) -> str:
    page = _page(scene, [motion], view, width, MARGIN)
    parts = _with_names(Stage(scene, motion, page, seconds))
    if seconds:
        parts = svg.moving_or_still(parts, _with_names(Stage(scene, _samples(motion, [0]), page, 0.0)))
    parts += [*_axes(page), *_caption(page.scale, width, page.height, motion.times, seconds)]
    words = f"{scene.name}: {len(scene.body)} bodies, {len(scene.joint)} joints"
    return svg.document(width, page.height + FOOT, parts, words)


def _page(
    scene: Scene, motions: Sequence[Trajectory], view: View | None, width: float, margin: float
) -> Page:
    """The page that shows all that moves and what stands."""
    bodies = list(enumerate(shapes(scene)))
    moving = [moved(shape, motion, b).reshape(-1, 3) for motion in motions for b, shape in bodies]
    shown = np.concatenate([*moving, np.array(_fixed_points(scene)).reshape(-1, 3)])
    return Page.around(shown, view or view_of(shown, _turning_axes(scene)), width, margin, TALLEST)


def _fixed_points(scene: Scene) -> list[tuple[float, float, float]]:
    """Anchors on the ground and ends of springs there."""
    found = [a for joint in scene.joint for name, a in anchors(joint) if name == GROUND]
    return found + [p for load in scene.load for name, p in attack(load) if name == GROUND]


def _turning_axes(scene: Scene) -> list[tuple[float, float, float]]:
    """The axes of the revolute joints."""
    return [joint.axis for joint in scene.joint if joint.type == "revolute"]


def _parts(stage: Stage) -> Iterator[str]:
    scene = stage.scene
    for joint in scene.joint:
        if GROUND in joint.bodies:
            yield from ground_mark(stage, joint)
    for b, (shape, frames) in enumerate(_lines(stage)):
        yield _body(shape, frames, COLOURS[b % len(COLOURS)], stage.seconds)
    yield from (load_mark(stage, load) for load in scene.load)
    for joint in scene.joint:
        yield from joint_mark(stage, joint)
    yield from (driver_mark(stage, driver) for driver in scene.driver)


def _with_names(stage: Stage) -> list[str]:
    """All parts, and over them the names of joints and bodies."""
    names = [
        _body_name(shape.name, frames, COLOURS[b % len(COLOURS)], stage.seconds)
        for b, (shape, frames) in enumerate(_lines(stage))
    ]
    return [*_parts(stage), *joint_names(stage), *names]


def _lines(stage: Stage) -> list[tuple[Shape, np.ndarray]]:
    """The bodies' shapes and their pixels (k, n, 2)."""
    return [
        (shape, stage.page.pixels(moved(shape, stage.motion, b)))
        for b, shape in enumerate(shapes(stage.scene))
    ]


def _body(shape: Shape, frames: np.ndarray, colour: str, seconds: float) -> str:
    """A plate, a bar, or a block where the body has one point only."""
    if shape.is_plate:
        look = f'fill="{colour}" fill-opacity="0.18" stroke="{colour}" stroke-width="4"'
        return svg.line(frames[:, :-1], look, seconds, closed=True)
    if frames.shape[1] == 1:
        look = f'x="-17" y="-12" width="34" height="24" rx="3" stroke="{colour}" stroke-width="3"'
        return svg.follow(frames[:, 0], f'<rect {look} fill="{colour}" fill-opacity="0.18"/>', seconds)
    return svg.line(frames, f'fill="none" stroke="{colour}" stroke-width="6"', seconds)


def _body_name(name: str, frames: np.ndarray, colour: str, seconds: float) -> str:
    """The name beside the longest part of a bar, in the middle of a plate, below a block."""
    is_plate = frames.shape[1] > 3 and bool((frames[0, 0] == frames[0, -1]).all())
    points = frames[:, :-1] if is_plate else _longest_part(frames)
    places = points.mean(axis=1) + 4.0 * np.array([0.0, 1.0])
    if frames.shape[1] == 1:
        places = places + np.array([0.0, 26.0])
    elif not is_plate:
        along = frames[:, -1] - frames[:, 0]
        across = np.stack([along[:, 1], -along[:, 0]], axis=1)
        reach = np.array([8.0 + 3.5 * len(name), 13.0])  # half of the name's width and height
        places = places + reach * across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    return svg.follow(places, svg.text(0, 0, name, f'fill="{colour}"'), seconds)


def _longest_part(frames: np.ndarray) -> np.ndarray:
    """Of a line (k, n, 2) the two neighbours (k, 2, 2) that are the furthest apart at first, so that names
    of bars that cross at their middles do not."""
    if frames.shape[1] < 3:
        return frames
    parts = np.hypot(*np.diff(frames[0], axis=0).T)
    i = int(np.argmax(parts > 0.99 * parts.max()))
    return frames[:, i : i + 2]


def _axes(page: Page) -> Iterator[str]:
    """Arrows of x, y and z in the lower left corner, without the one along the line of sight."""
    corner = np.array([30.0, page.height + FOOT - 26])
    for name, seen in zip("xyz", page.directions(np.eye(3)), strict=True):
        if np.hypot(*seen) > 0.2:
            end = corner + 30 * seen
            yield svg.arrow(corner, end, GREY, 1.3)
            x, y = end + 10 * seen / np.hypot(*seen)
            yield svg.text(x, y + 4, name, f'fill="{GREY}" font-size="12"')


def _caption(
    scale: float, width: float, height: float, times: np.ndarray, seconds: float, size: int = 12
) -> Iterator[str]:
    """A bar of a round length, and of a moving picture how its time runs."""
    length, look = _round_length(110 / scale), f'fill="{INK}" font-size="{size}"'
    left, y = width - 40 - length * scale, height + FOOT - 20
    ends = f"M{left:.1f} {y - 4:.1f}v8m0 -4h{length * scale:.1f}m0 -4v8"
    yield f'<path d="{ends}" stroke="{INK}" fill="none"/>'
    yield svg.text(left + length * scale / 2, y - 7, f"{length:g} m", look)
    if seconds:
        words = f"{times[-1] - times[0]:.4g} s in {seconds:.3g} s"
        yield svg.text(width / 2, y + 4, words, look)


def _round_length(longest: float) -> float:
    """The largest of 1, 2 or 5 times a power of ten that is not longer."""
    power = 10.0 ** math.floor(math.log10(longest))
    return float(f"{max(k for k in (1, 2, 5) if k * power <= longest * (1 + 1e-9)) * power:.6g}")
