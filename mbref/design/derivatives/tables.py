"""Tables of columns of numbers, from a file or a mapping."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from mbref.files import content
from mbref.input_error import InputError

NumberTable = Mapping[str, np.ndarray] | str | Path


def columns_of_numbers(given: NumberTable, what: str) -> dict[str, np.ndarray]:
    """Return the columns (k,) of a table, with NaN for empty cells; ``what`` names it in messages.

    Raises InputError for a table that is not of numbers, that has a column twice or of another length, or
    names with units.
    """
    if not isinstance(given, Mapping):
        given = _read(given)
    found = {name: np.asarray(values, dtype=float) for name, values in given.items()}
    if named := next((name for name in found if name.endswith("]")), None):
        raise InputError(f"{what}: column {named!r} has a unit; give SI units, and names without units")
    if len({values.shape for values in found.values()}) > 1:
        raise InputError(f"{what}: needs columns of equal lengths")
    return found


def _read(path: str | Path) -> dict[str, np.ndarray]:
    """Return the columns of a CSV file with a line of their names: with commas between numbers, or with ``;``
    and decimal commas or points."""
    lines = [line for line in content(path).decode("utf-8-sig").splitlines() if line.strip()]
    mark = ";" if lines and ";" in lines[0] else ","
    names, *rows = [*csv.reader(lines, delimiter=mark)] or [[]]
    names = [name.strip() for name in names]
    if uneven := [k for k, row in enumerate(rows, 1) if len(row) != len(names)]:
        raise InputError(f"{path}: row {uneven[0]} of the numbers needs {len(names)} of them")
    try:
        cells = [[cell.strip() or "nan" for cell in row] for row in rows]
        decimal = [[cell.replace(",", ".") for cell in row] if mark == ";" else row for row in cells]
        table = np.array(decimal, dtype=float).reshape(len(rows), len(names))
    except ValueError as fault:
        raise InputError(f"{path}: needs a line of names, and lines of numbers: {fault}") from None
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{path}: has the column {name!r} twice; remove one")
    return dict(zip(names, table.T, strict=True))


def refuse_not_finite(columns: Mapping[str, np.ndarray], what: str) -> None:
    """Raise InputError for the first number of columns (k,) that is not finite."""
    for name, values in columns.items():
        for row in np.flatnonzero(~np.isfinite(values)):
            raise InputError(f"{what}: {name} is {values[row]} in row {row + 1} of the numbers")
