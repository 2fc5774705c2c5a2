"""Formulation A: a scene in natural coordinates, where every constraint is a product of two linear forms.

The coordinates of a body are the columns of X_b = [r A]: centre of mass and body axes in the world, twelve
numbers (J. García de Jalón and E. Bayo, Kinematic and Dynamic Simulation of Multibody Systems, 1994).  A
point or direction fixed in a body is a linear function X e of the coordinates, so that rigidity and all
joints are rows (X u) · (X w) = c, drivers put a time into c or turn u, and the mass matrix is constant.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from crosscheck.judge import constraints
from crosscheck.judge.arithmetic import Arithmetic, doubles
from crosscheck.judge.reference.natural_joints import JointCoordinates
from crosscheck.judge.reference.start_velocities import given
from mbref.scene import Body, Driver, Scene, refuse_rolling, refuse_turned
from mbref.scene.joints import DISPLACEMENT

PERPENDICULAR = {
    "fixed": ((1, 2), (0, 2), (0, 1)),
    "translational": ((1, 2), (0, 2), (0, 1)),
    "revolute": ((1, 2), (0, 2)),
    "cylindrical": ((1, 2), (0, 2)),
    "planar": ((1, 2), (0, 2)),
}
"""Axes of the joint's frame on the first and on the second body that stay perpendicular, by type."""
SLIDING = {"translational": (0, 1), "cylindrical": (0, 1), "planar": (2,), "inline": (0, 1), "free": ()}
"""Axes of the first body's frame along which the anchors do not part; all three of the world's elsewhere."""
EYE = np.eye(3)
RIGHT_ANGLE = 1e-15  # cosine of axes that are perpendicular to the rounding of their numbers
Sampled = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Row:
    """(X u) · (X w) = c + the driver's value; of a driven angle ψ: (cos ψ X u + sin ψ X v) · (X w) = 0."""

    u: np.ndarray
    w: np.ndarray
    c: Any
    driver: Driver | None = None
    v: np.ndarray | None = None


