"""A mechanism that moves by style sheets alone: its true motion, and one run's over it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Any, NamedTuple

import numpy as np

from mbref.scene import GROUND, Scene
from mbref.trajectory import Trajectory
from reports.drawing import is_planar, moved, project, shapes

WIDTH, HEIGHT, MARGIN = 640.0, 380.0, 34.0  # px
SECONDS = 9.0  # of one round
SLIDER = 11.0  # px, half the side of a body drawn at one point
VARIES = 1e-3  # relative change of a drawn length that is animated


class Picture(NamedTuple):
    """An SVG element and the keyframes that move it."""

    svg: str
    css: str


def poses(scene: Scene, record: dict[str, Any]) -> Trajectory:
    """Positions and orientations of a record at its times; the rest is left zero."""
    bodies = [body.name for body in scene.body]
    position, orientation = (
        np.array([record["bodies"][name][key] for name in bodies]).transpose(1, 0, 2)
        for key in ("position", "orientation")
    )
    nothing, times = np.zeros_like(position), np.array(record["times"])
    shape = (tuple(bodies), position, orientation, nothing, nothing)
    return Trajectory(scene.name, "", "", "", {}, times, *shape)


def picture(name: str, scene: Scene, exact: Trajectory, run: Trajectory | None, tone: int) -> Picture:
    """The true motion in ink and a run's at the same times in an engine's tone; ``name`` makes ids unique.

    Without motion, as where the reader asks for less, it stands where the two are furthest apart.
    """
    layers = [_Layer("true", exact)] + ([] if run is None else [_Layer(f"run tone{tone}", run)])
    motions = [layer.motion for layer in layers]
    label = f"The mechanism {scene.name} in motion"
    return _drawn(name, label, scene, layers, _View(scene, motions[:1]), _furthest(motions))


def branches(
    name: str, scene: Scene, motions: Mapping[str, Trajectory], at: float, tone: int
) -> dict[str, Picture]:
    """A picture by title for each motion, in an engine's tone, over the first, in ink, with a line of time on
    which the time ``at`` (s) is marked.

    All show the same part of space and, without motion, the sample at which a motion is furthest from the
    first.  A motion that ended early stays at its last sample.
    """
    every = list(motions.values())
    view, still, pictures = _View(scene, every), _furthest(every), {}
    for k, (title, motion) in enumerate(motions.items()):
        layers = [_Layer("true", every[0]), _Layer(f"run tone{tone}", motion)]
        drawn = _drawn(f"{name}-{k}", f"{scene.name}: {title}", scene, layers, view, still)
        line = _line_of_time(f"{name}-{k}", *view.shares(np.array([at, view.times[still]])))
        pictures[title] = Picture(drawn.svg.replace("</svg>", f"{line.svg}</svg>"), drawn.css + line.css)
    return pictures


class _Layer(NamedTuple):
    """The classes a motion is drawn with, and the motion."""

    look: str
    motion: Trajectory


def _drawn(name: str, label: str, scene: Scene, layers: Sequence[_Layer], view: _View, still: int) -> Picture:
    """Layers over one another at a sample, and the keyframes that move them."""
    groups, frames = [], []
    for look, motion in layers:
        parts = {f"{name}{look[0]}{i}": part for i, part in enumerate(_parts(scene, motion, view))}
        elements = [
            f'<{part.element} class="{each}" style="transform:{part.steps[still]}"/>'
            for each, part in parts.items()
        ]
        groups.append(f'<g class="{look}">{"".join(elements)}</g>')
        frames += [_keyframes(each, view.shares(motion.times), part.steps) for each, part in parts.items()]
    svg = (f'<svg class="moving" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" role="img" aria-label="{escape(label)}">'
           f"{''.join(_ground(scene, view))}{''.join(groups)}</svg>")  # fmt: skip
    return Picture(svg, "".join(frames))


def _line_of_time(name: str, marked: float, still: float) -> Picture:
    """A line for the whole time with a mark at a share of it, and a dot that moves along it.

    Without motion the dot is at the share ``still``.
    """
    left, right, y = MARGIN, WIDTH - MARGIN, HEIGHT - 14
    mark, now = (left + share * (right - left) for share in (marked, still))
    line = f'<path class="clock" d="M{left:g} {y:g}H{right:g}M{mark:.1f} {y - 9:g}v18"/>'
    dot = (
        f'<g class="{name}n" style="transform:translate({now:.1f}px,{y:g}px)"><circle class="now" r="6"/></g>'
    )
    ends = [f"translate({end:g}px,{y:g}px)" for end in (left, right)]
    return Picture(line + dot, _keyframes(f"{name}n", np.array([0.0, 1.0]), ends))


def _furthest(motions: Sequence[Trajectory]) -> int:
    """The sample, of those that all motions reached, at which a body is furthest from its first motion."""
    reached = min(len(motion.times) for motion in motions)
    places = np.array([motion.position[:reached] for motion in motions])
    return int(np.linalg.norm(places - places[0], axis=-1).max(axis=(0, 2)).argmax())


class _Part(NamedTuple):
    """An element at the origin, and the transforms that place it at each time."""

    element: str
    steps: Sequence[str]


class _View:
    """From metres to pixels: the xy-plane of a planar motion, else an oblique view; from times to shares."""

    def __init__(self, scene: Scene, motions: Sequence[Trajectory]):
        bodies = list(enumerate(shapes(scene)))
        points = np.concatenate([moved(s, motion, b).reshape(-1, 3) for motion in motions for b, s in bodies])
        grounded = [
            joint.anchor_pair[joint.bodies.index(GROUND)] for joint in scene.joint if GROUND in joint.bodies
        ]
        points = np.concatenate([points, np.array(grounded).reshape(-1, 3)])
        self.planar, self.times = is_planar(points), max((m.times for m in motions), key=len)
        flat = project(points, self.planar)
        least, most = flat.min(axis=0), flat.max(axis=0)
        size = np.maximum(most - least, 1e-9 * max(float(np.ptp(flat)), 1e-9))
        room = np.array([WIDTH, HEIGHT]) - 2 * MARGIN
        self.scale = float((room / size).min())
        self.corner = (least + most) / 2 + np.array([-WIDTH, HEIGHT]) / (2 * self.scale)

    def shares(self, times: np.ndarray) -> np.ndarray:
        """Times, s, as shares of the time that is shown."""
        return (times - self.times[0]) / ((self.times[-1] - self.times[0]) or 1.0)

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """World points (…, 3) as pixels (…, 2)."""
        return (project(points, self.planar) - self.corner) * np.array([1.0, -1.0]) * self.scale


def _parts(scene: Scene, motion: Trajectory, view: _View) -> Iterator[_Part]:
    """The lines of every body between its joints; a square for a body with one of them."""
    for b, shape in enumerate(shapes(scene)):
        points = view.pixels(moved(shape, motion, b))
        if points.shape[1] == 1:
            square = f'rect x="{-SLIDER:g}" y="{-SLIDER:g}" width="{2 * SLIDER:g}" height="{2 * SLIDER:g}"'
            yield _Part(square, [f"translate({x:.1f}px,{y:.1f}px)" for x, y in points[:, 0]])
        for i in range(points.shape[1] - 1):
            yield _line(points[:, i], points[:, i + 1])


def _line(start: np.ndarray, end: np.ndarray) -> _Part:
    """A line between two points (k, 2) that move."""
    along = end - start
    angle = np.unwrap(np.arctan2(along[:, 1], along[:, 0]))
    length = np.linalg.norm(along, axis=1)
    longest = float(length.max())
    varies = float(np.ptp(length)) > VARIES * longest
    steps = [
        f"translate({x:.1f}px,{y:.1f}px)rotate({a:.3f}rad)"
        + (f"scale({s / longest:.3f},1)" if varies else "")
        for (x, y), a, s in zip(start, angle, length, strict=True)
    ]
    return _Part(f'line x2="{longest:.1f}"', steps)


def _keyframes(name: str, shares: np.ndarray, steps: Sequence[str]) -> str:
    """Steps at shares (k,) of a round; the last one stays until its end."""
    frames = "".join(
        f"{100 * share:.4g}%{{transform:{step}}}" for share, step in zip(shares, steps, strict=True)
    )
    if shares[-1] < 1:
        frames += f"100%{{transform:{steps[-1]}}}"
    return f".{name}{{animation:{name} {SECONDS:g}s linear infinite}}@keyframes {name}{{{frames}}}"


def _ground(scene: Scene, view: _View) -> Iterator[str]:
    """A triangle at every joint to the ground, and the dashed guide of one that slides."""
    for joint in scene.joint:
        if GROUND not in joint.bodies:
            continue
        anchor = np.array(joint.anchor_pair[joint.bodies.index(GROUND)])
        x, y = view.pixels(anchor)
        if joint.facts.free_translations == 1 and joint.directions:
            axis = np.array(joint.directions[0]) * WIDTH / view.scale / np.linalg.norm(joint.directions[0])
            (x1, y1), (x2, y2) = view.pixels(anchor - axis), view.pixels(anchor + axis)
            yield f'<line class="guide" x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"/>'
        else:
            yield f'<path class="ground" d="M{x:.1f} {y:.1f}l-9 15h18z"/>'
