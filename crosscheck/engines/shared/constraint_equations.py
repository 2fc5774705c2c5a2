"""Constraint equations of a scene as products of body-fixed vectors, with their rates and Jacobian.

Every joint is written with rows of three kinds, polynomials in positions and rotation matrices:

- direction: u · w = 0, of a direction u on the first body and w on the second;
- point: u · d = c(t), of the vector d between the anchors;
- length: (d · d - l²) / 2l = 0.

A driven angle ψ(t) turns u in its body: u = cos ψ e₁ + sin ψ e₂.  Rates follow from A' = A ω̃', with ω' in
body axes.  Vectors are columns (…, 3, 1) with any leading shape; the ground is the last body.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from crosscheck.engines.shared.driver_motion import motion
from crosscheck.engines.shared.geometry import cross_matrix, in_body, joint_frame, point_in_body
from mbref import rotations
from mbref.rotations import unit
from mbref.scene import Driver, Joint, Scene

O = np.zeros(3)
TILDE = np.array([cross_matrix(e) for e in np.eye(3)])
# axes of the first and second frame that stay perpendicular if a rotation is forbidden
ACROSS = ((1, 2), (0, 2), (0, 1))
Levels = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Frames:
    """Bodies (…, nb + 1, 3, ·): position r, rotation matrix A, velocity v, and A', A'' at constant ω'."""

    r: np.ndarray
    a: np.ndarray
    v: np.ndarray
    a1: np.ndarray
    a2: np.ndarray


def frames(r: np.ndarray, p: np.ndarray, v: np.ndarray, omega: np.ndarray) -> Frames:
    """Return the frames of bodies with positions and velocities (…, nb, 3), Euler parameters p (…, nb, 4) of
    any length, and angular velocities ``omega`` (…, nb, 3) in body axes."""
    a = rotations.to_matrix(p / np.sqrt(np.sum(p * p, axis=-1, keepdims=True)))
    tilde = np.tensordot(omega, TILDE, 1)
    a, tilde = _grounded(a, np.eye(3)), _grounded(tilde, np.zeros((3, 3)))
    a1 = a @ tilde
    ground = O[:, None]
    return Frames(_grounded(r[..., None], ground), a, _grounded(v[..., None], ground), a1, a1 @ tilde)


def _grounded(array: np.ndarray, ground: np.ndarray) -> np.ndarray:
    """Return the bodies' array (…, nb, 3, k) with the ground's entry appended."""
    last = np.broadcast_to(ground, (*array.shape[:-3], 1, *ground.shape))
    return np.concatenate([array, last], axis=-3)


@dataclass(frozen=True)
class _Row:
    """A row: index of its joint, bodies, anchors on them, e₁ and e₂ on the first body, w on the second."""

    kind: str
    joint: int
    bodies: tuple[int, int]
    points: np.ndarray
    e1: np.ndarray
    e2: np.ndarray
    w: np.ndarray
    length: float
    driver: Driver | None


def _rows(scene: Scene, k: int, joint: Joint, driver: Driver | None) -> list[_Row]:
    """Return the rows of joint k, the rows of its driver last."""
    facts, anchors = joint.facts, joint.anchor_pair
    points = np.array([point_in_body(scene, *end) for end in zip(joint.bodies, anchors, strict=True)])
    indices = (scene.body_index(joint.bodies[0]), scene.body_index(joint.bodies[1]))
    length = float(np.linalg.norm(np.subtract(*anchors)))
    blank = _Row("length", k, indices, points, O, O, O, length, None)
    if facts.condition == "constant distance":
        return [blank]
    frame = joint_frame(joint.directions[0]) if len(joint.directions) == 1 else np.eye(3)
    e, f = (in_body(scene, name, frame.T) for name in joint.bodies)
    rows = [replace(blank, kind="point", e1=e[n]) for n in facts.forbidden_translations]
    pairs = [(e[a], f[b]) for a, b in (ACROSS[n] for n in facts.forbidden_rotations)]
    if facts.condition == "perpendicular axes":
        first, second = (unit(axis) for axis in joint.directions)
        pairs = [(in_body(scene, joint.bodies[0], first), in_body(scene, joint.bodies[1], second))]
    rows += [replace(blank, kind="direction", e1=u, w=w) for u, w in pairs]
    if driver and facts.driven == "displacement":
        rows.append(replace(blank, kind="point", e1=e[2], driver=driver))
    elif driver:
        rows.append(replace(blank, kind="direction", e1=e[1], e2=-e[0], w=f[0], driver=driver))
    return rows


class Constraints:
    """All m rows of a scene; ``joint`` (m,) is the index of each row's joint."""

    def __init__(self, scene: Scene):
        drivers = {driver.joint: driver for driver in scene.driver}
        rows = [r for k, j in enumerate(scene.joint) for r in _rows(scene, k, j, drivers.get(j.name))]
        of_kind = {kind: [row for row in rows if row.kind == kind] for kind in GROUPS}
        self.groups = [GROUPS[kind](of) for kind, of in of_kind.items() if of]
        ordered = [row for of in of_kind.values() for row in of]
        self.joint = np.array([row.joint for row in ordered], dtype=int)
        self.bodies = np.array([row.bodies for row in ordered], dtype=int).reshape(-1, 2)
        self.nb = len(scene.body)

    def levels(self, t: float, f: Frames) -> np.ndarray:
        """Return (3, …, m): Φ, Φ', and Φ'' for zero accelerations, which is -γ."""
        none = np.zeros((3, *f.r.shape[:-3], 0))
        return np.concatenate([none, *(np.stack(group.levels(t, f)) for group in self.groups)], axis=-1)

    def jacobian(self, t: float, f: Frames) -> np.ndarray:
        """Return ∂Φ'/∂(v, ω') (…, m, 6 nb), body after body."""
        m = len(self.joint)
        matrix = np.zeros((*f.r.shape[:-3], m, self.nb + 1, 6))
        if m:
            sides = zip(*(group.blocks(t, f) for group in self.groups), strict=True)
            for side, blocks in enumerate(sides):
                matrix[..., np.arange(m), self.bodies[:, side], :] = np.concatenate(blocks, axis=-2)
        return matrix[..., : self.nb, :].reshape(*matrix.shape[:-2], 6 * self.nb)


