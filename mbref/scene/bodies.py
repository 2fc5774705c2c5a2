"""Bodies and drivers as data: rigid bodies, and prescribed motions of joints and of points."""

from __future__ import annotations

import math
from typing import Annotated, Any, Self

import numpy as np
from pydantic import BeforeValidator, Field, ValidationInfo, field_validator, model_validator

from mbref import rotations
from mbref.scene.fields import (
    AngularSpeed,
    Density,
    Mass,
    Measures,
    Name,
    PointValue,
    Quaternion,
    SceneEntry,
    Speed,
    Three,
    VectorValue,
    as_list,
    checked_mass,
    direction,
)
from mbref.scene.functions import TimeFunction
from mbref.scene.shapes import Solid
from mbref.scene.units import number_in
from mbref.scene.validation import checked_inertia

OF_POINT = ("name", "body", "point", "along")  # fields of a driver of a point
ALONG_JOINT = ("name", "along")  # those that a driver of a displacement of a joint has, too
DRIVER = "driver({})"  # name of the driver of a joint in columns and records
MOST_TURNS = 3  # of a driver; three turns reach every orientation
UNIT_TOLERANCE = 1e-6  # largest deviation of a quaternion from unit length that counts as rounding
START_ROUNDING = 1e-12  # value of a driver at t = 0 / its largest term, or 1 m or rad, that is rounding


InertiaValue = tuple[float, float, float] | tuple[VectorValue, VectorValue, VectorValue] | None
WrittenMoments = tuple[float | str, float | str, float | str]
WrittenInertia = WrittenMoments | tuple[WrittenMoments, WrittenMoments, WrittenMoments] | None


class Body(SceneEntry):
    """A rigid body; its frame sits at the centre of mass.

    ``inertia`` is about the centre of mass along the body axes: three principal moments or a symmetric 3x3
    (kg m²).  A kinematic analysis needs neither ``mass`` nor ``inertia``; a body has both or none of them.
    A body of mass 0 and inertia 0 is a massless link, whose motion follows from the bodies at its joints.
    A ``shape`` with ``mass`` or ``density`` (kg/m³) of a homogeneous body gives both; a read body has numbers
    in place of the shape.
    ``velocity`` and ``angular_velocity`` (world) are optional: omitted velocities are computed from the
    constraints and the given velocities.
    """

    name: Name
    mass: Mass | None = None
    inertia: InertiaValue = None
    shape: Solid | None = None
    density: Density | None = None
    position: PointValue
    orientation: Quaternion = (1.0, 0.0, 0.0, 0.0)
    velocity: Three[Speed] | None = None
    angular_velocity: Three[AngularSpeed] | None = None

    @field_validator("inertia", mode="plain", json_schema_input_type=WrittenInertia)
    @classmethod
    def _inertia_is_physical(cls, value: Any) -> Any:
        return None if value is None else checked_inertia(_in_si(as_list(value)))

    @field_validator("orientation")
    @classmethod
    def _orientation_is_unit(cls, q: tuple[float, ...]) -> tuple[float, ...]:
        norm = math.hypot(*q)
        if abs(norm - 1) > UNIT_TOLERANCE:
            raise ValueError(f"must be a unit quaternion (w, x, y, z), got one of length {norm:.9g}")
        return q if abs(norm - 1) <= 1e-15 else tuple(x / norm for x in q)

    @model_validator(mode="after")
    def _numbers_replace_the_shape(self) -> Self:
        if self.shape is None or self.inertia is not None or (self.mass is None) == (self.density is None):
            return self  # no shape, or a fault that the scene reports
        mass = self.mass or 0.0
        if self.density is not None:
            mass = checked_mass(self.density * self.shape.volume)
        inertia = tuple(mass * moment for moment in self.shape.moments_over_mass)
        self.__dict__.update(mass=mass, inertia=checked_inertia(inertia), shape=None, density=None)
        return self


def _in_si(value: Any) -> Any:
    """Return moments of inertia, also in lists, in kg m²."""
    return [*map(_in_si, value)] if isinstance(value, list | tuple) else number_in("inertia")(value)


class _FromZero(TimeFunction):
    """A function of time of a driver: zero at t = 0, with a field ``polynomial``."""

    @field_validator("polynomial", check_fields=False)
    @classmethod
    def _motion_begins_at_zero(cls, polynomial: tuple[float, ...], info: ValidationInfo) -> tuple[float, ...]:
        if not {"sine", "table"} <= info.data.keys():
            return polynomial  # a fault of another field is reported
        sine, table = info.data["sine"], info.data["table"]
        start = polynomial[0] + (sine.amplitude * math.sin(sine.phase) if sine else 0.0)
        size = abs(polynomial[0]) + (abs(sine.amplitude) if sine else 0.0)
        what = "c0 + amplitude·sin(phase) must be 0, motion is measured from t = 0"
        if table:
            rows = {"table": table, "periodic": info.data["periodic"]}
            start += cls.model_construct(sine=None, polynomial=(0.0,), **rows).pieces()[0].cubic[0]
            size += max(abs(value) for _, value in table)
            what = "the value at t = 0 must be 0, because the motion is measured from its start"
        if abs(start) > START_ROUNDING * max(1.0, size):
            raise ValueError(f"{what}; got {start:g}")
        return polynomial

    def from_time(self, t: float) -> Self:
        """Return the function of the time since t (s), of the motion since then."""
        fields = self._delayed(t)
        at_start = float(self.model_copy(update={**fields}).values(np.zeros(1))[0])
        first, *others = fields["polynomial"]
        return self.model_copy(update={**fields, "polynomial": (first - at_start, *others)})