class NaturalCoordinates:
    """A scene's rows, mass matrix and start in an arithmetic, with nb bodies and n = 4 nb + 4.

    The last columns of X (3, n) are the ground's [0 1]. Lengths are in the unit ``length`` (m), a power of
    two near the scene's size. So all coordinates are about one, and the scaling changes no digit.  Products 0
    … m - 1 are the rows' products; further products are the second products of driven angles.
    """

    def __init__(self, scene: Scene, arithmetic: Arithmetic):
        refuse_rolling(scene, "natural coordinates")
        refuse_turned(scene, "natural coordinates")
        self.scene, self.arithmetic, self.nb = scene, arithmetic, len(scene.body)
        self.length = 2.0 ** round(np.log2(constraints.scene_length(scene)))
        self.axes = [self._orientation(body) for body in scene.body]
        rows = [*self._rigidity(), *self._joints()]
        self.driven = [(k, row) for k, row in enumerate(rows) if row.driver]
        second = [(k, row.v) for k, row in self.driven if row.v is not None]
        self.second = {k: len(rows) + i for i, (k, _) in enumerate(second)}
        self.u = np.array([row.u for row in rows] + [v for _, v in second])
        self.w = np.array([row.w for row in rows] + [rows[k].w for k, _ in second])
        self.c = arithmetic.array([row.c for row in rows])
        self.mass = self._mass()
        self.joints = JointCoordinates(self)
        self.count = len(self.c) + len(self.joints.couplings)  # rows of couplings are last

    def take_right_angles(self) -> None:
        """Let axes of universal joints that are perpendicular to rounding enclose a right angle; with many
        digits the scene's numbers are exact."""
        if not self.arithmetic.digits:
            self.c = np.where(np.abs(doubles(self.c)) <= RIGHT_ANGLE, 0 * self.c, self.c)

    def lengths(self, values: Any) -> np.ndarray:
        """Return lengths, or numbers proportional to lengths, in the unit of the coordinates."""
        return self.arithmetic.array(values) / self.length

    def direction(self, body: int, vector: np.ndarray) -> np.ndarray:
        """Return the form e (n,) such that X e is a body-fixed direction that equals ``vector`` (world) at t
        = 0."""
        return self._form(body, 0.0, vector if body < 0 else vector @ self.axes[body])

    def point(self, body: int, place: Sequence[float]) -> np.ndarray:
        """Return the form e (n,) such that X e is a body-fixed point at ``place`` (world, m) at t = 0."""
        at = self.lengths(place)
        if body < 0:
            return self._form(body, 1.0, at)
        return self._form(body, 1.0, (at - self.lengths(self.scene.body[body].position)) @ self.axes[body])

    def frame(self, axis: Sequence[float]) -> np.ndarray:
        """Return three perpendicular unit vectors (rows), the last along an axis."""
        along = self._unit(self.arithmetic.array(axis))
        across = self._unit(np.cross(EYE[np.argmin(np.abs(doubles(along)))], along))
        return np.array([across, np.cross(along, across), along])

    def indices(self, names: Sequence[str]) -> list[int]:
        """Return body indices, -1 for the ground."""
        return [self.scene.body_index(name) for name in names]

    def start(self) -> tuple[np.ndarray, np.ndarray]:
        """Return X, X' (3, n) at t = 0 with zero velocities; raises SceneError if the scene's velocities
        contradict its joints."""
        constraints.initial_twists(self.scene)
        x, v = self.arithmetic.zeros(2, 3, 4 * self.nb + 4)
        x[:, -3:] = self.arithmetic.array(EYE)
        for b, body in enumerate(self.scene.body):
            x[:, 4 * b] = self.lengths(body.position)
            x[:, 4 * b + 1 : 4 * b + 4] = self.axes[b]
        return x, v

    def given_velocities(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return forms (g, 3 (n - 4)) of the given velocities at coordinates x, and their values (g,), both
        weighted."""
        asked = given(self.scene)
        angular = asked.components % 6 > 2
        values = self.lengths(asked.values) * self.arithmetic.array(asked.weights)
        weights = self.lengths(np.where(angular, asked.weights, self.length))
        return weights[:, None] * self._twists(x)[asked.components], values

    def _twists(self, x: np.ndarray) -> np.ndarray:
        """Return forms (6 nb, 3 (n - 4)) of the bodies' velocities and angular velocities in X' of rigid
        bodies."""
        forms = self.arithmetic.zeros(self.nb, 6, 3, 4 * self.nb)
        for b, i in itertools.product(range(self.nb), range(3)):
            axes = slice(4 * b + 1, 4 * b + 4)
            forms[b, i, i, 4 * b] = self.arithmetic.number(1.0)
            forms[b, 3 + i, i - 1, axes], forms[b, 3 + i, i - 2, axes] = (
                x[i - 2, axes] / 2,
                -x[i - 1, axes] / 2,
            )
        return forms.reshape(6 * self.nb, -1)

    def bodies(self, x: np.ndarray, v: np.ndarray, a: np.ndarray) -> Sampled:
        """Return positions, orientations, velocities, angular velocities and both accelerations, as in
        Motion, from coordinates and their derivatives (k, 3, n)."""
        blocks = [s[..., :-4].reshape(len(s), 3, self.nb, 4).transpose(0, 2, 1, 3) for s in (x, v, a)]
        places = [self.length * block[..., 0] for block in blocks]
        axes, rates, bends = (block[..., 1:] for block in blocks)
        spins = [axial(b @ np.swapaxes(axes, -1, -2)) for b in (rates, bends)]
        return places[0], quaternions(axes), places[1], spins[0], places[2], spins[1]

    def _form(self, body: int, one: float, vector: np.ndarray) -> np.ndarray:
        form = self.arithmetic.zeros(4 * self.nb + 4)
        first = 4 * (body % (self.nb + 1))
        form[first] = self.arithmetic.number(one)
        form[first + 1 : first + 4] = vector
        return form

    def _unit(self, vector: np.ndarray) -> np.ndarray:
        return vector / np.sqrt((vector * vector).sum())

    def _orientation(self, body: Body) -> np.ndarray:
        """Return the rotation matrix (3, 3) of the body's quaternion, whose length is one up to rounding
        only."""
        q = self.arithmetic.array(body.orientation)
        w, v = q[0], q[1:]
        outer = v[:, None] * v
        turned = (w * w - (v * v).sum()) * EYE + 2 * (outer + w * skew(v))
        return turned / (q * q).sum()

    def _rigidity(self) -> Iterator[Row]:
        """Return six rows for each body: its axes have length one and are perpendicular."""
        for b in range(self.nb):
            for i, j in itertools.combinations_with_replacement(range(3), 2):
                scale = 0.5 if i == j else 1.0
                yield Row(scale * self._axis(b, i), self._axis(b, j), scale * (i == j))

    def _axis(self, body: int, i: int) -> np.ndarray:
        """Return the form of a body's own axis, or of a world axis (body -1)."""
        return self._form(body, 0.0, self.arithmetic.array(EYE[i]))

    def _joints(self) -> Iterator[Row]:
        drivers = {driver.joint: driver for driver in self.scene.driver}
        for joint in self.scene.joint:
            if joint.type == "distance":
                yield self._distance(joint)
                continue
            first, second = self.indices(joint.bodies)
            apart = self.point(second, joint.anchor) - self.point(first, joint.anchor)
            frame = self.frame(joint.axis) if hasattr(joint, "axis") else self.arithmetic.array(EYE)
            e, f = ([self.direction(b, axis) for axis in frame] for b in (first, second))
            held = [e[i] for i in SLIDING[joint.type]] if joint.type in SLIDING else self._world()
            yield from (Row(axis, apart, 0.0) for axis in held)
            yield from (Row(e[i], f[j], 0.0) for i, j in PERPENDICULAR.get(joint.type, ()))
            if joint.type == "universal":
                yield self._cross(joint)
            if joint.name in drivers:
                yield self._driven(joint.facts.driven, drivers[joint.name], e, f, apart)

    def _world(self) -> list[np.ndarray]:
        return [self._axis(-1, i) for i in range(3)]

    def _distance(self, joint: Any) -> Row:
        start, stop = (
            self.point(b, a) for b, a in zip(self.indices(joint.bodies), joint.anchors, strict=True)
        )
        arm = self.lengths(joint.anchors[1]) - self.lengths(joint.anchors[0])
        square = (arm * arm).sum()
        scale = 0.5 / float(np.sqrt(float(square)))
        return Row(scale * (stop - start), stop - start, scale * square)

    def _cross(self, joint: Any) -> Row:
        a, b = (self._unit(self.arithmetic.array(axis)) for axis in joint.axes)
        first, second = self.indices(joint.bodies)
        return Row(self.direction(first, a), self.direction(second, b), (a * b).sum())

    def _driven(
        self, kind: Any, driver: Driver, e: Sequence[np.ndarray], f: Sequence[np.ndarray], apart: np.ndarray
    ) -> Row:
        """Return the row of a driven displacement, or of a driven angle ψ: the first axis on the second body
        is perpendicular to cos ψ e₂ - sin ψ e₁."""
        if kind == DISPLACEMENT:
            return Row(e[2], apart, 0.0, driver)
        return Row(e[1], f[0], 0.0, driver, -1 * e[0])

    def _mass(self) -> np.ndarray:
        """Return M (4 nb, 4 nb) such that ½ Σ Ẋ M Ẋᵀ is the kinetic energy: mass and ½ tr(J) 1 - J of each
        body.

        Bodies without mass have unit masses and inertias, which have no influence if the drivers determine
        the motion.
        """
        mass = self.arithmetic.zeros(4 * self.nb, 4 * self.nb)
        for b, body in enumerate(self.scene.body):
            axes = slice(4 * b + 1, 4 * b + 4)
            given = self.arithmetic.array(body.inertia if self.scene.has_mass() else (1.0, 1.0, 1.0))
            inertia = given * self.arithmetic.array(EYE) if given.ndim == 1 else (given + given.T) / 2
            mass[4 * b, 4 * b] = self.arithmetic.number(body.mass if self.scene.has_mass() else 1.0)
            if self.scene.has_mass():
                inertia = inertia / self.length**2
            mass[axes, axes] = np.trace(inertia) / 2 * EYE - inertia
        return mass


def skew(v: np.ndarray) -> np.ndarray:
    """Return the matrix (3, 3) of the vector product with v (3,)."""
    zero = 0 * v[0]
    return np.array([[zero, -v[2], v[1]], [v[2], zero, -v[0]], [-v[1], v[0], zero]])


def axial(matrices: np.ndarray) -> np.ndarray:
    """Return the vectors (…, 3) of the skew parts of matrices (…, 3, 3)."""
    a = matrices
    parts = [a[..., 2, 1] - a[..., 1, 2], a[..., 0, 2] - a[..., 2, 0], a[..., 1, 0] - a[..., 0, 1]]
    return np.stack(parts, axis=-1) / 2


def quaternions(a: np.ndarray) -> np.ndarray:
    """Return unit quaternions (…, 4) of rotation matrices (…, 3, 3): the largest column of 4 q qᵀ,
    normalised."""
    x, y, z = np.moveaxis(2 * axial(a), -1, 0)
    xx, yy, zz = (a[..., i, i] for i in range(3))
    xy, yz, zx = (a[..., i, j] + a[..., j, i] for i, j in ((0, 1), (1, 2), (2, 0)))
    columns = [
        [1 + xx + yy + zz, x, y, z],
        [x, 1 + xx - yy - zz, xy, zx],
        [y, xy, 1 - xx + yy - zz, yz],
        [z, zx, yz, 1 - xx - yy + zz],
    ]
    q = np.stack([np.stack(column, axis=-1) for column in columns], axis=-2)
    best = doubles(np.diagonal(q, axis1=-2, axis2=-1)).argmax(axis=-1)
    q = np.take_along_axis(q, best[..., None, None], axis=-2)[..., 0, :]
    return q / np.sqrt((q * q).sum(axis=-1, keepdims=True))
