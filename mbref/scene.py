"""Scene: the mechanism as plain, validated, frozen data; reads and writes TOML. The classes here contain no
numerics.

Units are SI, angles radians; positions, axes and velocities are in the world frame at t = 0
unless a field says otherwise.  ``"ground"`` names the fixed frame in fields that name a body. Field names are
equal in Python and in the file, so that the path of a fault (``body[2].mass``) is also the Python expression
of the faulty value.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, Strict, ValidationError, field_validator, model_validator

from mbref.scene_couplings import Coupling
from mbref.scene_fields import (
    Entry,
    Name,
    Point,
    Positive,
    Quaternion,
    Reals,
    Vector,
    as_list,
)
from mbref.scene_functions import Factor, Sine, TimeFunction
from mbref.scene_joints import (
    JOINT_TYPES,
    Coordinate,
    Cylindrical,
    Distance,
    Fixed,
    Inline,
    Joint,
    JointFacts,
    Planar,
    Revolute,
    Spherical,
    Translational,
    Universal,
)
from mbref.scene_lines import toml_hint, with_lines
from mbref.scene_loads import (
    LOAD_TYPES,
    Force,
    JointForce,
    JointLoad,
    JointTorque,
    Load,
    Moment,
    SlideSpring,
    Spring,
    TorsionSpring,
)
from mbref.scene_paths import replaced_at
from mbref.scene_services import SERVICES, Counts
from mbref.scene_text import scene_text
from mbref.scene_validation import (
    GROUND,
    SceneError,
    checked_inertia,
    field_faults,
    named_paths,
    reference_faults,
)

__all__ = [
    "GROUND",
    "JOINT_TYPES",
    "LOAD_TYPES",
    "Body",
    "Coupling",
    "Cylindrical",
    "Distance",
    "Driver",
    "Factor",
    "Fixed",
    "Force",
    "Inline",
    "Joint",
    "JointFacts",
    "JointForce",
    "JointLoad",
    "JointTorque",
    "Load",
    "Moment",
    "Planar",
    "Revolute",
    "Scene",
    "SceneError",
    "Sine",
    "SlideSpring",
    "Spherical",
    "Spring",
    "TimeFunction",
    "TorsionSpring",
    "Translational",
    "Universal",
]

UNIT_TOLERANCE = 1e-6  # largest deviation of a quaternion from unit length that counts as rounding


Inertia = tuple[float, float, float] | tuple[Vector, Vector, Vector] | None


class Body(Entry):
    """A rigid body; its frame sits at the centre of mass.

    ``inertia`` is about the centre of mass along the body axes: three principal moments or a symmetric 3x3
    (kg m²).  A kinematic analysis needs neither ``mass`` nor ``inertia``; a body has both or none of them.
    ``velocity`` and ``angular_velocity`` (world) are optional: omitted velocities are computed from the
    constraints and the given velocities.
    """

    name: Name
    mass: Positive | None = None
    inertia: Inertia = None
    position: Point
    orientation: Quaternion = (1.0, 0.0, 0.0, 0.0)
    velocity: Vector | None = None
    angular_velocity: Vector | None = None

    @field_validator("inertia", mode="plain", json_schema_input_type=Inertia)
    @classmethod
    def _inertia_is_physical(cls, value: Any) -> Any:
        return None if value is None else checked_inertia(as_list(value))

    @field_validator("orientation")
    @classmethod
    def _orientation_is_unit(cls, q: tuple[float, ...]) -> tuple[float, ...]:
        norm = math.hypot(*q)
        if abs(norm - 1) > UNIT_TOLERANCE:
            raise ValueError(f"must be a unit quaternion (w, x, y, z), got one of length {norm:.9g}")
        return q if abs(norm - 1) <= 1e-15 else tuple(x / norm for x in q)


class Driver(TimeFunction):
    """Prescribed motion of the second body of ``joint`` relative to the first, from t = 0.

    value(t) = c0 + c1 t + c2 t² + … + sine + table: the angle of a revolute or cylindrical joint about its
    axis (rad), or the displacement of a translational one along it (m).  value(0) must be zero.
    """

    joint: Name
    polynomial: Reals = (0.0,)

    @property
    def coefficients(self) -> tuple[float, ...]:
        return self.polynomial


class Scene(Entry):
    """A mechanism: ``body``, ``joint``, ``coupling``, ``driver`` and ``load`` tuples, gravity and end time.

    ``ground = "body"`` models the ground as a body with six constraint rows, as the paper counts; the default
    ``"frame"`` models no ground body.  Raises SceneError with every fault found.
    """

    name: Name
    gravity: Vector = (0.0, 0.0, 0.0)
    duration: Positive = 1.0
    ground: Literal["frame", "body"] = "frame"
    body: Annotated[tuple[Body, ...], Field(min_length=1), Strict(False)]
    joint: Annotated[tuple[Joint, ...], Strict(False)] = ()
    coupling: Annotated[tuple[Coupling, ...], Strict(False)] = ()
    driver: Annotated[tuple[Driver, ...], Strict(False)] = ()
    load: Annotated[tuple[Load, ...], Strict(False)] = ()

    @model_validator(mode="wrap")
    @classmethod
    def _collect_every_fault(cls, data: Any, handler: Any) -> Scene:
        faults: dict[str, str] = {}
        scene: Scene | None = None
        try:
            scene = handler(data)
        except ValidationError as error:
            for path, message in field_faults(error, TABLES):
                faults.setdefault(path, message)
        if isinstance(data, Mapping):
            for path, message in reference_faults(data):
                faults.setdefault(path, message)
        if faults or scene is None:
            raise SceneError(list(named_paths(data if isinstance(data, Mapping) else {}, faults)))
        return scene

    def body_index(self, name: str) -> int:
        """Return the index of a body in ``body``; -1 for the ground."""
        return -1 if name == GROUND else [b.name for b in self.body].index(name)

    def joint_named(self, name: str) -> Joint:
        """Return the joint of a name; raises KeyError if the scene has no such joint."""
        for joint in self.joint:
            if joint.name == name:
                return joint
        raise KeyError(name)

    def coupled(self, coupling: Coupling) -> tuple[tuple[Joint, Coordinate], ...]:
        """Return both joints of a coupling, each with its coupled coordinate."""
        first, second = map(self.joint_named, coupling.joints)
        return coupling.pairs((first, second))

    def has_mass(self) -> bool:
        """True if every body has mass and inertia, as a dynamic analysis needs."""
        return all(body.mass is not None for body in self.body)

    def counts(self) -> Counts:
        """Return coordinates, rows by joint, rank, redundant rows and degrees of freedom at t = 0."""
        return SERVICES.counts(self)

    def with_(self, path: str | None = None, value: Any = None, /, **changes: Any) -> Scene:
        """Return a validated copy with some top-level fields replaced, or with another value at a path.

        ``scene.with_(duration=2.0)``, ``scene.with_("body[slider].mass", 2.0)``.  Raises SceneError if the
        path does not exist or the copy is no valid scene.
        """
        data = {k: getattr(self, k) for k in type(self).model_fields}
        if path is not None:
            data = replaced_at(data, path, lambda _: value)
        return Scene(**{**data, **changes})

    def _repr_html_(self) -> str:
        return SERVICES.picture(self)

    def to_dict(self) -> dict[str, Any]:
        """Return the scene as the nested tables of its file; fields with default values are left out."""
        data = self.model_dump(exclude_none=True, exclude_defaults=True)
        for key in ("joint", "load"):
            for item, source in zip(data.get(key, ()), getattr(self, key), strict=True):
                item["type"] = source.type
        lists: dict[str, Any] = _lists(data)
        return lists

    def save(self, path: str | Path) -> None:
        """Write the scene as TOML; ``Scene.from_file`` returns an equal scene."""
        Path(path).write_text(scene_text(self.to_dict()), encoding="utf-8")

    @staticmethod
    def from_file(path: str | Path) -> Scene:
        """Read a scene file (TOML, UTF-8); SceneError names the file, or every faulty field and line."""
        try:
            text = Path(path).read_text(encoding="utf-8-sig")
            data = tomllib.loads(text)
        except OSError as error:
            raise SceneError([f"{path}: cannot be read: {error.strerror}"]) from None
        except tomllib.TOMLDecodeError as error:
            raise SceneError([f"{path}: is not TOML: {error}{toml_hint(text, str(error))}"]) from None
        except UnicodeDecodeError as error:
            raise SceneError([f"{path}: is not UTF-8 text (at byte {error.start})"]) from None
        except ValueError as error:  # a number of thousands of digits
            raise SceneError([f"{path}: is not TOML: {error}"]) from None
        except RecursionError:
            raise SceneError([f"{path}: is nested too deeply"]) from None
        try:
            return Scene(**data)
        except SceneError as error:
            raise SceneError(with_lines(text, error.faults)) from None


TABLES = {"": tuple(Scene.model_fields)} | {
    name: tuple(table.model_fields)
    for name, table in (
        ("body", Body),
        ("coupling", Coupling),
        ("driver", Driver),
        ("sine", Sine),
        ("factor", Factor),
    )
}


def _lists(value: Any) -> Any:
    """Return tuples as lists, as writers of TOML and JSON need them."""
    if isinstance(value, Mapping):
        return {k: _lists(v) for k, v in value.items()}
    return [_lists(v) for v in value] if isinstance(value, tuple | list) else value
