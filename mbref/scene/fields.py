"""Types of a scene's fields, limits of numbers, and the base class of all entries of a scene."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from difflib import get_close_matches
from reprlib import Repr
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from mbref.printable import checked_name
from mbref.scene.units import Quantity, number_in

if TYPE_CHECKING:
    from pydantic._internal._model_construction import ModelMetaclass as ModelType
else:
    ModelType = type(BaseModel)

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
    "damper": "point_damper",
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
    """Return the number, 0 for -0: equal scenes have equal bits.

    Raises ValueError if the number is so large that its powers would overflow.
    """
    if abs(value) > LARGEST:
        raise ValueError(f"must be at most {LARGEST:g} in size, got {value:g}")
    return value + 0.0


def checked_length(value: float) -> float:
    """Return the positive number; raises ValueError if its powers would overflow or vanish."""
    if value < SMALLEST:
        raise ValueError(f"must be at least {SMALLEST:g} in size, got {value:g}")
    return checked_size(value)


def checked_mass(value: float) -> float:
    """Return the number, zero or positive; raises ValueError if its powers would overflow or vanish."""
    return 0.0 if value == 0 else checked_length(value)


def as_list(value: Any) -> Any:
    """Return an array as a list, so that arrays are accepted for lists."""
    return value.tolist() if hasattr(value, "tolist") else value


def is_some(value: Any) -> bool:
    """Return whether a list, also of lists, contains a number that is not zero."""
    return any(map(is_some, value)) if isinstance(value, list | tuple) else value != 0


def field_of(entry: Any, key: str) -> Any:
    """Return a field of an entry, which may be a raw table or a model."""
    is_entry = type(type(entry)) is EntryType  # a test for Mapping takes a microsecond
    is_table = not is_entry and isinstance(entry, Mapping)
    return entry.get(key) if is_table else getattr(entry, key, None)


def unit_of(*quantities: Quantity) -> BeforeValidator:
    """Return the validator of a number that may have a unit of one of the quantities, or any unit."""
    return BeforeValidator(number_in(*quantities), json_schema_input_type=float | str)


Sized = AfterValidator(checked_size)
Real = Annotated[float, Field(strict=True, allow_inf_nan=False), Sized]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0), AfterValidator(checked_length)]
NotNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0), Sized]
Light = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0), AfterValidator(checked_mass)]
Number = TypeVar("Number")
Three = Annotated[tuple[Number, Number, Number], BeforeValidator(as_list)]
VectorValue = Three[Real]
Quaternion = Annotated[tuple[Real, Real, Real, Real], BeforeValidator(as_list)]
Name = Annotated[str, Field(min_length=1, max_length=MOST_CHARACTERS), AfterValidator(checked_name)]
Pair = tuple[Name, Name]
VectorPair = Annotated[tuple[VectorValue, VectorValue], BeforeValidator(as_list)]
Reals = Annotated[tuple[Real, ...], Field(min_length=1), BeforeValidator(as_list)]

# numbers in SI units, or texts such as "300 mm"
Length = Annotated[Real, unit_of("length")]
Extent = Annotated[NotNegative, unit_of("length")]
PositiveLength = Annotated[Positive, unit_of("length")]
Angle = Annotated[Real, unit_of("angle")]
LengthOrAngle = Annotated[Real, unit_of("length", "angle")]
Measure = Annotated[Real, unit_of()]  # of the coordinate that the entry names, which checks the unit
Measures = Annotated[tuple[Measure, ...], Field(min_length=1), BeforeValidator(as_list)]
Mass = Annotated[Light, unit_of("mass")]
Density = Annotated[Positive, unit_of("density")]
Speed = Annotated[Real, unit_of("velocity")]
AngularSpeed = Annotated[Real, unit_of("angular velocity")]
Acceleration = Annotated[Real, unit_of("acceleration")]
ForceSize = Annotated[Real, unit_of("force")]
MomentSize = Annotated[Real, unit_of("moment")]
Stiffness = Annotated[NotNegative, unit_of("stiffness")]
Damping = Annotated[NotNegative, unit_of("damping")]
TorsionalStiffness = Annotated[NotNegative, unit_of("torsional stiffness")]
TorsionalDamping = Annotated[NotNegative, unit_of("torsional damping")]
RotorInertia = Annotated[NotNegative, unit_of("inertia")]
RotorMass = Annotated[NotNegative, unit_of("mass")]
Time = Annotated[NotNegative, unit_of("time")]
LaterTime = Annotated[Positive, unit_of("time")]
PointValue = Three[Length]
PointPair = Annotated[tuple[PointValue, PointValue], BeforeValidator(as_list)]


def direction(v: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return the vector; raises ValueError if it is zero or too short to be squared."""
    if (length := math.hypot(*v)) == 0:
        raise ValueError("must have a length, got the zero vector")
    checked_length(length)
    return v


class EntryType(ModelType):
    """Class of the classes of entries: faults of an entry made in Python are a SceneError, as in a scene."""

    refusal: Callable[
        [ValidationError, Iterable[str]], Exception
    ]  # which the module of Scene sets, as it knows all entries

    def __call__(cls, *values: Any, **fields: Any) -> Any:
        """Return the entry with these fields; raises SceneError for each fault."""
        try:
            return super().__call__(*values, **fields)
        except ValidationError as error:
            raise EntryType.refusal(error, getattr(cls, "model_fields", ())) from None


class SceneEntry(BaseModel, metaclass=EntryType):
    """Base class of the entries of a scene: a frozen table without unknown fields."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    def __setattr__(self, name: str, value: Any) -> None:
        """Raise AttributeError, because entries are frozen."""
        what = type(self).__name__
        raise AttributeError(
            f"{what}.{name} cannot be set: a {what} is frozen; scene.with_(...) returns a changed copy"
        )
