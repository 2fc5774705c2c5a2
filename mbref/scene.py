"""Scene: the mechanism as plain, validated, frozen data; reads and writes TOML. No numerics.

Units are SI, angles radians; positions, axes and velocities are in the world frame at t = 0
unless a field says otherwise.  ``"ground"`` names the fixed frame wherever a body is asked for.
The field names in Python are those of the file, so a fault's path (``body[2].mass``) is also the
Python expression of the offending value.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tomli_w
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Strict,
    ValidationError,
    field_validator,
    model_validator,
)

from mbref.scene_validation import (
    GROUND,
    SceneError,
    checked_inertia,
    checked_length,
    checked_size,
    field_faults,
    reference_faults,
)

if TYPE_CHECKING:
    from mbref.equations.diagnosis import Counts

UNIT_TOLERANCE = 1e-6  # a quaternion further than this from unit length is a fault, nearer is rounding


def _as_list(value: Any) -> Any:
    """Arrays are accepted wherever the file has a list."""
    return value.tolist() if hasattr(value, "tolist") else value


Sized = AfterValidator(checked_size)
Real = Annotated[float, Field(strict=True, allow_inf_nan=False), Sized]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0), AfterValidator(checked_length)]
NotNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0), Sized]
Vector = Annotated[tuple[Real, Real, Real], Strict(False), BeforeValidator(_as_list)]
Quaternion = Annotated[tuple[Real, Real, Real, Real], Strict(False), BeforeValidator(_as_list)]
Name = Annotated[str, Field(min_length=1)]
Pair = Annotated[tuple[Name, Name], Strict(False)]
VectorPair = Annotated[tuple[Vector, Vector], Strict(False), BeforeValidator(_as_list)]
Reals = Annotated[tuple[Real, ...], Field(min_length=1), Strict(False), BeforeValidator(_as_list)]


def _direction(v: tuple[float, float, float]) -> tuple[float, float, float]:
    if (length := math.hypot(*v)) == 0:
        raise ValueError("must have a length, got the zero vector")
    checked_length(length)
    return v


class _Data(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Body(_Data):
    """A rigid body; its frame sits at the centre of mass.

    ``inertia`` is about the centre of mass along the body axes: three principal moments or a
    symmetric 3x3 (kg m²).  ``mass`` and ``inertia`` are omitted together when only kinematics is
    wanted.  ``velocity`` and ``angular_velocity`` (world) are optional: what is left out is chosen
    consistent with the constraints and with what is given.
    """

    name: Name
    mass: Positive | None = None
    inertia: tuple[float, float, float] | tuple[Vector, Vector, Vector] | None = None
    position: Vector
    orientation: Quaternion = (1.0, 0.0, 0.0, 0.0)
    velocity: Vector | None = None
    angular_velocity: Vector | None = None

    @field_validator("inertia", mode="plain")
    @classmethod
    def _inertia_is_physical(cls, value: Any) -> Any:
        return None if value is None else checked_inertia(_as_list(value))

    @field_validator("orientation")
    @classmethod
    def _orientation_is_unit(cls, q: tuple[float, ...]) -> tuple[float, ...]:
        norm = math.hypot(*q)
        if abs(norm - 1) > UNIT_TOLERANCE:
            raise ValueError(f"must be a unit quaternion (w, x, y, z), got one of length {norm:.9g}")
        return q if abs(norm - 1) <= 1e-15 else tuple(x / norm for x in q)


class _Joint(_Data):
    name: Name
    bodies: Pair


class _AxisJoint(_Joint):
    anchor: Vector
    axis: Vector

    _axis = field_validator("axis")(_direction)


class Fixed(_Joint):
    """No relative motion."""

    type: Literal["fixed"] = "fixed"
    anchor: Vector


class Revolute(_AxisJoint):
    """Rotation about ``axis`` through ``anchor``."""

    type: Literal["revolute"] = "revolute"


class Universal(_Joint):
    """Coincident ``anchor``; ``axes`` (first on the first body, second on the second) stay perpendicular."""

    type: Literal["universal"] = "universal"
    anchor: Vector
    axes: VectorPair

    @field_validator("axes")
    @classmethod
    def _axes_have_length(cls, axes: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
        return tuple(_direction(axis) for axis in axes)


class Spherical(_Joint):
    """Coincident ``anchor``, free rotation."""

    type: Literal["spherical"] = "spherical"
    anchor: Vector


class Translational(_AxisJoint):
    """Displacement along ``axis``, no rotation."""

    type: Literal["translational"] = "translational"


class Cylindrical(_AxisJoint):
    """Displacement along and rotation about ``axis``."""

    type: Literal["cylindrical"] = "cylindrical"


class Distance(_Joint):
    """Constant distance between two ``anchors`` (first on the first body, second on the second)."""

    type: Literal["distance"] = "distance"
    anchors: VectorPair

    @field_validator("anchors")
    @classmethod
    def _anchors_are_apart(cls, anchors: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
        if math.dist(*anchors) == 0:
            raise ValueError("must be two different points (coincident points are a spherical joint)")
        return anchors


Joint = Annotated[
    Fixed | Revolute | Universal | Spherical | Translational | Cylindrical | Distance,
    Discriminator("type"),
]


class Sine(_Data):
    """amplitude · sin(frequency · t + phase); frequency in rad/s."""

    amplitude: Real = 0.0
    frequency: Real = 1.0
    phase: Real = 0.0


class Driver(_Data):
    """Prescribed motion of the second body of ``joint`` relative to the first, from t = 0.

    value(t) = c0 + c1 t + c2 t² + … (+ sine): the angle of a revolute or cylindrical joint about its
    axis (rad), or the displacement of a translational one along it (m).  value(0) must be zero.
    """

    joint: Name
    polynomial: Reals = (0.0,)
    sine: Sine | None = None


class Moment(_Data):
    """Constant moment on a body (N m, world axes)."""

    type: Literal["moment"] = "moment"
    body: Name
    moment: Vector


class Force(_Data):
    """Constant force (N, world axes) at a body-fixed point (given in the world at t = 0)."""

    type: Literal["force"] = "force"
    body: Name
    point: Vector
    force: Vector


class Spring(_Data):
    """Spring and damper between two body-fixed points (world at t = 0); N/m, N s/m, m."""

    type: Literal["spring"] = "spring"
    bodies: Pair
    points: VectorPair
    stiffness: NotNegative
    damping: NotNegative = 0.0
    natural_length: NotNegative


class TorsionSpring(_Data):
    """Spring and damper about a joint's axis; N m/rad, N m s/rad; angle measured from t = 0."""

    type: Literal["torsion_spring"] = "torsion_spring"
    joint: Name
    stiffness: NotNegative
    damping: NotNegative = 0.0
    natural_angle: Real = 0.0


