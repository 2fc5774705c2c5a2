"""Moving links in any arithmetic: position, rotation, velocities, and accelerations for q̈ = 0."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np

from crosscheck.engines.shared.spanning_tree import TURN
from crosscheck.engines.shared.symbolic.symbols import NOTHING, Arithmetic

Vector: TypeAlias = np.ndarray  # (3,) numbers or symbols


@dataclass(frozen=True)
class Turned:
    """Successive turns about one axis: the rotation before them, the axis, and the sum of their angles."""

    before: np.ndarray
    axis: np.ndarray
    angle: Any

    def further(self, axis: np.ndarray, angle: Any) -> Turned | None:
        """Return this object with another turn about an equal axis added; None if the axis differs."""
        along = float(axis @ self.axis)
        if abs(along) < 1 - NOTHING:
            return None
        return Turned(self.before, self.axis, self.angle + math.copysign(1.0, along) * angle)


@dataclass
class Frame:
    """A moving link: the point of the link that was at ``reference`` at t = 0 is at ``origin``, and the link
    is rotated by ``rotation``.

    ``columns`` lists the coordinates that move the link: index, whether the coordinate is a turn, axis, and a
    point of the axis. The accelerations hold for q̈ = 0.
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
        """Return the vector from the origin to a point of the link, given by its position (3,) at t = 0."""
        return self.rotation @ (point - self.reference)

    def moved(self, arm: Vector, reference: np.ndarray) -> Frame:
        """Return the link with another origin."""
        turned = cross(self.spin, arm)
        return Frame(
            reference,
            self.origin + arm,
            self.rotation,
            self.velocity + turned,
            self.spin,
            self.acceleration + cross(self.spin_rate, arm) + cross(self.spin, turned),
            self.spin_rate,
            list(self.columns),
            self.turned,
        )


def cross(a: Vector, b: Vector) -> Vector:
    """Return a × b, also for symbols, which `rotations.cross` does not accept."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def turn(axis: np.ndarray, angle: Any, arithmetic: Arithmetic) -> np.ndarray:
    """Return the rotation (3, 3) about a unit vector of numbers; entries that are constant are numbers."""
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    s, c, still = arithmetic.sin(angle), arithmetic.cos(angle), np.outer(axis, axis)
    entries = [
        _sum((still[i, j], 1.0), (float(i == j) - still[i, j], c), (k[i, j], s))
        for i in range(3)
        for j in range(3)
    ]
    return np.array(entries, dtype=object).reshape(3, 3)


def _sum(*terms: tuple[float, Any]) -> Any:
    return sum((float(factor) * value for factor, value in terms if factor != 0.0), 0.0)


def moved_by(
    frame: Frame, kind: str, axis: np.ndarray, place: int, state: tuple[Any, Any], arithmetic: Arithmetic
) -> Frame:
    """Return the frame after an elementary motion with coordinate and rate ``state``."""
    along, (q, v) = frame.rotation @ axis, state
    if kind == TURN:
        rate = cross(frame.spin, along) * v
        turned = frame.turned.further(axis, q) if frame.turned else None
        turned = turned or Turned(frame.rotation, axis, q)
        rotation = turned.before @ turn(turned.axis, turned.angle, arithmetic)
        return Frame(
            frame.reference,
            frame.origin,
            rotation,
            frame.velocity,
            frame.spin + along * v,
            frame.acceleration,
            frame.spin_rate + rate,
            [*frame.columns, (place, True, along, frame.origin)],
            turned,
        )
    slid = frame.moved(along * q, frame.reference)
    slid.velocity = slid.velocity + along * v
    slid.acceleration = slid.acceleration + 2.0 * cross(frame.spin, along) * v
    slid.columns.append((place, False, along, frame.origin))
    return slid


def velocity_of(frame: Frame, column: tuple[int, bool, Vector, Vector], point: Vector) -> Vector:
    """Return the velocity of a point of the link for the unit rate of one coordinate."""
    _, turns, axis, origin = column
    return cross(axis, point - origin) if turns else axis
