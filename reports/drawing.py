"""The mechanism as lines: bodies between their joint anchors, moved by a trajectory, projected."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.interpolate import CubicHermiteSpline

from mbref.drawing.shapes import anchors, is_planar, moved, shapes
from mbref.scene import GROUND, Joint, Scene
from mbref.trajectory import Trajectory
from reports import figures

POSES = 8
FINE = 12  # points of a path between two samples
DEPTH, DEPTH_ANGLE = 0.5, math.radians(35)  # cabinet projection: depth halved, drawn at 35°


def project(points: np.ndarray, planar: bool) -> np.ndarray:
    """Points (…, 3) on the page (…, 2): the xy-plane, or x right, z up and y obliquely backwards."""
    if planar:
        return points[..., :2]
    depth = DEPTH * points[..., 1:2] * np.array([math.cos(DEPTH_ANGLE), math.sin(DEPTH_ANGLE)])
    return points[..., [0, 2]] + depth


def mechanism(scene: Scene, trajectory: Trajectory) -> Figure:
    """The mechanism at several times, later ones darker, and the paths of the centres of mass."""
    parts = [moved(shape, trajectory, b) for b, shape in enumerate(shapes(scene))]
    everything = np.concatenate([p.reshape(-1, 3) for p in parts])
    planar, size = is_planar(everything), float(np.ptp(everything, axis=0).max())
    figure, (axes,) = figures.canvas(7.2, _height(project(everything, planar)))
    poses = np.unique(np.linspace(0, len(trajectory.times) - 1, POSES).astype(int))
    for b, (body, part) in enumerate(zip(scene.body, parts, strict=True)):
        axes.plot(*project(path(trajectory, b), planar).T, color=figures.GREY, linewidth=0.6, zorder=1)
        _draw_body(axes, project(part[poses], planar), figures.COLOURS[b % len(figures.COLOURS)], body.name)
    for joint in scene.joint:
        if GROUND in joint.bodies:
            _draw_ground(axes, joint, _guide(scene, trajectory, joint, size), planar)
    if not planar:
        _draw_depth(axes, everything, size)
    axes.set(aspect="equal", xlabel="x (m)", ylabel="y (m)" if planar else "z (m)")
    axes.margins(0.08)
    figures.legend_below(figure, axes, columns=5)
    return figure


def _height(flat: np.ndarray) -> float:
    """Inches that suit points (n, 2) drawn with equal scales."""
    wide, high = np.ptp(flat, axis=0) + 0.15 * np.ptp(flat)
    return float(np.clip(6.0 * high / wide, 2.4, 5.0))


def path(trajectory: Trajectory, body: int) -> np.ndarray:
    """World points (n, 3) of a centre of mass, between samples by cubics that have its velocities."""
    t, r, v = trajectory.times, trajectory.position[:, body], trajectory.velocity[:, body]
    return r if len(t) < 2 else CubicHermiteSpline(t, r, v)(np.linspace(t[0], t[-1], FINE * len(t)))


def _draw_body(axes: Axes, poses: np.ndarray, colour: str, name: str) -> None:
    link = poses.shape[1] > 1
    look: Any = {"color": colour, "marker": "o" if link else "s", "markersize": 3.5 if link else 8}
    for i, points in enumerate(poses[:-1]):
        axes.plot(*points.T, alpha=0.15 + 0.4 * i / len(poses), linewidth=1.5, zorder=2, **look)
    axes.plot(*poses[-1].T, linewidth=2.6, zorder=3, label=name, **look)


def _guide(scene: Scene, trajectory: Trajectory, joint: Joint, size: float) -> np.ndarray:
    """Ends (2, 3) of the line a joint to the ground slides along, a little longer than its travel."""
    point = np.array(anchors(joint)[joint.bodies.index(GROUND)][1])
    if joint.facts.free_translations != 1 or not joint.directions:
        return np.stack([point, point])
    axis = np.array(joint.directions[0]) / np.linalg.norm(joint.directions[0])
    moving = scene.body_index(next(name for name in joint.bodies if name != GROUND))
    travel = (trajectory.position[:, moving] - point) @ axis
    return point + axis * np.array([[travel.min() - size / 8], [travel.max() + size / 8]])


def _draw_ground(axes: Axes, joint: Joint, guide: np.ndarray, planar: bool) -> None:
    """A triangle at a joint to the ground, its name beside it, and its guide dashed."""
    at = project(np.array(anchors(joint)[joint.bodies.index(GROUND)][1]), planar)
    axes.plot(*project(guide, planar).T, color=figures.GREY, linestyle="--", linewidth=0.9, zorder=1)
    axes.plot(*at, marker="^", color=figures.INK, markersize=8, zorder=4)
    axes.annotate(
        joint.name, (at[0], at[1]), (-12, 6), textcoords="offset points", zorder=5, fontweight="bold"
    )


def _draw_depth(axes: Axes, points: np.ndarray, size: float) -> None:
    """The direction of y on the page, from the lower left corner of what is drawn."""
    flat = project(points, False)
    corner, step = flat.min(axis=0), project(np.array([0.0, size / 4, 0.0]), False)
    axes.annotate("", corner + step, corner, arrowprops={"arrowstyle": "->", "color": figures.GREY})
    axes.annotate("y", corner + step, (3, 1), textcoords="offset points", color=figures.GREY)
