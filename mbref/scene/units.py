"""Numbers with a unit, such as "300 mm" or "30 deg", as SI numbers."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from typing import Any, Literal

Dimension = Literal["length", "angle"]
UNITS: dict[Dimension, dict[str, float]] = {  # name → factor to m or rad
    "length": {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "um": 1e-6, "km": 1e3, "in": 0.0254, "ft": 0.3048},
    "angle": {"rad": 1.0, "deg": math.pi / 180, "°": math.pi / 180, "mrad": 1e-3, "rev": 2 * math.pi},
}
NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S*)\s*")


def in_si(text: str, dimension: Dimension) -> float:
    """Return a number with a unit of length or angle in m or rad.

    Raises ValueError for a text that is no number with a unit of the wanted dimension.
    """
    known, match = UNITS[dimension], NUMBER.fullmatch(text)
    if match and match[2] in known:
        return float(match[1]) * known[match[2]]
    example = "300 mm" if dimension == "length" else "30 deg"
    wrong = match[2] if match else ""
    units = f"; {wrong!r} is no unit of {dimension}, known: {', '.join(known)}" if wrong else ""
    raise ValueError(f'must be a number, or one with a unit, such as "{example}", got {text[:80]!r}{units}')


def length(value: Any) -> Any:
    """Return a text such as "300 mm" in m; every other value as it is."""
    return in_si(value, "length") if isinstance(value, str) else value


def angle(value: Any) -> Any:
    """Return a text such as "30 deg" in rad; every other value as it is."""
    return in_si(value, "angle") if isinstance(value, str) else value


def length_or_angle(value: Any) -> Any:
    """Return a text with a unit of length or angle in m or rad; every other value as it is."""
    return in_si(value, dimension_of(value) or "angle") if isinstance(value, str) else value


def dimension_of(text: Any) -> Dimension | None:
    """Return the dimension of a text such as "300 mm"; None if the text is no number with a known unit."""
    match = NUMBER.fullmatch(text) if isinstance(text, str) else None
    return next((d for d, known in UNITS.items() if match and match[2] in known), None)


def echoed(data: Any, path: str = "") -> Iterator[str]:
    """Yield ``body[0].position[0]: 300 mm = 0.3 m`` for each number with a unit in the nested tables of a
    file."""
    if dimension := dimension_of(data):
        unit = "m" if dimension == "length" else "rad"
        yield f"{path}: {data.strip()} = {in_si(data, dimension):.6g} {unit}"
    elif isinstance(data, Mapping):
        for key, value in data.items():
            yield from echoed(value, f"{path}.{key}" if path else str(key))
    elif isinstance(data, list):
        for k, value in enumerate(data):
            name = value.get("name") or value.get("joint") if isinstance(value, Mapping) else None
            yield from echoed(value, f"{path}[{name or k}]")
