"""Equations of motion in joint coordinates, in any arithmetic: numbers, or symbols of a code generator.

The mechanism is a spanning tree of slides and turns (`crosscheck.engines.spanning_tree`) whose loops are
closed by points:

    M q̈ + Gᵀ λ = f,    G q̈ = γ - 2 β G q' - β² Φ

with accelerations by the Schur complement G M⁻¹ Gᵀ, as somebody who generates code for one mechanism would
write them.  Rows of G that vanish everywhere (of a planar mechanism) are left out, and entries that are zero
everywhere cost nothing where the arithmetic drops products with zero.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from crosscheck.engines.initial_velocities import initial_rates
from crosscheck.engines.planar_scene import planar_scene
from crosscheck.engines.spanning_tree import GROUND_LINK, SLIDE, TURN, spanning_tree
from mbref import rotations
from mbref.scene import Moment, Scene

Vector = np.ndarray  # (3,) of numbers or symbols
SEED, NOTHING = 1, 1e-12  # of the pose at which rows that vanish are found; an entry that is rounding


@dataclass(frozen=True)
class Arithmetic:
    """The functions of the numbers or symbols."""

    sin: Callable[[Any], Any]
    cos: Callable[[Any], Any]


NUMBERS = Arithmetic(math.sin, math.cos)


class Symbol:
    """A symbol of a code generator as an entry of arrays; sums with zero and products with zero or one add no
    operation."""

    def __init__(self, value: Any):
        self.value = value

    def __add__(self, other: Any) -> Any:
        return self if _is(other, 0) else Symbol(self.value + _bare(other))

    def __mul__(self, other: Any) -> Any:
        if _is(other, 0):
            return 0.0
        return self if _is(other, 1) else Symbol(self.value * _bare(other))

    def __sub__(self, other: Any) -> Any:
        return self if _is(other, 0) else Symbol(self.value - _bare(other))

    def __rsub__(self, other: Any) -> Any:
        return Symbol(-self.value) if _is(other, 0) else Symbol(_bare(other) - self.value)

    def __truediv__(self, other: Any) -> Any:
        return self if _is(other, 1) else Symbol(self.value / _bare(other))

    def __rtruediv__(self, other: Any) -> Any:
        return 0.0 if _is(other, 0) else Symbol(_bare(other) / self.value)

    def __neg__(self) -> Any:
        return Symbol(-self.value)

    __radd__, __rmul__ = __add__, __mul__


def _is(number: Any, constant: float) -> bool:
    return not isinstance(number, Symbol) and number == constant


def _bare(number: Any) -> Any:
    return number.value if isinstance(number, Symbol) else float(number)


def symbolic(sin: Callable[[Any], Any], cos: Callable[[Any], Any]) -> Arithmetic:
    """The arithmetic of a generator's symbols, as entries of arrays."""
    return Arithmetic(lambda x: Symbol(sin(x.value)), lambda x: Symbol(cos(x.value)))


def bare(entries: Sequence[Any]) -> list[Any]:
    """The generator's own symbols, or numbers, of the entries."""
    return [_bare(entry) for entry in entries]


@dataclass(frozen=True)
class Turned:
    """The last turns about one axis: the rotation before them, the axis, and the sum of their angles."""

    before: np.ndarray
    axis: np.ndarray
    angle: Any

    def further(self, axis: np.ndarray, angle: Any) -> Turned | None:
        """With another turn about the same axis; None where that is another one."""
        along = float(axis @ self.axis)
        if abs(along) < 1 - NOTHING:
            return None
        return Turned(self.before, self.axis, self.angle + math.copysign(1.0, along) * angle)


@dataclass
class Frame:
    """A link in motion: the point that was at ``reference`` is at ``origin``, turned by ``rotation``.

    ``columns`` are the coordinates that move it: place, whether it turns, axis, and a point of the axis.
    The accelerations are those of q̈ = 0.
    """

    reference: np.ndarray
    origin: Vector
    rotation: np.ndarray
    velocity: Vector
    spin: Vector
    acceleration: Vector
    spin_rate: Vector
    columns: list[tuple[int, bool, Vector, Vector]] = field(default_factory=list)
    turned: Turned | None = None

    def arm(self, point: np.ndarray) -> Vector:
        """From the origin to a point of the link, given by its place (3,) at t = 0."""
        return self.rotation @ (point - self.reference)

    def moved(self, arm: Vector, reference: np.ndarray) -> Frame:
        """The same link with another origin."""
        turned = cross(self.spin, arm)
        return Frame(
            reference, self.origin + arm, self.rotation, self.velocity + turned, self.spin,
            self.acceleration + cross(self.spin_rate, arm) + cross(self.spin, turned), self.spin_rate,
            list(self.columns), self.turned,
        )  # fmt: skip


