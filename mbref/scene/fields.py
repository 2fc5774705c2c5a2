"""Types of a scene's fields, limits of numbers, and the base class of all entries of a scene."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from reprlib import Repr
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

from mbref.printable import checked_name
from mbref.scene.units import angle, length, length_or_angle

# limits of numbers, whose products and squares then stay within double precision
LARGEST, SMALLEST = 1e40, 1e-40
MOST_CHARACTERS = 200  # characters of a name, which messages and pages repeat whole
COINCIDENT = 1e-14  # distance / largest coordinate; points at a smaller distance differ by rounding
OTHER_WORDS = {  # words of other programs and books → the words of scene files
    "hinge": "revolute",
    "pin": "revolute",
    "rotational": "revolute",
    "prismatic": "translational",
    "slider": "translational",
    "slide": "translational",
    "ball": "spherical",
    "cardan": "universal",
    "hooke": "universal",
    "weld": "fixed",
    "rigid": "fixed",
    "rod": "distance",
    "link": "distance",
    "point_on_line": "inline",
    "in_line": "inline",
    "torque": "moment",
    "motor": "driver",
    "actuator": "joint_force",
    "linear_spring": "slide_spring",
    "spring_damper": "spring",
    "rotational_spring": "torsion_spring",
    "world": "ground",
    "frame": "ground",
    "base": "ground",
    "chassis": "ground",
    "bodies": "body",
    "joints": "joint",
    "drivers": "driver",
    "loads": "load",
    "links": "body",
    "speed": "polynomial",
    "velocity": "polynomial",
    "k": "stiffness",
    "c": "damping",
    "length": "natural_length",
    "rest_length": "natural_length",
    "com": "position",
    "quaternion": "orientation",
    "time": "duration",
    "end_time": "duration",
    "point": "anchor",
    "points": "anchors",
}
SHOWN = Repr()  # shortens the quotation of a faulty value
SHOWN.maxstring = SHOWN.maxother = SHOWN.maxlong = 80


def shown(value: Any) -> str:
    """Return the value as Python writes it, shortened, for messages."""
    try:
        return SHOWN.repr(value)
    except ValueError:  # Python refuses to write integers of thousands of digits
        return "a number of thousands of digits"


def meant(word: str, known: Iterable[str]) -> str:
    """Return "; did you mean 'rod'?" for the known word that is most similar or has an equal meaning, or an
    empty text."""
    words = {k.lower(): k for k in known if k}
    other = OTHER_WORDS.get(word.lower(), "")
    alike = [other] if other in words else get_close_matches(word.lower(), words, n=1)
    return f"; did you mean {words[alike[0]]!r}?" if alike else ""


def checked_size(value: float) -> float:
    """Return the number; raises ValueError if it is so large that its powers would overflow."""
    if abs(value) > LARGEST:
        raise ValueError(f"must be at most {LARGEST:g} in size, got {value:g}")
    return value


def checked_length(value: float) -> float:
    """Return the positive number; raises ValueError if its powers would overflow or vanish."""
    if value < SMALLEST:
        raise ValueError(f"must be at least {SMALLEST:g} in size, got {value:g}")
    return checked_size(value)


def checked_mass(value: float) -> float:
    """Return the number, zero or positive; raises ValueError if its powers would overflow or vanish."""
    return value if value == 0 else checked_length(value)


def as_list(value: Any) -> Any:
    """Return an array as a list, so that arrays are accepted for lists."""
    return value.tolist() if hasattr(value, "tolist") else value


def is_some(value: Any) -> bool:
    """Return whether a list, also of lists, contains a number that is not zero."""
    return any(map(is_some, value)) if isinstance(value, list | tuple) else value != 0


def field_of(entry: Any, key: str) -> Any:
    """Return a field of an entry, which may be a raw table or a model."""
    return entry.get(key) if isinstance(entry, Mapping) else getattr(entry, key, None)


Sized = AfterValidator(checked_size)
Real = Annotated[float, Field(strict=True, allow_inf_nan=False), Sized]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0), AfterValidator(checked_length)]
Mass = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0), AfterValidator(checked_mass)]
NotNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0), Sized]
VectorValue = Annotated[tuple[Real, Real, Real], BeforeValidator(as_list)]
Quaternion = Annotated[tuple[Real, Real, Real, Real], BeforeValidator(as_list)]
Name = Annotated[str, Field(min_length=1, max_length=MOST_CHARACTERS), AfterValidator(checked_name)]
Pair = tuple[Name, Name]
VectorPair = Annotated[tuple[VectorValue, VectorValue], BeforeValidator(as_list)]
Reals = Annotated[tuple[Real, ...], Field(min_length=1), BeforeValidator(as_list)]


Length = Annotated[Real, BeforeValidator(length, json_schema_input_type=float | str)]  # m, or "300 mm"
Angle = Annotated[Real, BeforeValidator(angle, json_schema_input_type=float | str)]  # rad, or "30 deg"
LengthOrAngle = Annotated[Real, BeforeValidator(length_or_angle, json_schema_input_type=float | str)]
Measures = Annotated[tuple[LengthOrAngle, ...], Field(min_length=1), BeforeValidator(as_list)]
Extent = Annotated[NotNegative, BeforeValidator(length, json_schema_input_type=float | str)]
PointValue = Annotated[tuple[Length, Length, Length], BeforeValidator(as_list)]
PointPair = Annotated[tuple[PointValue, PointValue], BeforeValidator(as_list)]


def direction(v: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return the vector; raises ValueError if it is zero or too short to be squared."""
    if (length := math.hypot(*v)) == 0:
        raise ValueError("must have a length, got the zero vector")
    checked_length(length)
    return v


class SceneEntry(BaseModel):
    """Base class of the entries of a scene: a frozen table without unknown fields."""

    model_config = ConfigDict(frozen=True, extra="forbid")