class _Group:
    """Rows of one kind, packed as columns (rows, 3, 1)."""

    def __init__(self, rows: list[_Row]):
        self.i, self.j = np.array([row.bodies for row in rows]).T
        self.joint = np.array([row.joint for row in rows])
        self.si, self.sj = np.array([row.points for row in rows]).swapaxes(0, 1)[..., None]
        self.e1, self.e2, self.w = (
            np.array([getattr(row, name) for row in rows])[..., None] for name in ("e1", "e2", "w")
        )
        self.length = np.array([row.length for row in rows])
        self.drivers = [(k, row.driver) for k, row in enumerate(rows) if row.driver]

    def prescribed(self, t: float) -> np.ndarray:
        """Return (3, rows): value, rate and acceleration of each row's driver."""
        values = np.zeros((3, len(self.i)))
        for k, driver in self.drivers:
            values[:, k] = motion(driver, t)
        return values

    def gap(self, f: Frames) -> Levels:
        """Return the vector between the anchors (…, rows, 3, 1), its first and its second time derivative."""
        (pi, vi, ai), (pj, vj, aj) = self._end(f, self.i, self.si), self._end(f, self.j, self.sj)
        return pj - pi, vj - vi, aj - ai

    def _end(self, f: Frames, body: np.ndarray, s: np.ndarray) -> Levels:
        a, a1, a2 = _of(f, body)
        return f.r[..., body, :, :] + a @ s, f.v[..., body, :, :] + a1 @ s, a2 @ s