def cross(a: Vector, b: Vector) -> Vector:
    """a × b of symbols too, which `rotations.cross` does not take."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def turn(axis: np.ndarray, angle: Any, arithmetic: Arithmetic) -> np.ndarray:
    """The rotation (3, 3) about a unit vector of numbers; entries that never change are numbers."""
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    s, c, still = arithmetic.sin(angle), arithmetic.cos(angle), np.outer(axis, axis)
    entries = [
        _sum((still[i, j], 1.0), (float(i == j) - still[i, j], c), (k[i, j], s))
        for i in range(3) for j in range(3)
    ]  # fmt: skip
    return np.array(entries, dtype=object).reshape(3, 3)


def _sum(*terms: tuple[float, Any]) -> Any:
    return sum((float(factor) * value for factor, value in terms if factor != 0.0), 0.0)


class TreeEquations:
    """The equations of a scene; raises ValueError where it has other parts than slides, turns and moments."""

    def __init__(self, scene: Scene):
        self.scene = planar_scene(scene)
        self.tree = spanning_tree(self.scene)
        kinds = {mobility.kind for link in self.tree.links for mobility in link.mobilities}
        if kinds - {SLIDE, TURN} or any(closure.kind != "point" for closure in self.tree.closures):
            raise ValueError("its tree has free or ball joints, or loops that points do not close")
        if scene.driver or any(not isinstance(load, Moment) for load in scene.load):
            raise ValueError("it has drivers, or loads other than moments")
        self.n = self.tree.nv
        self.start = np.concatenate((np.zeros(self.n), initial_rates(self.scene, self.tree)))
        self.rows = self._rows_that_matter()

    def accelerations(self, q: Sequence[Any], v: Sequence[Any], arithmetic: Arithmetic, beta: float) -> Any:
        """q̈ (n,) of coordinates and rates (n,); ``beta`` (1/s) is the double root of the closure errors."""
        frames = self.frames(q, v, arithmetic)
        mass, force = self._inertia(frames)
        violation, jacobian, bias = self._closures(frames)
        if not self.rows:
            return solved(mass, force)
        rate = jacobian @ np.array(v, dtype=object)
        gamma = -bias - (2 * beta) * rate - beta**2 * violation if beta else -bias
        columns = np.column_stack([solved(mass, column) for column in (force, *jacobian)])
        free, along = columns[:, 0], columns[:, 1:]
        return free + along @ solved(jacobian @ along, gamma - jacobian @ free)

    def settled(self, q: Sequence[Any], v: Sequence[Any], arithmetic: Arithmetic) -> tuple[Any, Any]:
        """Coordinates and rates after one mass-orthogonal Newton step onto the closures."""
        q, v = np.array(q, dtype=object), np.array(v, dtype=object)
        frames = self.frames(q, v, arithmetic)
        mass, _ = self._inertia(frames)
        violation, jacobian, _ = self._closures(frames)
        if not self.rows:
            return q, v
        along = np.column_stack([solved(mass, row) for row in jacobian])
        schur = jacobian @ along
        return q - along @ solved(schur, violation), v - along @ solved(schur, jacobian @ v)

    def frames(self, q: Sequence[Any], v: Sequence[Any], arithmetic: Arithmetic) -> list[Frame]:
        """The links in motion, their origins at ``position``."""
        zero = np.zeros(3, dtype=object)
        ground = Frame(np.zeros(3), zero, np.eye(3).astype(object), zero, zero, zero, zero)
        anchored: list[Frame] = []  # with the origin at the anchor of the link's own joint
        for link, first in zip(self.tree.links, self.tree.starts, strict=True):
            parent = ground if link.parent == GROUND_LINK else anchored[link.parent]
            frame = parent.moved(parent.arm(link.anchor), link.anchor)
            for i, mobility in enumerate(link.mobilities, first):
                frame = _moved_by(frame, mobility.kind, mobility.axis, i, (q[i], v[i]), arithmetic)
            anchored.append(frame)
        pairs = zip(self.tree.links, anchored, strict=True)
        return [frame.moved(frame.arm(link.position), link.position) for link, frame in pairs]

    def _inertia(self, frames: Sequence[Frame]) -> tuple[np.ndarray, np.ndarray]:
        """M (n, n) and f (n,) with gravity and moments."""
        mass, force = _zeros(self.n, self.n), _zeros(self.n)
        gravity = np.array(self.scene.gravity, dtype=float)
        for k, (link, at_link) in enumerate(zip(self.tree.links, frames, strict=True)):
            frame = at_link.moved(at_link.arm(link.position + link.offset), link.position + link.offset)
            turned = frame.rotation.T
            spin, spin_rate = turned @ frame.spin, turned @ frame.spin_rate
            moment = turned @ self._moment(k) - link.inertia @ spin_rate - cross(spin, link.inertia @ spin)
            push = link.mass * (gravity - frame.acceleration)
            columns = []
            for column in frame.columns:
                i, turns, axis, _ = column
                spun = turned @ axis if turns else np.zeros(3)
                columns.append((i, _at(frame, column, frame.origin), spun))
            for i, linear, angular in columns:
                force[i] += linear @ push + angular @ moment
                for j, other, spun in columns:
                    mass[i, j] += link.mass * (linear @ other) + angular @ (link.inertia @ spun)
        return mass, force

    def _closures(self, frames: Sequence[Frame]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Φ (m,), G (m, n) and the accelerations (m,) of the closures for q̈ = 0, on rows that matter."""
        violations, jacobians, biases = [_zeros(0)], [_zeros(0, self.n)], [_zeros(0)]
        for closure in self.tree.closures:
            ends = []
            for k in closure.links:
                if k != GROUND_LINK:
                    ends.append(frames[k].moved(frames[k].arm(closure.anchor), closure.anchor))
            jacobian = _zeros(3, self.n)
            for end, sign in zip(ends, (1.0, -1.0), strict=False):
                for column in end.columns:
                    jacobian[:, column[0]] += sign * _at(end, column, end.origin)
            one = ends[1] if len(ends) > 1 else None
            violations.append(ends[0].origin - (closure.anchor if one is None else one.origin))
            biases.append(ends[0].acceleration - (0.0 if one is None else one.acceleration))
            jacobians.append(jacobian)
        found = (np.concatenate(parts) for parts in (violations, jacobians, biases))
        violation, jacobian, bias = (part[self.rows] for part in found)
        return violation, jacobian, bias

    def _rows_that_matter(self) -> list[int]:
        self.rows = list(range(3 * len(self.tree.closures)))
        pose = np.random.default_rng(SEED).uniform(-1, 1, self.n)
        _, jacobian, _ = self._closures(self.frames(pose, np.zeros(self.n), NUMBERS))
        return [i for i in self.rows if np.abs(jacobian[i].astype(float)).max() > NOTHING]

    def _moment(self, k: int) -> np.ndarray:
        loads = [load for load in self.scene.load if self.tree.own[self.scene.body_index(load.body)] == k]
        return sum((np.array(load.moment, dtype=float) for load in loads), np.zeros(3))

    def motion(self, y: np.ndarray) -> dict[str, np.ndarray]:
        """Poses and velocities of the scene's bodies at states (k, 2 n), as a Trajectory names them."""
        found: dict[str, list[Any]] = {
            "position": [],
            "orientation": [],
            "velocity": [],
            "angular_velocity": [],
        }
        start = np.array([rotations.to_matrix(np.array(b.orientation, dtype=float)) for b in self.scene.body])
        for state in y:
            frames = self.frames(state[: self.n], state[self.n :], NUMBERS)
            own = [frames[k] for k in self.tree.own]
            turned = np.array([f.rotation for f in own], dtype=float) @ start
            found["position"].append([f.origin for f in own])
            found["orientation"].append(rotations.from_matrix(turned))
            found["velocity"].append([f.velocity for f in own])
            found["angular_velocity"].append([f.spin for f in own])
        width = len(self.scene.body)
        return {
            name: np.array(values, dtype=float).reshape(len(y), width, -1) for name, values in found.items()
        }


