"""Columns of a motion in requested units, such as mm and degrees."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mbref.input_error import InputError
from mbref.motions.outputs import UNIT_OF, quantity_of
from mbref.scene.units import ATOMS, in_output_unit, unit

TIME = "s"


def requested_units(text: str) -> tuple[str, ...]:
    """Return the units in a text such as "mm,deg"; raises InputError for an unknown unit, or two of one
    quantity."""
    names = tuple(filter(None, map(str.strip, text.split(","))))
    forms = {
        si for output in (TIME, *UNIT_OF.values()) for si in (output, *output.split("/"), *output.split())
    }
    chosen: dict[str, str] = {}
    for name in names:
        try:
            si = unit(name).si
        except ValueError:
            raise InputError(f"units: {name!r} is no unit; known: {', '.join(ATOMS)}") from None
        if si not in forms:
            raise InputError(f"units: no number of a motion is in {si}, got {name!r}")
        if si in chosen:
            raise InputError(f"units: {chosen[si]!r} and {name!r} are units of one quantity")
        chosen[si] = name
    return names


def unit_of_column(column: str, units: Sequence[str] = ()) -> tuple[str, float]:
    """Return the unit of a column for requested units, and its size in SI units."""
    return in_output_unit(TIME if column == "time" else UNIT_OF[quantity_of(column)], units)


def in_units(columns: Mapping[str, np.ndarray], text: str) -> dict[str, np.ndarray]:
    """Return columns (k,) in requested units, under names with a unit, such as ``rod.position.x [mm]``."""
    units, found = requested_units(text), {}
    for column, values in columns.items():
        name, size = unit_of_column(column, units)
        found[f"{column} [{name}]" if name else column] = values / size
    return found
