"""Runs of a planar mechanism as a moving picture: SVG with SMIL animation and without any script."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from typing import NamedTuple

import numpy as np

from mbref.drawing.shapes import moved, shapes
from mbref.drawing.svg import COLOURS, GREY, INK
from mbref.scene import GROUND, Scene
from mbref.trajectory import Trajectory
from reports.runs import Run, power

WIDTH, PANEL, FOOT, HEAD, MARGIN = 720.0, 172.0, 46.0, 44.0, 14.0  # px
SECONDS = 14.0  # of one round of the picture
ACCURACY = ("rtol", "step")  # settings that a title shows


class Panel(NamedTuple):
    """A run, drawn over the exact motion: its title, a line below it, and its motion at the same times."""

    title: str
    subtitle: str
    motion: Trajectory


class View(NamedTuple):
    """From metres to pixels of a panel."""

    left: float
    scale: float
    corner: np.ndarray  # (2,), m: least x and greatest y shown

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """Points (…, 3), m, in the xy-plane as pixels (…, 2)."""
        flat = (points[..., :2] - self.corner) * np.array([1.0, -1.0]) * self.scale
        return flat + np.array([self.left + MARGIN, HEAD + MARGIN])


def panel(run: Run) -> Panel:
    """The panel of a run: engine, family and accuracy; error, or why it ended early."""
    accuracy = ", ".join(f"{k} {v:.2g}" for k, v in run.record["settings"].items() if k in ACCURACY)
    said = f"largest error {power(run.error)}" if run.completed else run.reason
    return Panel(f"{run.label}, {accuracy}", said, run.trajectory)


def animated(scene: Scene, exact: Trajectory, panels: Sequence[Panel], marks: Sequence[float]) -> str:
    """The picture: each panel's run in colour over the exact motion in grey, and the time below.

    ``exact`` and the motions have the same times; ``marks`` (s) are drawn on the line of time.  A run that
    ended early stays at its last sample.
    """
    wide = WIDTH / len(panels)
    high = HEAD + PANEL + FOOT
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:g} {high:g}" '
        'font-family="system-ui, sans-serif" font-size="13">',
        f'<rect width="{WIDTH:g}" height="{high:g}" fill="#fff"/>',
    ]
    for i, panel in enumerate(panels):
        parts += _panel(scene, exact, panel, _view(scene, exact, i * wide, wide), wide)
    return "\n".join([*parts, *_time(exact.times, marks), "</svg>"]) + "\n"


def _view(scene: Scene, exact: Trajectory, left: float, wide: float) -> View:
    points = np.concatenate([moved(s, exact, b).reshape(-1, 3) for b, s in enumerate(shapes(scene))])
    least, most = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    scale = float(min((np.array([wide, PANEL]) - 2 * MARGIN - 12) / (most - least)))
    return View(left, scale, np.array([least[0], most[1]]) + np.array([-6.0, 6.0]) / scale)


def _panel(scene: Scene, exact: Trajectory, panel: Panel, view: View, wide: float) -> Iterator[str]:
    middle, name = view.left + wide / 2, f"panel{view.left:.0f}"
    yield f'<clipPath id="{name}"><rect x="{view.left:g}" y="{HEAD:g}" width="{wide:g}" height="{PANEL:g}"/>'
    yield "</clipPath>"
    yield _text(middle, 18, panel.title, f'fill="{INK}" font-weight="600"')
    yield _text(middle, 36, panel.subtitle, f'fill="{INK}"')
    yield f'<g clip-path="url(#{name})" fill="none" stroke-linecap="round" stroke-linejoin="round">'
    yield from _ground(scene, view)
    for b, shape in enumerate(shapes(scene)):
        yield _body(view.pixels(moved(shape, exact, b)), f'stroke="{GREY}" stroke-opacity="0.35"', 9)
    for b, shape in enumerate(shapes(scene)):
        points = _held(moved(shape, panel.motion, b), len(exact.times))
        yield _body(view.pixels(points), f'stroke="{COLOURS[b % len(COLOURS)]}"', 3.5)
    yield "</g>"


def _held(points: np.ndarray, samples: int) -> np.ndarray:
    """Points (samples, n, 3): those of a run that ended early repeat its last."""
    return points[np.minimum(np.arange(samples), len(points) - 1)]


def _ground(scene: Scene, view: View) -> Iterator[str]:
    """A triangle at every joint to the ground, and the dashed line that a slider is guided along."""
    for joint in scene.joint:
        if GROUND in joint.bodies and joint.type != "distance":
            x, y = view.pixels(np.array(joint.anchor))
            if joint.type == "translational":
                dashed = f'stroke="{GREY}" stroke-dasharray="4 4"'
                yield f'<path d="M0 {y:.1f}H{WIDTH:g}" {dashed}/>'
            else:
                yield f'<path d="M{x:.1f} {y:.1f}l-8 14h16z" fill="{INK}"/>'


def _body(points: np.ndarray, look: str, width: float) -> str:
    """A body as a line through its points (k, n, 2), px, moving; a square where it has one point."""
    if points.shape[1] == 1:
        points = points + np.array([[[-7.0, 0.0], [7.0, 0.0]]])
        width *= 4
        look += ' stroke-linecap="butt"'
    frames = [" ".join(f"{x:.1f},{y:.1f}" for x, y in frame) for frame in points]
    moving = _animate("points", ";".join(frames))
    return f'<polyline points="{frames[0]}" {look} stroke-width="{width:g}">{moving}</polyline>'


def _animate(attribute: str, values: str) -> str:
    once = f'attributeName="{attribute}" dur="{SECONDS:g}s" values="{values}"'
    return f'<animate {once} repeatCount="indefinite"/>'


def _time(times: np.ndarray, marks: Sequence[float]) -> Iterator[str]:
    """The line of time, a dot that moves along it, and the marks."""
    left, right, y = 150.0, WIDTH - 40.0, HEAD + PANEL + 18
    places = left + (right - left) * np.array([*marks]) / times[-1]
    ticks = "".join(f"M{x:.1f} {y - 6:g}v12" for x in places)
    yield f'<text x="12" y="{y + 4:g}" fill="{INK}">singular positions</text>'
    yield f'<path d="M{left:g} {y:g}H{right:g}{ticks}" stroke="{INK}" fill="none"/>'
    moving = _animate("cx", f"{left:g};{right:g}")
    yield f'<circle cy="{y:g}" cx="{left:g}" r="5" fill="{COLOURS[1]}">{moving}</circle>'
    yield _text(left, y + 22, "0 s", f'fill="{INK}"')
    yield _text(right, y + 22, f"{times[-1]:g} s", f'fill="{INK}"')


def _text(x: float, y: float, text: str, look: str) -> str:
    return f'<text x="{x:g}" y="{y:g}" text-anchor="middle" {look}>{escape(text)}</text>'