def _moved_by(
    frame: Frame, kind: str, axis: np.ndarray, place: int, state: tuple[Any, Any], arithmetic: Arithmetic
) -> Frame:
    """The frame after an elementary motion of coordinate and rate ``state``."""
    along, (q, v) = frame.rotation @ axis, state
    if kind == TURN:
        rate = cross(frame.spin, along) * v
        turned = frame.turned.further(axis, q) if frame.turned else None
        turned = turned or Turned(frame.rotation, axis, q)
        rotation = turned.before @ turn(turned.axis, turned.angle, arithmetic)
        return Frame(
            frame.reference, frame.origin, rotation, frame.velocity, frame.spin + along * v,
            frame.acceleration, frame.spin_rate + rate, [*frame.columns, (place, True, along, frame.origin)],
            turned,
        )  # fmt: skip
    slid = frame.moved(along * q, frame.reference)
    slid.velocity = slid.velocity + along * v
    slid.acceleration = slid.acceleration + 2.0 * cross(frame.spin, along) * v
    slid.columns.append((place, False, along, frame.origin))
    return slid


def _at(frame: Frame, column: tuple[int, bool, Vector, Vector], point: Vector) -> Vector:
    """The velocity of a point of the link by one coordinate's rate."""
    _, turns, axis, origin = column
    return cross(axis, point - origin) if turns else axis


def _zeros(*shape: int) -> np.ndarray:
    return np.zeros(shape, dtype=object)


def solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The solution (n,) of a symmetric positive definite system by L D Lᵀ without pivoting."""
    n = len(right)
    lower, d, x = _zeros(n, n), _zeros(n), np.array(right, dtype=object)
    for j in range(n):
        d[j] = matrix[j, j] - sum((lower[j, k] * lower[j, k] * d[k] for k in range(j)), 0.0)
        for i in range(j + 1, n):
            lower[i, j] = (matrix[i, j] - sum((lower[i, k] * lower[j, k] * d[k] for k in range(j)), 0.0)) / d[
                j
            ]
    for i in range(n):
        x[i] = x[i] - sum((lower[i, k] * x[k] for k in range(i)), 0.0)
    x = x / d
    for i in reversed(range(n)):
        x[i] = x[i] - sum((lower[k, i] * x[k] for k in range(i + 1, n)), 0.0)
    return x