class _Direction(_Group):
    def turned(self, t: float) -> Levels:
        """Return u in body axes (rows, 3, 1), and its first and second time derivative in body axes."""
        if not self.drivers:
            return self.e1, 0 * self.e1, 0 * self.e1
        angle, rate, acceleration = self.prescribed(t)[..., None, None]
        c, s = np.cos(angle), np.sin(angle)
        u, across = c * self.e1 + s * self.e2, c * self.e2 - s * self.e1
        return u, rate * across, acceleration * across - rate**2 * u

    def levels(self, t: float, f: Frames) -> Levels:
        a, a1, a2 = _of(f, self.i)
        b, b1, b2 = _of(f, self.j)
        u, du, ddu = self.turned(t)
        w, w1, w2 = b @ self.w, b1 @ self.w, b2 @ self.w
        u, u1, u2 = a @ u, a1 @ u + a @ du, a2 @ u + 2 * a1 @ du + a @ ddu
        return _dot(u, w), _dot(u1, w) + _dot(u, w1), _dot(u2, w) + 2 * _dot(u1, w1) + _dot(u, w2)

    def blocks(self, t: float, f: Frames) -> tuple[np.ndarray, np.ndarray]:
        a, b = f.a[..., self.i, :, :], f.a[..., self.j, :, :]
        u, w = self.turned(t)[0], b @ self.w
        return _block(0 * w, _cross(u, _back(a, w))), _block(0 * w, _cross(self.w, _back(b, a @ u)))


class _Point(_Group):
    def levels(self, t: float, f: Frames) -> Levels:
        a, a1, a2 = _of(f, self.i)
        u, u1, u2 = a @ self.e1, a1 @ self.e1, a2 @ self.e1
        d, d1, d2 = self.gap(f)
        c, c1, c2 = self.prescribed(t)
        return (
            _dot(u, d) - c,
            _dot(u1, d) + _dot(u, d1) - c1,
            _dot(u2, d) + 2 * _dot(u1, d1) + _dot(u, d2) - c2,
        )

    def blocks(self, t: float, f: Frames) -> tuple[np.ndarray, np.ndarray]:
        a, b = f.a[..., self.i, :, :], f.a[..., self.j, :, :]
        u, (d, *_) = a @ self.e1, self.gap(f)
        first = _cross(self.e1, _back(a, d) + self.si)
        return _block(-u, first), _block(u, _cross(self.sj, _back(b, u)))


class _Length(_Group):
    def levels(self, t: float, f: Frames) -> Levels:
        d, d1, d2 = self.gap(f)
        l = self.length
        return (_dot(d, d) / l - l) / 2, _dot(d, d1) / l, (_dot(d1, d1) + _dot(d, d2)) / l

    def blocks(self, t: float, f: Frames) -> tuple[np.ndarray, np.ndarray]:
        a, b = f.a[..., self.i, :, :], f.a[..., self.j, :, :]
        u = self.gap(f)[0] / self.length[:, None, None]
        return _block(-u, _cross(self.si, _back(a, -u))), _block(u, _cross(self.sj, _back(b, u)))


GROUPS: dict[str, type] = {"direction": _Direction, "point": _Point, "length": _Length}


def _of(f: Frames, body: np.ndarray) -> Levels:
    return f.a[..., body, :, :], f.a1[..., body, :, :], f.a2[..., body, :, :]


def _dot(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the scalar products (…,) of columns (…, 3, 1)."""
    return np.sum(x * y, axis=(-2, -1))


def _back(a: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return columns in body axes from columns in world axes."""
    return np.swapaxes(a, -1, -2) @ x


def _cross(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return x[..., [1, 2, 0], :] * y[..., [2, 0, 1], :] - x[..., [2, 0, 1], :] * y[..., [1, 2, 0], :]


def _block(linear: np.ndarray, angular: np.ndarray) -> np.ndarray:
    """Return the parts (…, rows, 6) of the rows for one body."""
    return np.concatenate(np.broadcast_arrays(linear, angular), axis=-2)[..., 0]
