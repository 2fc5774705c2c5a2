"""Joints as data: the fields of every joint type, and its facts, from which all tables of joint types
follow."""

from __future__ import annotations

import math
from typing import Annotated, Literal, get_args

from pydantic import Discriminator, field_validator

from mbref.scene.fields import PointPair, RotorInertia, RotorMass, VectorPair, VectorValue, direction
from mbref.scene.joint_facts import (
    ANGLE,
    DISPLACEMENT,
    AnchorJoint,
    AxisJoint,
    Coordinate,
    JointEntry,
    JointFacts,
    X,
    Y,
    Z,
)
from mbref.scene.rolling import Rolling, RollingLine
from mbref.scene.stops import Stop

__all__ = [
    "ANGLE",
    "DISPLACEMENT",
    "HOLONOMIC_JOINTS",
    "JOINT_TYPES",
    "Coordinate",
    "Joint",
    "JointEntry",
    "JointFacts",
    "X",
    "Y",
    "Z",
]

SKEW = 0.05  # largest cosine between the axes of a universal joint that counts as a rounded right angle
RIGHT_ANGLE = 1e-15  # largest cosine between axes that are perpendicular up to rounding


class _TurningJoint(AxisJoint):
    armature: RotorInertia = 0.0  # kg m², of the driven angle q: the kinetic energy ½ armature q'²
    stop: Stop | None = None

    @property
    def reflected_inertia(self) -> float:
        return self.armature

    @property
    def end_stop(self) -> Stop | None:
        return self.stop


class Fixed(AnchorJoint):
    """Joint that forbids all relative motion."""

    facts = JointFacts(forbidden_translations=(X, Y, Z), forbidden_rotations=(X, Y, Z))
    type: Literal["fixed"] = "fixed"


class Revolute(_TurningJoint):
    """Rotation about ``axis`` through ``anchor``; ``armature`` is the reflected inertia of a rotor."""

    facts = JointFacts((X, Y, Z), (X, Y), driven="angle", loaded=(ANGLE,))
    type: Literal["revolute"] = "revolute"


class Universal(AnchorJoint):
    """Coincident ``anchor``; ``axes`` (first on the first body, second on the second) stay perpendicular."""

    facts = JointFacts((X, Y, Z), condition="perpendicular axes")
    type: Literal["universal"] = "universal"
    axes: VectorPair

    @field_validator("axes")
    @classmethod
    def _axes_are_perpendicular(cls, axes: tuple[VectorValue, VectorValue]) -> tuple[VectorValue, ...]:
        """Return the first axis, and the part of the second that is perpendicular to it."""
        lengths = [math.hypot(*direction(axis)) for axis in axes]
        cosine = sum(a / lengths[0] * (b / lengths[1]) for a, b in zip(*axes, strict=True))
        if abs(cosine) > SKEW:
            angle = math.degrees(math.acos(max(-1.0, min(1.0, cosine))))
            raise ValueError(f"must be perpendicular, but enclose {angle:.3g} degrees")
        if abs(cosine) <= RIGHT_ANGLE:
            return axes
        first, second = axes
        along = cosine * lengths[1] / lengths[0]
        return first, (
            second[0] - along * first[0],
            second[1] - along * first[1],
            second[2] - along * first[2],
        )

    @property
    def directions(self) -> tuple[VectorValue, ...]:
        return self.axes


class Spherical(AnchorJoint):
    """Joint with coincident ``anchor`` and free rotation."""

    facts = JointFacts(forbidden_translations=(X, Y, Z))
    type: Literal["spherical"] = "spherical"


class Translational(AxisJoint):
    """Displacement along ``axis``, no rotation; ``armature`` is the reflected mass of a motor."""

    facts = JointFacts((X, Y), (X, Y, Z), driven="displacement", loaded=(DISPLACEMENT,))
    type: Literal["translational"] = "translational"
    armature: RotorMass = 0.0
    stop: Stop | None = None

    @property
    def reflected_inertia(self) -> float:
        return self.armature

    @property
    def end_stop(self) -> Stop | None:
        return self.stop


class Cylindrical(_TurningJoint):
    """Displacement along and rotation about ``axis``; ``armature`` is of the rotation."""

    facts = JointFacts((X, Y), (X, Y), driven="angle", loaded=(ANGLE, DISPLACEMENT))
    type: Literal["cylindrical"] = "cylindrical"


class Planar(AxisJoint):
    """Displacement in the plane through ``anchor`` with normal ``axis``, and rotation about the normal."""

    facts = JointFacts((Z,), (X, Y), driven="angle")
    type: Literal["planar"] = "planar"


class Inline(AxisJoint):
    """A point of the second body, ``anchor``, stays on the line along ``axis`` of the first body."""

    facts = JointFacts(forbidden_translations=(X, Y))
    type: Literal["inline"] = "inline"


class Free(AxisJoint):
    """No constraint: a driver, a load or a coupling acts on the displacement of the second body's ``anchor``
    along ``axis`` of the first body."""

    facts = JointFacts(driven="displacement", loaded=(DISPLACEMENT,))
    type: Literal["free"] = "free"


class Distance(JointEntry):
    """Constant distance between two ``anchors`` (first on the first body, second on the second)."""

    facts = JointFacts(condition="constant distance")
    type: Literal["distance"] = "distance"
    anchors: PointPair

    @field_validator("anchors")
    @classmethod
    def _anchors_are_apart(cls, anchors: tuple[VectorValue, VectorValue]) -> tuple[VectorValue, VectorValue]:
        if math.dist(*anchors) == 0:
            raise ValueError("must be two different points (for coincident points use a spherical joint)")
        return anchors

    @property
    def anchor_pair(self) -> tuple[VectorValue, VectorValue]:
        return self.anchors


Joint = Annotated[
    Fixed
    | Revolute
    | Universal
    | Spherical
    | Translational
    | Cylindrical
    | Planar
    | Inline
    | Free
    | Rolling
    | RollingLine
    | Distance,
    Discriminator("type"),
]
JOINT_TYPES: dict[str, type[Joint]] = {
    joint.model_fields["type"].default: joint for joint in get_args(get_args(Joint)[0])
}
# joint types all of whose equations restrict positions
HOLONOMIC_JOINTS = {kind: joint for kind, joint in JOINT_TYPES.items() if not joint.facts.velocity_rows}
