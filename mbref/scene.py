"""Scene: the mechanism as plain, validated, frozen data; reads and writes TOML. No numerics.

Units are SI, angles radians; positions, axes and velocities are in the world frame at t = 0
unless a field says otherwise.  ``"ground"`` names the fixed frame wherever a body is asked for.
The field names in Python are those of the file, so a fault's path (``body[2].mass``) is also the
Python expression of the offending value.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import tomli_w
from pydantic import (
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

if TYPE_CHECKING:
    from mbref.diagnose import Counts

GROUND = "ground"
UNIT_TOLERANCE = 1e-6  # a quaternion further than this from unit length is a fault, nearer is rounding
INERTIA_TOLERANCE = 1e-9  # relative; discs and thin rods meet the triangle inequality with equality


class SceneError(Exception):
    """A scene that cannot be used; ``faults`` has one ``path: message`` per fault."""

    def __init__(self, faults: Sequence[str]):
        self.faults = list(faults)
        super().__init__("\n".join(self.faults))


def _as_list(value: Any) -> Any:
    """Arrays are accepted wherever the file has a list."""
    return value.tolist() if hasattr(value, "tolist") else value


Real = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0)]
NotNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0)]
Vector = Annotated[tuple[Real, Real, Real], Strict(False), BeforeValidator(_as_list)]
Quaternion = Annotated[tuple[Real, Real, Real, Real], Strict(False), BeforeValidator(_as_list)]
Name = Annotated[str, Field(min_length=1)]
Pair = Annotated[tuple[Name, Name], Strict(False)]
VectorPair = Annotated[tuple[Vector, Vector], Strict(False), BeforeValidator(_as_list)]
Reals = Annotated[tuple[Real, ...], Field(min_length=1), Strict(False), BeforeValidator(_as_list)]


def _direction(v: tuple[float, float, float]) -> tuple[float, float, float]:
    if math.hypot(*v) == 0:
        raise ValueError("must have a length, got the zero vector")
    return v


def _inertia(value: Any) -> tuple[Any, ...]:
    """Three principal moments or a symmetric 3x3, as tuples; ValueError says what is unphysical."""
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise ValueError("must be three numbers or a 3x3 matrix") from None
    if array.shape not in ((3,), (3, 3)):
        raise ValueError(f"must be three numbers or a 3x3 matrix, got shape {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError("must be finite")
    matrix = np.diag(array) if array.ndim == 1 else array
    tolerance = INERTIA_TOLERANCE * max(abs(matrix).max(), 1e-300)
    if abs(matrix - matrix.T).max() > tolerance:
        raise ValueError("must be symmetric")
    moments = np.linalg.eigvalsh(matrix)
    if moments[0] < -tolerance:
        raise ValueError(f"must have no negative principal moment, got {moments[0]:.6g}")
    if moments[2] > moments[0] + moments[1] + tolerance:
        raise ValueError(
            f"violates the triangle inequality: {moments[2]:.6g} > {moments[0]:.6g} + {moments[1]:.6g}"
        )
    return tuple(array.tolist()) if array.ndim == 1 else tuple(map(tuple, array.tolist()))


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
        return None if value is None else _inertia(_as_list(value))

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

DRIVEN = ("revolute", "cylindrical", "translational")  # joints a driver can move
TURNING = ("revolute", "cylindrical")  # joints a torsion spring can act on


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
            for path, message in _field_faults(error):
                faults.setdefault(path, message)
        if isinstance(data, Mapping):
            for path, message in _reference_faults(data):
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
        from mbref.diagnose import counts

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
        Path(path).write_text(tomli_w.dumps(self.to_dict()))

    @staticmethod
    def from_file(path: str | Path) -> Scene:
        """Read a scene file; raises SceneError naming the file, or every faulty field."""
        try:
            data = tomllib.loads(Path(path).read_text())
        except OSError as error:
            raise SceneError([f"{path}: cannot be read: {error.strerror}"]) from None
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise SceneError([f"{path}: is not TOML: {error}"]) from None
        return Scene(**data)


def _lists(value: Any) -> Any:
    """Tuples as lists, which is what a TOML or JSON writer takes."""
    if isinstance(value, Mapping):
        return {k: _lists(v) for k, v in value.items()}
    return [_lists(v) for v in value] if isinstance(value, tuple | list) else value


def _field_faults(error: ValidationError) -> Iterator[tuple[str, str]]:
    """(path, message) of every fault pydantic found, in the words of the file."""
    for fault in error.errors(include_url=False):
        kind, got = fault["type"], fault["input"]
        limit = fault.get("ctx", {})
        messages = {
            "missing": "is required",
            "extra_forbidden": "is not a known field",
            "greater_than": f"must be positive, got {got!r}",
            "greater_than_equal": f"must not be negative, got {got!r}",
            "finite_number": f"must be finite, got {got!r}",
            "float_type": f"must be a number, got {got!r}",
            "string_type": f"must be a string, got {got!r}",
            "string_too_short": "must not be empty",
            "too_short": "must not be empty",
            "tuple_type": f"must be a list, got {got!r}",
            "union_tag_not_found": "is required",
            "union_tag_invalid": f"must be one of {limit.get('expected_tags')}, got {limit.get('tag')!r}",
            "literal_error": f"must be {limit.get('expected')}, got {got!r}",
            "model_type": "must be a table",
            "model_attributes_type": "must be a table",
            "value_error": str(limit.get("error", "")),
        }
        default = f"{fault['msg'][0].lower()}{fault['msg'][1:]}, got {got!r}"
        if kind == "too_short" and got:
            continue  # entries are there, but faulty ones were left out
        path = _path(fault["loc"]) + (".type" if kind.startswith("union_tag") else "")
        yield path, messages.get(kind, default)


def _path(location: Sequence[str | int]) -> str:
    """body[2].mass; the tag that a union of joint or load types adds to a location is dropped."""
    parts = list(location)
    if len(parts) > 2 and parts[0] in ("joint", "load") and isinstance(parts[2], str):
        del parts[2]
    text = ""
    for part in parts:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text or "scene"


def _get(entry: Any, key: str) -> Any:
    """A field of an entry that may still be a raw table, or already a model."""
    return entry.get(key) if isinstance(entry, Mapping) else getattr(entry, key, None)


def _entries(data: Mapping[str, Any], key: str) -> list[Any]:
    value = data.get(key, ())
    return list(value) if isinstance(value, list | tuple) else []


def _names(entries: Sequence[Any]) -> list[str]:
    return [name if isinstance(name := _get(entry, "name"), str) else "" for entry in entries]


def _reference_faults(data: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Faults between entries: duplicate names, unknown bodies and joints, drivers of the wrong joint.

    Works on raw tables, so that these are found beside the faults of single fields.
    """
    bodies, joints = _entries(data, "body"), _entries(data, "joint")
    yield from _duplicates("body", _names(bodies), reserved=(GROUND,))
    yield from _duplicates("joint", _names(joints))
    for i, body in enumerate(bodies):
        mass, inertia = _get(body, "mass"), _get(body, "inertia")
        if (mass is None) != (inertia is None):
            missing = "inertia" if inertia is None else "mass"
            yield (
                f"body[{i}].{missing}",
                "is missing; give mass and inertia, or neither (kinematics)",
            )
    known = {*_names(bodies), GROUND}
    for i, joint in enumerate(joints):
        yield from _pair_faults(f"joint[{i}].bodies", _get(joint, "bodies"), known)
    types = dict(zip(_names(joints), (_get(joint, "type") for joint in joints), strict=True))
    driven: set[str] = set()
    for i, driver in enumerate(_entries(data, "driver")):
        name = _get(driver, "joint")
        yield from _joint_faults(f"driver[{i}].joint", name, types, DRIVEN, "be driven")
        if name in driven:
            yield f"driver[{i}].joint", f"{name!r} already has a driver"
        driven.add(name if isinstance(name, str) else "")
        if start := _initial_value(driver):
            message = f"value(0) must be 0 (it is measured from the initial position), got {start:g}"
            yield f"driver[{i}].polynomial", message
    for i, load in enumerate(_entries(data, "load")):
        kind = _get(load, "type")
        if kind in ("moment", "force"):
            name = _get(load, "body")
            if name == GROUND:
                yield f"load[{i}].body", "the ground cannot be loaded"
            elif isinstance(name, str) and name not in known:
                yield f"load[{i}].body", _unknown("body", name, known - {GROUND})
        elif kind == "spring":
            yield from _pair_faults(f"load[{i}].bodies", _get(load, "bodies"), known)
        elif kind == "torsion_spring":
            name = _get(load, "joint")
            yield from _joint_faults(f"load[{i}].joint", name, types, TURNING, "carry a torsion spring")


