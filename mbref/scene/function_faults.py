"""Faults of functions of time that concern several fields: gaps of tables, and units."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from mbref.scene.fields import LARGEST, field_of
from mbref.scene.functions import MOST_PERIODS
from mbref.scene.joints import JOINT_TYPES
from mbref.scene.units import Quantity, dimension_of, fits, in_si

QUANTITY_OF: dict[str, Quantity] = {"angle": "angle", "displacement": "length"}  # of a coordinate
Faults = Iterator[tuple[str, str]]  # path and message


def factor_faults(path: str, factor: Any, data: Mapping[str, Any]) -> Faults:
    """Return the faults of a load's factor: a value with a unit, or a table with a gap."""
    rows = enumerate(map(listed, listed(field_of(factor, "table"))))
    values = [(f"table[{k}][1]", row[1]) for k, row in rows if len(row) == 2]
    for field, value in [("sine.amplitude", field_of(field_of(factor, "sine"), "amplitude")), *values]:
        if not fits(value, None):
            yield f"{path}.{field}", f"multiplies the load, so it has no unit, got {value!r}"
    start, stop = _number(field_of(factor, "start")), _number(field_of(factor, "stop")) or math.inf
    yield from table_faults(f"{path}.table", factor, data, start, stop)


def table_faults(path: str, function: Any, data: Mapping[str, Any], start: float, stop: float) -> Faults:
    """Return the fault of a table that does not cover the times (s) in which its function acts."""
    rows, duration = rows_of(function), field_of(data, "duration")
    if not rows:
        return
    until = _number(1.0 if duration is None else duration)
    end = min(stop, until)
    if rows[0][0] > start:
        yield path, f"leaves a gap: its first row is at {rows[0][0]:g} s, but it acts from {start:g} s on"
    if field_of(function, "periodic"):
        period = rows[-1][0] - rows[0][0]
        if period > 0.0 and (until - rows[0][0]) / period > MOST_PERIODS:
            yield (
                path,
                f"has {until / period:.3g} periods of {period:g} s; at most {MOST_PERIODS} are repeated",
            )
    elif rows[-1][0] < end:
        yield path, f"leaves a gap: its last row is at {rows[-1][0]:g} s, but it acts until {end:g} s"


def unit_faults(path: str, driver: Any, joint: Any) -> Faults:
    """Yield faults of units that do not fit the coordinate that a driver prescribes."""
    driven = JOINT_TYPES[joint].facts.driven if joint in JOINT_TYPES else None
    yield from _faults_of_units(path, driver, driven, f"a {joint} joint")


def turn_faults(path: str, turn: Any) -> Faults:
    """Yield faults of units that are none of an angle."""
    yield from _faults_of_units(path, turn, "angle", "a turn")


def _faults_of_units(path: str, driver: Any, driven: str | None, of: str) -> Faults:
    quantity = QUANTITY_OF.get(str(driven))
    found = [("sine.amplitude", field_of(field_of(driver, "sine"), "amplitude"), 0)]
    found += [(f"polynomial[{k}]", term, k) for k, term in enumerate(listed(field_of(driver, "polynomial")))]
    rows = enumerate(map(listed, listed(field_of(driver, "table"))))
    found += [(f"table[{k}][1]", row[1], 0) for k, row in rows if len(row) == 2]
    for field, value, power in found:
        if quantity and not fits(value, quantity, power):
            over = f", also over s^{power}" * bool(power)
            yield (
                f"{path}.{field}",
                f"prescribes the {driven} of {of}, a unit of {quantity}{over}, got {value!r}",
            )


def listed(value: Any) -> list[Any]:
    """Return a list or tuple as a list; an empty one for any other value."""
    return list(value) if isinstance(value, list | tuple) else []


def rows_of(function: Any) -> list[tuple[float, float]]:
    """Return the rows of a table; no rows if a row is faulty."""
    given = listed(field_of(function, "table"))
    rows = [tuple(map(_si, row)) for row in given if isinstance(row, list | tuple) and len(row) == 2]
    numbers = all(isinstance(x, int | float) for row in rows for x in row)
    return rows if numbers and len(rows) == len(given) else []


def _number(value: Any) -> float:
    """Return a number that a scene can contain; 0 for any other value, which is reported as a fault of its
    field."""
    value = _si(value)
    return float(value) if isinstance(value, int | float) and abs(value) <= LARGEST else 0.0


def _si(value: Any) -> Any:
    """Return a number with a unit in SI units; every other value as it is."""
    return in_si(value) if dimension_of(value) else value
