"""Joints as data: the fields of every joint type, and its facts, from which all tables of joint types
follow."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, Self, get_args

from pydantic import Discriminator, field_validator

from mbref.scene.fields import (
    Name,
    Pair,
    PointPair,
    PointValue,
    RotorInertia,
    RotorMass,
    VectorPair,
    VectorValue,
    direction,
)
from mbref.scene.intervals import Intermittent
from mbref.scene.stops import Stop

X, Y, Z = 0, 1, 2
SKEW = 0.05  # largest cosine between the axes of a universal joint that counts as a rounded right angle
RIGHT_ANGLE = 1e-15  # largest cosine between axes that are perpendicular up to rounding
Coordinate = Literal["angle", "displacement"]
ANGLE: Coordinate = "angle"
DISPLACEMENT: Coordinate = "displacement"
Condition = Literal["perpendicular axes", "constant distance"]


@dataclass(frozen=True)
class JointFacts:
    """Relative motion that a joint type forbids, and the drivers and loads that can act on the remaining
    motion.

    ``forbidden_translations`` and ``forbidden_rotations`` are components (0, 1, 2) of the second body's
    motion relative to the first, in the joint's frame on the first body; its third axis is along the joint's
    axis.  ``condition`` is one further equation: the axes of both bodies stay perpendicular, or the anchors
    keep their distance.  ``driven`` is the coordinate a driver prescribes: the angle about or the
    displacement along the axis, None for a joint that cannot be driven.  ``loaded`` are the coordinates along
    which springs, forces and torques of the joint can act.
    """

    forbidden_translations: tuple[int, ...] = ()
    forbidden_rotations: tuple[int, ...] = ()
    condition: Condition | None = None
    driven: Coordinate | None = None
    loaded: tuple[Coordinate, ...] = ()

    @property
    def rows(self) -> int:
        """Number of constraint rows without a driver."""
        return len(self.forbidden_translations) + len(self.forbidden_rotations) + bool(self.condition)

    @property
    def free_translations(self) -> int:
        """Number of free relative translations."""
        return 3 - len(self.forbidden_translations) - (self.condition == "constant distance")

    @property
    def free_rotations(self) -> int:
        """Number of free relative rotations."""
        return 3 - len(self.forbidden_rotations) - (self.condition == "perpendicular axes")

    @property
    def turns(self) -> bool:
        """True if the bodies can turn relative to each other about the joint's axis only."""
        return self.forbidden_rotations == (X, Y)

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """Joint coordinates that can be coupled: the angle about the axis, the displacement along it."""
        angle = (ANGLE,) if self.turns else ()
        slides = self.forbidden_translations == (X, Y) or self.driven == DISPLACEMENT
        return angle + ((DISPLACEMENT,) if slides else ())

    @property
    def main(self) -> Coordinate:
        """Coordinate that is meant where none is named; the angle where there is no coordinate."""
        return self.driven or (*self.coordinates, ANGLE)[0]


class JointEntry(Intermittent):
    """Fields and facts that all joints have."""

    facts: ClassVar[JointFacts]
    name: Name
    bodies: Pair

    @classmethod
    def at(cls, name: str, bodies: tuple[str, str], **places: Any) -> Self:
        """Return a joint of this type with the ``places`` (anchor, anchors, axis, axes) that the type
        needs."""
        return cls(name=name, bodies=bodies, **{k: v for k, v in places.items() if k in cls.model_fields})

    @property
    def anchor_pair(self) -> tuple[VectorValue, VectorValue]:
        """Anchors on the first and on the second body, world at t = 0 (m)."""
        raise NotImplementedError

    @property
    def directions(self) -> tuple[VectorValue, ...]:
        """Axes of the joint, world at t = 0, of any length: no axis, one axis of both bodies, or one axis of
        each body."""
        return ()

    @property
    def reflected_inertia(self) -> float:
        """The ``armature`` of the driven coordinate, kg m² or kg; 0 for joints without this field."""
        return 0.0

    @property
    def end_stop(self) -> Stop | None:
        """The ``stop`` of the coordinate that a driver could prescribe; None for joints without one."""
        return None


class _AnchorJoint(JointEntry):
    anchor: PointValue

    @property
    def anchor_pair(self) -> tuple[VectorValue, VectorValue]:
        return self.anchor, self.anchor


class _AxisJoint(_AnchorJoint):
    axis: VectorValue

    _axis = field_validator("axis")(direction)

    @property
    def directions(self) -> tuple[VectorValue, ...]:
        return (self.axis,)


class _TurningJoint(_AxisJoint):
    armature: RotorInertia = 0.0  # kg m², of the driven angle q: the kinetic energy ½ armature q'²
    stop: Stop | None = None

    @property
    def reflected_inertia(self) -> float:
        return self.armature

    @property
    def end_stop(self) -> Stop | None:
        return self.stop


class Fixed(_AnchorJoint):
    """Joint that forbids all relative motion."""

    facts = JointFacts(forbidden_translations=(X, Y, Z), forbidden_rotations=(X, Y, Z))
    type: Literal["fixed"] = "fixed"


class Revolute(_TurningJoint):
    """Rotation about ``axis`` through ``anchor``; ``armature`` is the reflected inertia of a rotor."""

    facts = JointFacts((X, Y, Z), (X, Y), driven="angle", loaded=(ANGLE,))
    type: Literal["revolute"] = "revolute"


class Universal(_AnchorJoint):
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


class Spherical(_AnchorJoint):
    """Joint with coincident ``anchor`` and free rotation."""

    facts = JointFacts(forbidden_translations=(X, Y, Z))
    type: Literal["spherical"] = "spherical"


class Translational(_AxisJoint):
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


class Planar(_AxisJoint):
    """Displacement in the plane through ``anchor`` with normal ``axis``, and rotation about the normal."""

    facts = JointFacts(forbidden_translations=(Z,), forbidden_rotations=(X, Y))
    type: Literal["planar"] = "planar"


class Inline(_AxisJoint):
    """A point of the second body, ``anchor``, stays on the line along ``axis`` of the first body."""

    facts = JointFacts(forbidden_translations=(X, Y))
    type: Literal["inline"] = "inline"


class Free(_AxisJoint):
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
    | Distance,
    Discriminator("type"),
]
JOINT_TYPES: dict[str, type[Joint]] = {
    joint.model_fields["type"].default: joint for joint in get_args(get_args(Joint)[0])
}