Load = Annotated[Moment | Force | Spring | TorsionSpring, Discriminator("type")]


class Scene(_Data):
    """A mechanism: ``body``, ``joint``, ``driver`` and ``load`` tuples, gravity and default end time.

    ``ground = "body"`` adds the ground as a body held by six rows, as the paper counts it; the
    default ``"frame"`` models no ground body.  Raises SceneError with every fault found.
    """

    name: Name
    gravity: Vector = (0.0, 0.0, 0.0)
    duration: Positive = 1.0
    ground: Literal["frame", "body"] = "frame"
    body: Annotated[tuple[Body, ...], Field(min_length=1), Strict(False)]
    joint: Annotated[tuple[Joint, ...], Strict(False)] = ()
    driver: Annotated[tuple[Driver, ...], Strict(False)] = ()
    load: Annotated[tuple[Load, ...], Strict(False)] = ()

    @model_validator(mode="wrap")
    @classmethod
    def _collect_every_fault(cls, data: Any, handler: Any) -> Scene:
        faults: dict[str, str] = {}
        scene = None
        try:
            scene = handler(data)
        except ValidationError as error:
            for path, message in field_faults(error):
                faults.setdefault(path, message)
        if isinstance(data, Mapping):
            for path, message in reference_faults(data):
                faults.setdefault(path, message)
        if faults:
            raise SceneError([f"{path}: {message}" for path, message in faults.items()])
        return scene  # type: ignore[return-value]

    def body_index(self, name: str) -> int:
        """Index of a body in ``body``; -1 for the ground."""
        return -1 if name == GROUND else [b.name for b in self.body].index(name)

    def has_mass(self) -> bool:
        """Whether every body has mass and inertia, as a dynamic analysis needs."""
        return all(body.mass is not None for body in self.body)

    def counts(self) -> Counts:
        """Coordinates, rows by joint, rank, redundant rows and degrees of freedom at t = 0."""
        from mbref.equations.diagnosis import counts

        return counts(self)

    def with_(self, **changes: Any) -> Scene:
        """A validated copy with some top-level fields replaced."""
        return Scene(**{**{k: getattr(self, k) for k in type(self).model_fields}, **changes})

    def to_dict(self) -> dict[str, Any]:
        """The scene as the file's nested tables; fields at their default are left out."""
        data = self.model_dump(exclude_none=True, exclude_defaults=True)
        for key in ("joint", "load"):
            for item, source in zip(data.get(key, ()), getattr(self, key), strict=True):
                item["type"] = source.type
        return _lists(data)

    def save(self, path: str | Path) -> None:
        """Write the scene as TOML; ``Scene.from_file`` gives back an equal scene."""
        Path(path).write_text(tomli_w.dumps(self.to_dict()), encoding="utf-8")

    @staticmethod
    def from_file(path: str | Path) -> Scene:
        """Read a scene file (TOML, UTF-8); raises SceneError naming the file, or every faulty field."""
        try:
            data = tomllib.loads(Path(path).read_text(encoding="utf-8-sig"))
        except OSError as error:
            raise SceneError([f"{path}: cannot be read: {error.strerror}"]) from None
        except ValueError as error:  # no UTF-8, no TOML, or a number of thousands of digits
            raise SceneError([f"{path}: is not TOML: {error}"]) from None
        except RecursionError:
            raise SceneError([f"{path}: is nested too deeply"]) from None
        return Scene(**data)


def _lists(value: Any) -> Any:
    """Tuples as lists, which is what a TOML or JSON writer takes."""
    if isinstance(value, Mapping):
        return {k: _lists(v) for k, v in value.items()}
    return [_lists(v) for v in value] if isinstance(value, tuple | list) else value
