"""Units: numbers with a unit, such as "300 mm" or "5 N mm s/rad", as SI numbers, and units of outputs.

A unit is a product of names with powers; each ``/`` divides by the next name: ``kg mm^2``, ``N s/m``.
Radians count as a dimension, so that an angle is no pure number and ``N m/rad`` is no torque.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from decimal import Decimal
from typing import Any, Literal, NamedTuple

Quantity = Literal[
    "length",
    "angle",
    "mass",
    "inertia",
    "time",
    "velocity",
    "angular velocity",
    "acceleration",
    "force",
    "moment",
    "stiffness",
    "damping",
    "torsional stiffness",
    "torsional damping",
    "density",
]
Dimension = tuple[int, int, int, int]  # powers of kg, m, s, rad

PI = Decimal("3.14159265358979323846264338327950288")
SI_UNITS: dict[str, Dimension] = {
    "kg": (1, 0, 0, 0),
    "m": (0, 1, 0, 0),
    "s": (0, 0, 1, 0),
    "rad": (0, 0, 0, 1),
    "1": (0, 0, 0, 0),
    "N": (1, 1, -2, 0),
    "J": (1, 2, -2, 0),
    "W": (1, 2, -3, 0),
}
OTHER_UNITS: dict[str, dict[str, Decimal]] = {  # SI unit → names of other units with their factors
    "m": {
        "mm": Decimal("1e-3"),
        "cm": Decimal("1e-2"),
        "um": Decimal("1e-6"),
        "km": Decimal("1e3"),
        "in": Decimal("0.0254"),
        "ft": Decimal("0.3048"),
    },
    "rad": {"deg": PI / 180, "°": PI / 180, "mrad": Decimal("1e-3"), "rev": 2 * PI},
    "kg": {"g": Decimal("1e-3"), "mg": Decimal("1e-6"), "t": Decimal("1e3"), "lb": Decimal("0.45359237")},
    "s": {"ms": Decimal("1e-3"), "us": Decimal("1e-6"), "min": Decimal(60), "h": Decimal(3600)},
    "rad/s": {"rpm": PI / 30, "Hz": 2 * PI},
    "N": {"kN": Decimal("1e3"), "mN": Decimal("1e-3"), "lbf": Decimal("4.4482216152605")},
    "N m": {"Nm": Decimal(1), "Nmm": Decimal("1e-3")},
    "J": {"mJ": Decimal("1e-3"), "kJ": Decimal("1e3")},
    "W": {"mW": Decimal("1e-3"), "kW": Decimal("1e3")},
}
QUANTITIES: dict[Quantity, tuple[str, str]] = {  # quantity → its SI unit, an example
    "length": ("m", "300 mm"),
    "angle": ("rad", "30 deg"),
    "mass": ("kg", "500 g"),
    "inertia": ("kg m²", "300 kg mm^2"),
    "time": ("s", "20 ms"),
    "velocity": ("m/s", "30 mm/s"),
    "angular velocity": ("rad/s", "60 rpm"),
    "acceleration": ("m/s²", "9810 mm/s^2"),
    "force": ("N", "2 kN"),
    "moment": ("N m", "500 N mm"),
    "stiffness": ("N/m", "2 N/mm"),
    "damping": ("N s/m", "5 N s/mm"),
    "torsional stiffness": ("N m/rad", "20 N mm/deg"),
    "torsional damping": ("N m s/rad", "5 N mm s/rad"),
    "density": ("kg/m³", "7.85 g/cm^3"),
}
NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*((?:[^\d\s].*?)?)\s*")
UNIT_FACTOR = re.compile(r"([^\W\d_²³]+|°|1)(?:\^?(-?\d)|([²³]))?")
SUPERSCRIPTS = {"²": 2, "³": 3}
LONGEST_UNIT = 40  # characters of a unit
NAMES = ("name", "type", "joint", "joints", "body", "bodies", "ground", "coordinates")  # fields of names


class Unit(NamedTuple):
    """A unit: its factor to SI, its dimension, and the SI unit of its form ("N/m" of "N/mm")."""

    factor: Decimal
    dimension: Dimension
    si: str


ATOMS = {name: Unit(Decimal(1), dimension, name) for name, dimension in SI_UNITS.items()}


def unit(text: str) -> Unit:
    """Return the unit of a text such as "N mm s/rad"; raises ValueError that names the unknown part."""
    if len(text) > LONGEST_UNIT:
        raise ValueError(f"a unit has at most {LONGEST_UNIT} characters")
    product, *divisors = text.replace("**", "^").split("/")
    words = [(word, 1) for word in re.split(r"[\s*·]+", product.strip())]
    factor, dimension = Decimal(1), (0, 0, 0, 0)
    for word, sign in [*words, *((divisor.strip(), -1) for divisor in divisors)]:
        match = UNIT_FACTOR.fullmatch(word)
        if not match or match[1] not in ATOMS:
            raise ValueError(f"{word[:LONGEST_UNIT]!r} is no unit")
        atom, power = ATOMS[match[1]], sign * int(SUPERSCRIPTS.get(match[3], match[2] or 1))
        factor *= atom.factor**power
        dimension = _sum(dimension, atom.dimension, power)
    return Unit(factor, dimension, _si_text(text))


def _sum(a: Dimension, b: Dimension, power: int) -> Dimension:
    kg, m, s, rad = (x + power * y for x, y in zip(a, b, strict=True))
    return kg, m, s, rad


def _si_text(text: str) -> str:
    """Return a unit with every name replaced by its SI unit, powers as superscripts."""
    plain = re.sub(r"[^\W\d_²³]+|°", lambda name: ATOMS[name[0]].si, re.sub(r"\*+|·", " ", text))
    return re.sub(r"\^?([23])\b", lambda power: "²³"[int(power[1]) - 2], plain)


ATOMS |= {
    name: Unit(factor, unit(si).dimension, si)
    for si, others in OTHER_UNITS.items()
    for name, factor in others.items()
}
DIMENSIONS = {quantity: unit(si).dimension for quantity, (si, _) in QUANTITIES.items()}


def dimension_of(value: Any) -> Dimension | None:
    """Return the dimension of a text such as "300 mm"; None if the value is no number with a known unit."""
    match = NUMBER.fullmatch(value) if isinstance(value, str) else None
    try:
        return unit(match[2]).dimension if match else None
    except ValueError:
        return None


def fits(value: Any, quantity: Quantity | None, per_seconds: int = 0) -> bool:
    """Return whether a value has no unit, or a unit of the quantity, also divided by a power of seconds;
    without quantity whether it has none."""
    dimension = dimension_of(value)
    if dimension is None or quantity is None:
        return dimension is None
    whole = DIMENSIONS[quantity]
    return dimension in (whole, _sum(whole, SI_UNITS["s"], -per_seconds))


def in_si(text: str, *quantities: Quantity) -> float:
    """Return a number with a unit of one of the quantities as an SI number, rounded once.

    Without quantities, every unit is allowed.  Raises ValueError for a text that is no such number.
    """
    match, dimension = NUMBER.fullmatch(text), dimension_of(text)
    wanted = [DIMENSIONS[quantity] for quantity in quantities]
    if match and dimension is not None and (not quantities or dimension in wanted):
        return _rounded(match[1], unit(match[2]).factor)
    example = QUANTITIES[quantities[-1] if quantities else "angle"][1]
    wrong = match[2] if match else ""
    kind = f"no unit of {' or '.join(quantities)}" if quantities else "no unit"
    known = ", ".join(name for name, atom in ATOMS.items() if atom.dimension in wanted)
    why = f"; {wrong!r} is {kind}{f', known: {known}' * bool(known)}" if wrong else ""
    raise ValueError(f'must be a number, or one with a unit, such as "{example}", got {text[:80]!r}{why}')


def _rounded(number: str, factor: Decimal) -> float:
    """Return number times factor; the decimal product has more digits than double precision."""
    value = float(number)
    return value if value == 0.0 or math.isinf(value) else float(Decimal(number) * factor)


def number_in(*quantities: Quantity) -> Callable[[Any], Any]:
    """Return a function that returns a text with a unit as an SI number, and every other value as it is."""
    return lambda value: in_si(value, *quantities) if isinstance(value, str) else value


def echoed(data: Any, path: str = "") -> Iterator[str]:
    """Yield ``body[0].position[0]: 300 mm = 0.3 m`` for each number with a unit in the nested tables of a
    file."""
    if (match := NUMBER.fullmatch(data) if isinstance(data, str) else None) and dimension_of(data):
        yield f"{path}: {data.strip()} = {in_si(data):.6g} {unit(match[2]).si}"
    elif isinstance(data, Mapping):
        for key, value in data.items():
            if key not in NAMES or (isinstance(value, list) and isinstance((*value, "")[0], Mapping)):
                yield from echoed(value, f"{path}.{key}" if path else str(key))
    elif isinstance(data, list):
        for k, value in enumerate(data):
            name = value.get("name") or value.get("joint") if isinstance(value, Mapping) else None
            yield from echoed(value, f"{path}[{name or k}]")


def in_output_unit(si: str, wanted: Sequence[str]) -> tuple[str, float]:
    """Return the unit of an output with its size in SI: a wanted unit of that form, or the SI unit with its
    names replaced by wanted units, such as "mm/s" of "m/s"; rates stay per second."""
    by_form = {unit(name).si: name for name in wanted}
    if not si or " or " in si:  # no unit, or rows of several units
        return si, 1.0
    per_second = {**by_form, "s": "s"}
    name = by_form.get(si) or re.sub(r"[^\W\d_²³]+", lambda name: per_second.get(name[0], name[0]), si)
    return name, float(unit(name).factor)
