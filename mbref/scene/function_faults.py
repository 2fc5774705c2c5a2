"""Faults of functions of time that concern several fields: gaps of tables, and units."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from mbref.scene.fields import LARGEST, field_of
from mbref.scene.units import dimension_of, in_si

Faults = Iterator[tuple[str, str]]  # path and message


def factor_faults(path: str, factor: Any, data: Mapping[str, Any]) -> Faults:
    """Return the faults of a load's factor: an amplitude with a unit, or a table with a gap."""
    if dimension_of(amplitude := field_of(field_of(factor, "sine"), "amplitude")) is not None:
        yield f"{path}.sine.amplitude", f"multiplies the load, so it has no unit, got {amplitude!r}"
    start, stop = _number(field_of(factor, "start")), _number(field_of(factor, "stop")) or math.inf
    yield from table_faults(f"{path}.table", factor, data, start, stop)


def table_faults(path: str, function: Any, data: Mapping[str, Any], start: float, stop: float) -> Faults:
    """Return the fault of a table that does not cover the times (s) in which its function acts."""
    rows, duration = rows_of(function), field_of(data, "duration")
    if not rows:
        return
    end = min(stop, _number(1.0 if duration is None else duration))
    if rows[0][0] > start:
        yield path, f"leaves a gap: its first row is at {rows[0][0]:g} s, but it acts from {start:g} s on"
    if rows[-1][0] < end:
        yield path, f"leaves a gap: its last row is at {rows[-1][0]:g} s, but it acts until {end:g} s"


def rows_of(function: Any) -> list[tuple[float, float]]:
    """Return the rows of a table; no rows if a row is faulty."""
    table = field_of(function, "table")
    given = list(table) if isinstance(table, list | tuple) else []
    rows = [tuple(row) for row in given if isinstance(row, list | tuple) and len(row) == 2]
    numbers = all(isinstance(x, int | float) for row in rows for x in row)
    return rows if numbers and len(rows) == len(given) else []


def _number(value: Any) -> float:
    """Return a number that a scene can contain; 0 for any other value, which is reported as a fault of its
    field."""
    if dimension := dimension_of(value):
        value = in_si(value, dimension)
    return float(value) if isinstance(value, int | float) and abs(value) <= LARGEST else 0.0
