"""Facts of joint types as data, and the fields that all joints have."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Self

from pydantic import field_validator

from mbref.scene.fields import Name, Pair, PointValue, VectorValue, direction
from mbref.scene.intervals import Intermittent
from mbref.scene.stops import Stop

X, Y, Z = 0, 1, 2
Coordinate = Literal["angle", "displacement"]
ANGLE: Coordinate = "angle"
DISPLACEMENT: Coordinate = "displacement"
Condition = Literal["perpendicular axes", "constant distance", "contact"]


@dataclass(frozen=True)
class JointFacts:
    """Relative motion that a joint type forbids, and the drivers and loads that can act on the remaining
    motion.

    ``forbidden_translations`` and ``forbidden_rotations`` are components (0, 1, 2) of the second body's
    motion relative to the first, in the joint's frame on the first body; its third axis is along the joint's
    axis. ``condition`` is one further equation: the axes of both bodies stay perpendicular, the anchors keep
    their distance, or a wheel touches its plane. ``velocity_rows`` is the number of further equations,
    between velocities alone: the directions in which the point of contact does not slip. ``driven`` is the
    coordinate a driver prescribes: the angle about or the displacement along the axis, None for a joint that
    cannot be driven. ``loaded`` are the coordinates along which springs, forces and torques of the joint can
    act.
    """

    forbidden_translations: tuple[int, ...] = ()
    forbidden_rotations: tuple[int, ...] = ()
    condition: Condition | None = None
    driven: Coordinate | None = None
    loaded: tuple[Coordinate, ...] = ()
    velocity_rows: int = 0

    @property
    def rows(self) -> int:
        """Number of constraint rows without a driver."""
        forbidden = len(self.forbidden_translations) + len(self.forbidden_rotations)
        return forbidden + bool(self.condition) + self.velocity_rows

    @property
    def free_translations(self) -> int:
        """Number of free relative translations; some of a rolling wheel need a turn to get there."""
        return 3 - len(self.forbidden_translations) - (self.condition in ("constant distance", "contact"))

    @property
    def free_rotations(self) -> int:
        """Number of free relative rotations."""
        return 3 - len(self.forbidden_rotations) - (self.condition == "perpendicular axes")

    @property
    def turns(self) -> bool:
        """True if the bodies can turn relative to each other about the joint's axis only."""
        return self.forbidden_rotations == (X, Y)

    @property
    def oriented(self) -> bool:
        """True if a driver can prescribe the relative orientation: a ball joint."""
        return self.forbidden_translations == (X, Y, Z) and self.free_rotations == len((X, Y, Z))

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


class AnchorJoint(JointEntry):
    """Joint with one point, ``anchor``, of both bodies (world at t = 0, m)."""

    anchor: PointValue

    @property
    def anchor_pair(self) -> tuple[VectorValue, VectorValue]:
        return self.anchor, self.anchor


class AxisJoint(AnchorJoint):
    """Joint with one direction, ``axis``, of both bodies (world at t = 0)."""

    axis: VectorValue

    _axis = field_validator("axis")(direction)

    @property
    def directions(self) -> tuple[VectorValue, ...]:
        return (self.axis,)
