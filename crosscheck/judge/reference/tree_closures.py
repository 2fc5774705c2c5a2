"""The equations that close the loops of a spanning tree, as wrenches: values, rates, drifts, Jacobian.

With d from a point of the first body to a point of the second body, and directions a of the first and b of
the second body, the equations are a · d = 0, d · d / 2 = constant and a · b = constant.  The rate of an
equation is linear in the twists of the two bodies; its coefficients form a wrench on each body, and wrenches
times the columns of the tree's Jacobian are the Jacobian of the closures.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from crosscheck.judge.arithmetic import Arithmetic, doubles
from crosscheck.judge.reference.tree_joints import Placed, Tree, joint_frame
from crosscheck.judge.reference.vectors import apply, cross, dot, unit

# value, first rate, and second rate without joint accelerations (K, m, 3)
Carried = tuple[np.ndarray, np.ndarray, np.ndarray]
SLIDING = {"translational": (0, 1), "cylindrical": (0, 1), "planar": (2,), "inline": (0, 1), "free": ()}
"""Numbers of the directions (two normal to the axis, the axis) that nothing may slide along; else all."""
ALL, TILTS = ((1, 2), (0, 2), (0, 1)), ((2, 0), (2, 1))
LOCKED = {"fixed": ALL, "translational": ALL, "revolute": TILTS, "cylindrical": TILTS, "planar": TILTS}
"""Pairs of directions, of the first body and of the second, that stay perpendicular."""


@dataclass(frozen=True)
class Rows:
    """Equations at K samples: values (K, m), the parts ``drift`` (K, m) of their second rates without joint
    accelerations, and the Jacobian (K, m, nv).

    The Jacobian times the joint rates is the rate of the values.
    """

    value: np.ndarray
    drift: np.ndarray
    jacobian: np.ndarray

    def joined(self, other: Rows) -> Rows:
        """Return these rows followed by other rows."""
        pairs = ((self.value, other.value), (self.drift, other.drift), (self.jacobian, other.jacobian))
        return Rows(*(np.concatenate(pair, axis=1) for pair in pairs))

    def among(self, rows: np.ndarray) -> Rows:
        """Return some of the rows, by number."""
        return Rows(self.value[:, rows], self.drift[:, rows], self.jacobian[:, rows])


class Closures:
    """Closures of a tree's cut joints as arrays: for each kind the bodies (m, 2) and, fixed to them, vectors
    to points, or directions (m, ·, 3)."""

    def __init__(self, tree: Tree):
        shifts: list[Any] = []
        lengths: list[Any] = []
        angles: list[Any] = []
        for joint in tree.cut:
            pair = tuple(tree.scene.body_index(name) for name in joint.bodies)
            if joint.type == "distance":
                lengths.append((pair, _arms(tree, pair, joint.anchors)))
                continue
            frame, arms = joint_frame(tree.arithmetic, joint), _arms(tree, pair, (joint.anchor,) * 2)
            shifts += [(pair, (*arms, frame[n])) for n in SLIDING.get(joint.type, (0, 1, 2))]
            angles += [(pair, (frame[a], frame[b])) for a, b in LOCKED.get(joint.type, ())]
            if joint.type == "universal":
                angles.append((pair, unit(tree.arithmetic.array(joint.axes))))
        self.shifts, self.lengths, self.angles = (
            _Packed(tree.arithmetic, rows, size) for rows, size in ((shifts, 3), (lengths, 2), (angles, 2))
        )
        ends = tree.start[self.lengths.bodies] + self.lengths.vectors[:, :2]
        span = ends[:, 1] - ends[:, 0]
        self.half_square = dot(span, span) / 2
        self.cosine = dot(self.angles.vectors[:, 0], self.angles.vectors[:, 1])

    def sizes(self, length: float) -> np.ndarray:
        """Return the change of each closure (m,) when its joint parts by a length (m), or turns by a
        radian."""
        spans = np.sqrt(2 * doubles(self.half_square))
        counts = len(self.shifts.bodies), len(self.angles.bodies)
        return np.concatenate([np.full(counts[0], length), length * spans, np.ones(counts[1])])

    def rows(self, placed: Placed, displaced: np.ndarray) -> Rows:
        """Return the rows for placed bodies, with joints displaced by the given amounts (m,)."""
        kinds = ((self.shifts, self._shifts), (self.lengths, self._lengths), (self.angles, self._angles))
        rows = none(placed)
        for packed, equations in kinds:
            if len(packed.bodies):
                rows = rows.joined(equations(placed))
        return Rows(rows.value - displaced, rows.drift, rows.jacobian)

    def _shifts(self, placed: Placed) -> Rows:
        return shift_rows(self.shifts, placed)

    def _lengths(self, placed: Placed) -> Rows:
        p, q = self.lengths.carried(placed)
        d = self.lengths.offset(placed, p, q)
        first = np.concatenate([-1 * d[0], cross(d[0], p[0])], axis=-1)
        second = np.concatenate([d[0], cross(q[0], d[0])], axis=-1)
        value, drift = dot(d[0], d[0]) / 2 - self.half_square, dot(d[0], d[2]) + dot(d[1], d[1])
        return Rows(value, drift, self.lengths.jacobian(placed, first, second))

    def _angles(self, placed: Placed) -> Rows:
        a, b = self.angles.carried(placed)
        drift = dot(a[2], b[0]) + 2 * dot(a[1], b[1]) + dot(a[0], b[2])
        moment = cross(b[0], a[0])
        second = np.concatenate([0 * moment, moment], axis=-1)
        return Rows(dot(a[0], b[0]) - self.cosine, drift, self.angles.jacobian(placed, -1 * second, second))


class Measured:
    """Coordinates of joints that are not in the tree, angles first, as rows whose values are integrated."""

    def __init__(self, tree: Tree, turning: list[Any], sliding: list[Any]):
        def pair(joint: Any) -> tuple[int, ...]:
            return tuple(tree.scene.body_index(name) for name in joint.bodies)

        axes = [(pair(joint), (joint_frame(tree.arithmetic, joint)[2],)) for joint in turning]
        places = [
            (
                pair(joint),
                (*_arms(tree, pair(joint), (joint.anchor,) * 2), joint_frame(tree.arithmetic, joint)[2]),
            )
            for joint in sliding
        ]
        self.packed = _Packed(tree.arithmetic, axes, 1)
        self._slides = _Packed(tree.arithmetic, places, 3)
        self.sizes = np.repeat([False, True], [len(turning), len(sliding)])  # True for a length

    def rows(self, placed: Placed, value: np.ndarray) -> Rows:
        """Return the rows for placed bodies and given angles and displacements (K, m)."""
        count = len(self.packed.bodies)
        found = self._angles(placed, value[:, :count]) if count else none(placed)
        if not len(self._slides.bodies):
            return found
        shifts = shift_rows(self._slides, placed)
        return found.joined(Rows(value[:, count:], shifts.drift, shifts.jacobian))

    def _angles(self, placed: Placed, value: np.ndarray) -> Rows:
        first, second = self.packed.bodies.T
        ((axis, axis_rate, _),) = self.packed.carried(placed)
        drift = dot(axis_rate, placed.spin[:, second] - placed.spin[:, first])
        drift = drift + dot(axis, placed.spin_drift[:, second] - placed.spin_drift[:, first])
        moment = np.concatenate([0 * axis, axis], axis=-1)
        return Rows(value, drift, self.packed.jacobian(placed, -1 * moment, moment))


def shift_rows(shifts: _Packed, placed: Placed) -> Rows:
    """Return the rows a · d for vectors to points on both bodies and directions on the first."""
    p, q, a = shifts.carried(placed)
    d = shifts.offset(placed, p, q)
    drift = dot(a[2], d[0]) + 2 * dot(a[1], d[1]) + dot(a[0], d[2])
    first = np.concatenate([-1 * a[0], cross(a[0], d[0] + p[0])], axis=-1)
    second = np.concatenate([a[0], cross(q[0], a[0])], axis=-1)
    return Rows(dot(a[0], d[0]), drift, shifts.jacobian(placed, first, second))


def none(placed: Placed) -> Rows:
    """Return zero rows for as many samples."""
    empty = placed.velocity[:, 0, :0]
    return Rows(empty, empty, placed.columns[:, 0, :, :0].swapaxes(1, 2))


class _Packed:
    """Rows of one kind: ``bodies`` (m, 2) and vectors (m, size, 3), the second one fixed to the second
    body."""

    def __init__(self, arithmetic: Arithmetic, rows: list[tuple[Any, Any]], size: int):
        self.bodies = np.array([pair for pair, _ in rows], dtype=int).reshape(-1, 2)
        self.vectors = arithmetic.array([vectors for _, vectors in rows]).reshape(-1, size, 3)
        self._carriers = self.bodies[:, [0, 1, 0][:size]]

    def carried(self, placed: Placed) -> list[Carried]:
        """Return value, first rate, and second rate without joint accelerations (K, m, 3) of each vector."""
        value = apply(placed.rotation[:, self._carriers], self.vectors)
        spin = placed.spin[:, self._carriers]
        rate = cross(spin, value)
        drift = cross(placed.spin_drift[:, self._carriers], value) + cross(spin, rate)
        return [(value[:, :, k], rate[:, :, k], drift[:, :, k]) for k in range(self.vectors.shape[1])]

    def offset(self, placed: Placed, p: Carried, q: Carried) -> list[np.ndarray]:
        """Return value, first rate, and second rate without joint accelerations (K, m, 3) of the vector from
        point p of the first body to point q of the second."""
        first, second = self.bodies.T
        centres = (placed.position, placed.velocity, placed.drift)
        return [x[:, second] - x[:, first] + b - a for x, a, b in zip(centres, p, q, strict=True)]

    def jacobian(self, placed: Placed, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Return the Jacobian (K, m, nv) of wrenches (K, m, 6) on the two bodies."""
        columns = placed.columns[:, self.bodies]  # shape (K, m, 2, nv, 6)
        return apply(columns, np.stack([first, second], axis=2)).sum(axis=2)


def _arms(tree: Tree, bodies: tuple[int, ...], points: Any) -> np.ndarray:
    """Return points (2, 3) relative to the bodies' centres at t = 0."""
    return tree.arithmetic.array(points) - tree.start[list(bodies)]