class Turn(_FromZero):
    """A turn of a driven ball joint about an ``axis``, by the angle polynomial + sine + table (rad).

    The axis is a direction of the world at t = 0; the turns before it carry it.
    """

    axis: VectorValue
    polynomial: Annotated[Measures, Field(validate_default=True)] = (0.0,)

    _axis = field_validator("axis")(direction)

    @property
    def coefficients(self) -> tuple[float, ...]:
        return self.polynomial


class Driver(_FromZero):
    """Prescribed motion of the second body of ``joint`` relative to the first, from t = 0.

    value(t) = c0 + c1 t + c2 t² + … + sine + table: the angle of a revolute, cylindrical or planar joint
    about its axis (rad), or the displacement of a translational or free one along it (m).  value(0) must be
    zero.  With a ``name`` and a direction ``along`` (world at t = 0, carried by the first body) in which the
    joint lets the bodies move, it is the displacement along this direction.
    In place of a joint, a ``name``, a ``body``, its ``point`` (world at t = 0) and a world direction
    ``along`` prescribe the displacement of a point; a read scene has a free joint in place of a direction.
    Of a spherical joint, one to three ``turn`` entries prescribe the orientation: R₁ R₂ R₃, with turns Rₖ
    about axes that the first body carries.
    """

    name: Name | None = None
    body: Name | None = None
    point: PointValue | None = None
    along: VectorValue | None = None
    joint: Annotated[Name, Field(validate_default=True)] = ""
    polynomial: Annotated[Measures, Field(validate_default=True)] = (0.0,)
    turn: Annotated[tuple[Turn, ...], Field(max_length=MOST_TURNS), BeforeValidator(as_list)] = ()

    @field_validator("along")
    @classmethod
    def _has_a_direction(cls, along: VectorValue | None) -> VectorValue | None:
        return along if along is None else direction(along)

    @field_validator("joint", mode="before")
    @classmethod
    def _joint_or_point(cls, joint: Any, info: ValidationInfo) -> Any:
        """Return the name of the joint, or of the driven point; a faulty field counts as given."""
        given = [field for field in OF_POINT if info.data.get(field, field) is not None]
        missing = [field for field in (ALONG_JOINT if joint else OF_POINT) if field not in given]
        if joint and set(given) - {*ALONG_JOINT}:
            raise ValueError(f"or a driven point, not both; got {given[0]}, too")
        if joint and given and missing:
            raise ValueError(f"with {given[0]} needs {missing[0]}, too, for a displacement of the joint")
        if joint or not missing:
            return joint or info.data.get("name")
        raise ValueError("is required" + f", or {', '.join(missing)} of the driven point" * bool(given))

    @field_validator("turn")
    @classmethod
    def _turns_replace_the_function(cls, turn: tuple[Turn, ...], info: ValidationInfo) -> tuple[Turn, ...]:
        given = [field for field in (*TimeFunction.model_fields, *OF_POINT) if info.data.get(field)]
        given += ["polynomial"] * any(info.data.get("polynomial", ()))
        if turn and given:
            raise ValueError(f"prescribes the whole orientation; {given[0]} belongs into its entries")
        return turn

    @property
    def coefficients(self) -> tuple[float, ...]:
        return self.polynomial

    @property
    def functions(self) -> tuple[TimeFunction, ...]:
        """The driver's function of time, or the angles of three turns, of which the last ones may be
        still."""
        return self.turns or (self,)

    @property
    def turns(self) -> tuple[Turn, ...]:
        """Three turns of a driven orientation, of which the last ones may be still; otherwise none."""
        still = Turn(axis=(0.0, 0.0, 1.0))
        return (*self.turn, *[still] * (MOST_TURNS - len(self.turn))) if self.turn else ()

    @property
    def rows(self) -> int:
        """Number of constraint rows."""
        return len(self.functions)

    @property
    def is_constant(self) -> bool:
        return all(turn.is_constant for turn in self.turn) if self.turn else super().is_constant

    def repeated(self, until: float) -> Self:
        if not self.turn:
            return super().repeated(until)
        turn = tuple(each.repeated(until) for each in self.turn)
        same = all(a is b for a, b in zip(turn, self.turn, strict=True))
        return self if same else self.model_copy(update={"turn": turn})

    def from_time(self, t: float) -> Self:
        """Return the driver as a function of the time since t (s), of the motion since then; the first body
        has not turned."""
        if not self.turn:
            return super().from_time(t)
        found, carried = [], np.array([1.0, 0.0, 0.0, 0.0])
        for each in self.turn:
            axis = rotations.rotate(carried, rotations.unit(each.axis))
            angle = float(each.values(np.array([t]))[0])
            carried = rotations.multiply(rotations.from_vector(angle * axis), carried)
            found.append(each.from_time(t).model_copy(update={"axis": tuple(axis.tolist())}))
        return self.model_copy(update={"turn": tuple(found)})