def _initial_value(driver: Any) -> float:
    """value(0) of a driver; 0 where rounding or where its fields are themselves faulty."""
    polynomial, sine = _get(driver, "polynomial") or (0.0,), _get(driver, "sine")
    terms = [polynomial[0] if isinstance(polynomial, list | tuple) else 0.0]
    if sine is not None:
        amplitude, phase = _get(sine, "amplitude") or 0.0, _get(sine, "phase") or 0.0
        if isinstance(amplitude, int | float) and isinstance(phase, int | float):
            terms.append(amplitude * math.sin(phase))
    if not all(isinstance(term, int | float) for term in terms):
        return 0.0
    start = float(sum(terms))
    return start if abs(start) > 1e-12 else 0.0


def _duplicates(key: str, names: Sequence[str], reserved: Sequence[str] = ()) -> Iterator[tuple[str, str]]:
    for i, name in enumerate(names):
        if name in reserved:
            yield f"{key}[{i}].name", f"{name!r} is reserved for the fixed frame"
        elif name and name in names[:i]:
            yield f"{key}[{i}].name", f"{name!r} is already the name of {key}[{names.index(name)}]"


def _unknown(what: str, name: str, known: Sequence[str] | set[str]) -> str:
    return f"unknown {what} {name!r}; known: {', '.join(sorted(filter(None, known))) or 'none'}"


def _pair_faults(path: str, pair: Any, known: set[str]) -> Iterator[tuple[str, str]]:
    if not isinstance(pair, list | tuple) or len(pair) != 2:
        return  # reported as a field fault
    for k, name in enumerate(pair):
        if isinstance(name, str) and name and name not in known:
            yield f"{path}[{k}]", _unknown("body", name, known)
    if pair[0] == pair[1]:
        yield path, f"must be two different bodies, got {pair[0]!r} twice"


def _joint_faults(
    path: str, name: Any, types: Mapping[str, Any], allowed: Sequence[str], what: str
) -> Iterator[tuple[str, str]]:
    if not isinstance(name, str) or not name:
        return  # reported as a field fault
    if name not in types:
        yield path, _unknown("joint", name, list(types))
    elif types[name] not in allowed:
        yield path, f"{name!r} is {types[name]}; only {', '.join(allowed)} joints can {what}"
