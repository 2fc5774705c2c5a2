"""Slider-crank in a plane: crank on a revolute, connecting rod, slider on a straight line.

With θ the crank's and φ the rod's angle from the line, a and b their lengths, h the line's offset from
the crank's axis: b sin φ = h - a sin θ and x = a cos θ + b cos φ.  When a = b and h = 0 the branch that
passes the singular positions θ = ±π/2 smoothly is φ = -θ, or φ = π + θ with the slider at rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from crosscheck.judge.loads import initial_rotations
from crosscheck.judge.tolerances import ON_PATH, PARALLEL, SAME_LENGTH
from crosscheck.judge.truth.one_dof import Path, Pose, circle, turned
from crosscheck.judge.truth.parallelogram import pivots_of, turning_driver, unit
from mbref.scene import GROUND, Distance, Revolute, Scene, Translational


@dataclass(frozen=True)
class Lengths:
    """Lengths of crank a, rod b and offset h of the line (m), and the initial angles of crank and rod
    (rad)."""

    a: float
    b: float
    h: float
    theta0: float
    phi0: float

    def equal(self) -> bool:
        """Return whether the linkage has singular positions that it can pass smoothly."""
        return abs(self.a - self.b) <= SAME_LENGTH * self.b and abs(self.h) <= SAME_LENGTH * self.b

    def turns_fully(self) -> bool:
        """Return whether the crank has no dead position."""
        return self.equal() or self.a + abs(self.h) < self.b

    def rod(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return φ and its first and second derivative by θ."""
        if self.equal():
            folded = np.cos(self.phi0 - self.theta0 - np.pi) > np.cos(self.phi0 + self.theta0) + ON_PATH
            slope = 1.0 if folded else -1.0
            return self.phi0 + slope * (theta - self.theta0), slope + 0 * theta, 0 * theta
        sine = (self.h - self.a * np.sin(theta)) / self.b
        side = np.sign(np.cos(self.phi0))
        cosine = side * np.sqrt(1 - sine**2)
        phi = np.arcsin(sine) if side > 0 else np.pi - np.arcsin(sine)
        slope = -self.a * np.cos(theta) / (self.b * cosine)
        return phi, slope, (self.a * np.sin(theta) / self.b + sine * slope**2) / cosine


def planar_slider_crank(scene: Scene) -> Path | None:
    """Return the path of a scene that may be a planar slider-crank, or None."""
    parts = parts_of(scene, Revolute)
    if parts is None:
        return None
    crank, rod, slider, pivot, pin, end, guide = parts
    axis, line = unit(pivot.axis), unit(guide.axis)
    across = np.cross(axis, line)
    if abs(axis @ line) > PARALLEL:
        return None
    centre, b0, c0 = (np.array(joint.anchor) for joint in (pivot, pin, end))
    arm, reach = b0 - centre, c0 - b0
    a, b = np.hypot(arm @ line, arm @ across), np.hypot(reach @ line, reach @ across)
    theta0, phi0 = np.arctan2(arm @ across, arm @ line), np.arctan2(reach @ across, reach @ line)
    lengths = Lengths(a, b, (c0 - centre) @ across, theta0, phi0)
    if min(a, b) == 0 or not lengths.turns_fully():
        return None
    rotation0 = initial_rotations(scene)
    position0 = np.array([body.position for body in scene.body])
    start = float(lengths.rod(np.array([theta0]))[0][0])

    def poses(q: np.ndarray) -> Pose:
        phi, slope, bend = lengths.rod(theta0 + q)
        turn = phi - start
        zero, one = np.zeros_like(q), np.ones_like(q)
        turns = {crank: (q, one, zero), rod: (turn, slope, bend), slider: (zero, zero, zero)}
        pin_path = circle(axis, q, arm)
        rod_path = _chained(circle(axis, turn, reach), slope, bend)
        slider_path = [line * ((pin_path[n] + rod_path[n]) @ line)[:, None] for n in range(3)]
        slider_path[0] = slider_path[0] - line * ((arm + reach) @ line) + position0[slider]
        centre_path = _chained(circle(axis, turn, position0[rod] - b0), slope, bend)
        crank_path = circle(axis, q, position0[crank] - centre)
        paths = {
            crank: (centre + crank_path[0], *crank_path[1:]),
            rod: (centre + pin_path[0] + centre_path[0], *map(np.add, pin_path[1:], centre_path[1:])),
            slider: tuple(slider_path),
        }
        order = sorted(paths)
        position, dposition, ddposition = (np.stack([paths[i][n] for i in order], axis=1) for n in range(3))
        angle, spin, dspin = (np.stack([turns[i][n] for i in order], axis=1) for n in range(3))
        rotation = np.stack([turned(axis, angle[:, i]) @ rotation0[i] for i in order], axis=1)
        spins = (rate[..., None] * axis for rate in (spin, dspin))
        return Pose(position, rotation, angle, dposition, ddposition, *spins)

    with_q = np.where(np.arange(3) == crank, 1.0, np.nan)
    return Path("planar_slider_crank", poses, axis, turning_driver(scene, axis, with_q))


class Parts(NamedTuple):
    """Indices of three bodies in a chain from ground to ground, and the joints between them."""

    crank: int
    rod: int
    slider: int
    pivot: Revolute
    pin: Any
    end: Any
    guide: Translational


def parts_of(scene: Scene, pin_type: type) -> Parts | None:
    """Return the parts of a slider-crank whose crank pin is a joint of the given type, or None."""
    if len(scene.body) != 3 or len(scene.joint) != 4:
        return None
    pivots = pivots_of(scene)
    found = [j for j in scene.joint if isinstance(j, Translational) and GROUND in j.bodies]
    guides = {name: joint for joint in found for name in joint.bodies if name != GROUND}
    if len(pivots) != 1 or len(guides) != 1 or pivots.keys() & guides.keys():
        return None
    ((crank, pivot),) = pivots.items()
    ((slider, guide),) = guides.items()
    rod = next(body.name for body in scene.body if body.name not in (crank, slider))
    pins = [j for j in scene.joint if set(j.bodies) == {crank, rod} and isinstance(j, pin_type)]
    ends = [j for j in scene.joint if set(j.bodies) == {rod, slider} and not isinstance(j, Distance)]
    if len(pins) != 1 or len(ends) != 1:
        return None
    index = scene.body_index
    return Parts(index(crank), index(rod), index(slider), pivot, pins[0], ends[0], guide)


def _chained(path: tuple[np.ndarray, ...], slope: np.ndarray, bend: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return a path given by an angle, with derivatives by q; the derivatives of the angle by q are
    arguments."""
    value, first, second = path
    return value, first * slope[:, None], second * slope[:, None] ** 2 + first * bend[:, None]
