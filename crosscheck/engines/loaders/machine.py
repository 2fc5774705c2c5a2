"""The machine that a file describes or an engine built, in one neutral form.

All vectors are in world axes at the reference pose, in which every joint coordinate has its reference value.
Units are SI and rad. None stands for a quantity that the format does not state or the library does not have.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

WORLD = "world"
FIXED, REVOLUTE, TRANSLATIONAL = "fixed", "revolute", "translational"
SCALAR = (REVOLUTE, TRANSLATIONAL)  # joints with one coordinate that turns or slides
UNLIMITED_IN_SDF = 1e16  # rad or m; the limit that SDF gives an axis without limits
Vector = tuple[float, ...]
Matrix = tuple[Vector, ...]


@dataclass(frozen=True)
class Body:
    """A rigid body: mass, centre of mass (3,), inertia (3, 3) about the centre of mass."""

    name: str
    mass: float | None = None
    centre: Vector | None = None
    inertia: Matrix | None = None


@dataclass(frozen=True)
class Joint:
    """A joint of the tree, which lets the second of two bodies move relative to the first.

    ``axis`` (3,) is the motion per unit of the coordinate: the rotation vector (rad) or the displacement (m).
    A planar joint has its normal, a joint without one axis None. ``damping`` and ``stiffness`` are
    coefficients of rising powers of the rate and of the displacement from ``rest``. ``reference`` is the
    coordinate's value at the reference pose.
    """

    name: str
    type: str
    bodies: tuple[str, str]
    anchor: Vector | None = None
    axis: Vector | None = None
    lower: float | None = None
    upper: float | None = None
    damping: Vector | None = None
    stiffness: Vector | None = None
    rest: float | None = None
    armature: float | None = None
    friction: float | None = None
    reference: float | None = None
    pitch: float | None = None  # displacement of a screw per turn, m


@dataclass(frozen=True)
class Loop:
    """A constraint between two bodies of the tree; anchors and axis are at the reference pose."""

    name: str
    type: str
    bodies: tuple[str, str]
    anchors: tuple[Vector, Vector] | None = None
    axis: Vector | None = None


@dataclass(frozen=True)
class Coupling:
    """A follower whose displacement from the reference is Σ coefficients[k] · (the leader's)^k, and factor ·
    displacement for each pair (joint, factor) of ``others``."""

    name: str
    follower: str
    leader: str
    coefficients: Vector
    others: tuple[tuple[str, float], ...] = ()

    def value(self, pose: Mapping[str, float]) -> float:
        """Return the follower's displacement at the displacements of other joints."""
        found = sum(c * pose.get(self.leader, 0.0) ** k for k, c in enumerate(self.coefficients))
        return float(found + sum(factor * pose.get(name, 0.0) for name, factor in self.others))

    def slopes(self, pose: Mapping[str, float]) -> dict[str, float]:
        """Return the derivative of the follower's displacement by each of the leaders'."""
        at = pose.get(self.leader, 0.0)
        slope = sum(k * c * at ** (k - 1) for k, c in enumerate(self.coefficients) if k)
        return ({self.leader: float(slope)} if self.leader else {}) | dict(self.others)


@dataclass(frozen=True)
class Machine:
    """Bodies without the world, joints of the tree, loops, couplings and gravity (3,), with messages."""

    bodies: tuple[Body, ...] = ()
    joints: tuple[Joint, ...] = ()
    loops: tuple[Loop, ...] | None = ()
    couplings: tuple[Coupling, ...] | None = ()
    gravity: Vector | None = None
    messages: tuple[str, ...] = field(default=(), compare=False)


@dataclass(frozen=True)
class Statics:
    """Mass matrix (n, n) and gravity torques (n,) of joints with one coordinate, and centres of mass (3,).

    The loops of the tree are open. ``mass`` and ``gravity`` are None for a library without dynamics.
    """

    joints: tuple[str, ...]
    mass: Matrix | None
    gravity: Vector | None
    centres: dict[str, Vector]


@dataclass(frozen=True)
class Rows:
    """Constraint Jacobian (m, n) of loops and couplings: each row times the rates of ``joints`` is zero."""

    joints: tuple[str, ...]
    matrix: Matrix

    def of(self, names: Sequence[str]) -> np.ndarray:
        """Return the columns (m, k) of joints; a joint without column has zeros."""
        found = np.zeros((len(self.matrix), len(names)))
        for k, name in enumerate(names):
            if name in self.joints:
                found[:, k] = [row[self.joints.index(name)] for row in self.matrix]
        return found


def vector(values: Iterable[Any]) -> Vector:
    """Return numbers as a tuple of floats."""
    return tuple(float(value) for value in values)


def matrix(rows: Iterable[Iterable[Any]]) -> Matrix:
    """Return rows of numbers as tuples of floats."""
    return tuple(vector(row) for row in rows)


def coefficients(*values: Any) -> Vector:
    """Return the coefficients of rising powers without zeros at the end."""
    found = [float(value) for value in values]
    while found and not found[-1]:
        found.pop()
    return tuple(found)


def limits(lower: Any, upper: Any, none_above: float = math.inf) -> dict[str, Any]:
    """Return the fields of limits; ends of at least ``none_above`` in size are no limit."""
    ends = float(lower), float(upper)
    low, high = (e if abs(e) < none_above else math.copysign(math.inf, e) for e in ends)
    return {"lower": low, "upper": high}
