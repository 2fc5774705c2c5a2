"""Reads tables of other tools as columns in SI units, with any separator, units, and order of columns and
quaternions."""

from __future__ import annotations

import codecs
import csv
import difflib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from crosscheck.recorded.columns import SI, kind_of, names
from crosscheck.recorded.number_formats import half_units, number
from mbref.files import content
from mbref.scene import Scene, SceneError
from mbref.scene.units import ATOMS, Unit, unit

SHORT = {  # last part of a header → column of the scene
    **{a: f"position.{a}" for a in "xyz"},
    **{f"v{a}": f"velocity.{a}" for a in "xyz"},
    **{f"w{a}": f"angular_velocity.{a}" for a in "xyz"},
    **{f"q{a}": f"orientation.{a}" for a in "wxyz"},
}
# a cell of a number alone, also of one that is not finite, in which a comma may be the decimal point
FIRST_CELL = re.compile(
    r"([\"']?)[-+]?((\d+[.,]?\d*|[.,]\d+)([eEdD][-+]?\d+)?|nan|inf(inity)?)\1\s*([;,\s]|$)", re.IGNORECASE
)
# name and unit: rod.x [mm], rod.x (mm), rod.x/mm
HEADER = re.compile(r"\s*(.*?)\s*(?:[\[(]\s*([^\[\]()]*?)\s*[\])]?|/\s*([\w/ *^]*?))?\s*")
NO_UNIT = "-"  # in brackets, as in rod.qw [-]
INFINITE = ("inf", "infinity")
ORDERS = ("wxyz", "xyzw")
LONGEST = 1000  # characters of a cell; the longest decimal number of double precision has 770 digits
LATE = 50.0  # multiples of the scene's duration: later times are probably in another unit


@dataclass(frozen=True)
class Recording:
    """Columns (k,) of a recorded motion at times (k,), SI units.

    ``rounding`` (k,) is half a unit of the last digit of each cell, in SI units, of columns and of ``time``;
    columns without rounding are exact. ``digits`` is the number of significant digits of the largest cell of
    each column. ``ignored`` lists headers that are no column of the scene.
    """

    times: np.ndarray
    columns: Mapping[str, np.ndarray]
    rounding: Mapping[str, np.ndarray] = field(default_factory=dict)
    digits: Mapping[str, int] = field(default_factory=dict)
    ignored: Sequence[str] = ()


def read(
    path: Path, scene: Scene, columns: Mapping[str, str], units: Sequence[str] = (), order: str = "wxyz"
) -> Recording:
    """Return the motion recorded in a table.

    ``columns`` maps a column of the scene, or ``time``, to the number (from 1) or header of a column in the
    table. The suffix ``:unit`` names a unit that is not SI.  ``units`` hold for all columns of their
    quantity.  Raises SceneError for an unknown column or unit, or rows without numbers; OSError.
    """
    headers, cells = _cells(path)
    chosen, given = _chosen(scene, headers, columns, path)
    table = _numbers(cells, len(headers), path)
    factors = {name: _factor(name, given.get(name, ""), units) for name in chosen}
    with np.errstate(over="ignore"):
        found = {name: table[:, k] * factors[name] for name, k in chosen.items()}
    for name, column in found.items():
        if not np.isfinite(column).all():
            raise SceneError([f"{path}: column {name}: numbers are too large for its unit"])
    halves = half_units({name: [row[k] for row in cells] for name, k in chosen.items()})
    digits = {name: _digits(table[:, k], halves[name]) for name, k in chosen.items()}
    rounding = {name: half * factors[name] for name, half in halves.items()}
    times = _checked_times(found.pop("time"), scene, path)
    if order != ORDERS[0]:
        letters = _letters(chosen, order)
        found = {letters.get(name, name): column for name, column in found.items()}
        rounding = {letters.get(name, name): half for name, half in rounding.items()}
        digits = {letters.get(name, name): count for name, count in digits.items()}
    ignored = [h for k, h in enumerate(headers) if k not in chosen.values()]
    return Recording(times, found, rounding, digits, ignored)


def _digits(numbers: np.ndarray, halves: np.ndarray) -> int:
    """Return the number of significant digits of the largest number (k,), rounded to ``halves`` (k,)."""
    k = int(np.argmax(np.abs(numbers)))
    size, unit = abs(float(numbers[k])), 2 * float(halves[k])
    return int(np.floor(np.log10(size)) - np.round(np.log10(unit))) + 1 if size > unit > 0 else 1


def _cells(path: Path) -> tuple[list[str], list[list[str]]]:
    """Return headers and cells of a table; the first line whose first cell is a number is the first row."""
    data = content(path)
    is_wide = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    text = data.decode("utf-16" if is_wide else "utf-8-sig", errors="replace")
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    first = next((k for k, line in enumerate(lines) if FIRST_CELL.match(line)), len(lines))
    head = lines[first - 1].lstrip("#%! ") if first else ""
    if first == len(lines):
        raise SceneError([f"{path}: has no row of numbers"])
    separator = next((s for s in (";", "\t", ",") if s in lines[first]), None)
    try:
        headers, *rows = [_split(line, separator) for line in (head, *lines[first:])]
    except csv.Error as error:
        raise SceneError([f"{path}: is no table of numbers: {error}"]) from None
    if separator == ";":
        rows = [[cell.replace(",", ".") for cell in row] for row in rows]
    count = len(rows[0])
    return (headers if len(headers) == count else [f"column {k + 1}" for k in range(count)]), rows


def _split(line: str, separator: str | None) -> list[str]:
    """Return the cells of a line without quotes; cells are separated by blanks if there is no separator."""
    cells = next(csv.reader([line], delimiter=separator), []) if separator else line.split()
    return [cell.strip().strip("\"'") for cell in cells]


def _chosen(
    scene: Scene, headers: list[str], columns: Mapping[str, str], path: Path
) -> tuple[dict[str, int], dict[str, str]]:
    """Return for each column of the scene the number of the table's column, and its unit if a unit is
    given."""
    known = ["time", *names(scene)]
    full = [_recognised(name, known)[0] or name for name in columns]
    if twice := next((name for name in full if full.count(name) > 1), ""):
        raise SceneError([f"--column {twice}: is given twice; give it one place"])
    columns = dict(zip(full, columns.values(), strict=True))
    chosen: dict[str, int] = {}
    units: dict[str, str] = {}
    for k, header in enumerate(headers):
        name, unit = _recognised(header, known)
        if name in chosen and name not in columns:
            twice = f"{chosen[name] + 1} and {k + 1}"
            raise SceneError(
                [f"{path}: columns {twice} are both {name}; --column {name}={k + 1} chooses the second"]
            )
        if name:
            chosen[name], units[name] = k, unit
    for name, place in columns.items():
        if name not in known:
            near = difflib.get_close_matches(name, known, 1)
            meant = f"; did you mean {near[0]!r}?" if near else ""
            raise SceneError([f"--column {name}: the scene has no such column{meant}"])
        where, _, unit = place.partition(":")
        chosen[name] = _place(where, headers, name)
        units[name] = unit or _own_unit(headers[chosen[name]], name)
    if "time" not in chosen:
        raise SceneError([f"{path}: has no column time; --column time=1 gives one"])
    if len(chosen) < 2:
        listed = ", ".join(headers)
        raise SceneError([f"{path}: no column of the scene among {listed}; --column {known[1]}=2 gives one"])
    return chosen, units


def _recognised(header: str, known: Sequence[str]) -> tuple[str, str]:
    """Return column and unit of a header such as ``rod.position.x [mm]`` or ``rod.x``; empty if the header
    names no column of the scene, or several that differ in the case of letters."""
    match = HEADER.fullmatch(header)
    text, unit = (match[1], match[2] or match[3] or "") if match else (header, "")
    unit = "" if unit == NO_UNIT else unit
    if text.lower() in ("t", "time"):
        return "time", unit
    body, _, last = text.rpartition(".")
    for full in (text, f"{body}.{SHORT.get(last.lower(), last)}"):
        alike = [full] if full in known else [name for name in known if name.lower() == full.lower()]
        if len(alike) == 1:
            return alike[0], unit
    return "", unit


def _own_unit(header: str, name: str) -> str:
    """Return the unit in brackets at the end of a header, such as ``Crank angle [deg]``, if it is a unit of
    the column's quantity; otherwise an empty text: ``r_0[1]`` is a component."""
    match = re.search(r"[\[(]([^\[\]()]*)[\])]\s*$", header)
    try:
        known = unit(match[1].strip()) if match else None
    except ValueError:
        return ""
    is_own = match and known and known.dimension == unit(_si(name)).dimension
    return match[1].strip() if match and is_own else ""


def _place(where: str, headers: Sequence[str], name: str) -> int:
    if where in headers:
        return headers.index(where)
    if where.isdecimal() and 1 <= int(where) <= len(headers):
        return int(where) - 1
    raise SceneError([f"--column {name}: no column {where!r}; columns: {', '.join(headers)}"])


def _factor(name: str, own: str, units: Sequence[str]) -> float:
    """Return the factor to SI, from the column's own unit or from the unit given for its quantity."""
    si = _si(name)
    given = [_unit(own, f"column {name}: ")] if own else []
    known = [*map(_unit, units), *given]
    fitting = [each for each in known if each.dimension == unit(si).dimension]
    if own and fitting[-1:] != given:
        raise SceneError([f"column {name}: {own!r} is not a unit of a quantity in {si}"])
    return float(fitting[-1].factor) if fitting else 1.0


def _si(name: str) -> str:
    """Return the SI unit of a column of the scene or of ``time``."""
    return SI["time" if name == "time" else kind_of(name)]


def _unit(text: str, where: str = "") -> Unit:
    """Return a unit by its name; raises SceneError for an unknown one."""
    try:
        return unit(text)
    except ValueError:
        raise SceneError([f"{where}unknown unit {text!r}; known: {', '.join(ATOMS)}"]) from None


def _numbers(rows: Sequence[Sequence[str]], count: int, path: Path) -> np.ndarray:
    for i, row in enumerate(rows):
        if len(row) != count:
            raise SceneError([f"{path}: row {i + 1} of numbers is not {count} numbers"])
        for k, cell in enumerate(row):
            if len(cell) > LONGEST:
                size = f"{len(cell)} characters; a number has at most {LONGEST}"
                raise SceneError([f"{path}: column {k + 1} of row {i + 1} has {size}"])
    found = np.array([[_number(cell) for cell in row] for row in rows])
    for i, k in np.argwhere(np.isnan(found))[:1]:
        if rows[i][k].lower().lstrip("+-") != "nan":
            raise SceneError([f"{path}: row {i + 1} of numbers is not {count} numbers: {rows[i][k]!r}"])
    if not np.isfinite(found).all():
        raise SceneError([f"{path}: row {int(np.argwhere(~np.isfinite(found))[0, 0]) + 1} is not finite"])
    return found


def _number(cell: str) -> float:
    return float(cell) if cell.lower().lstrip("+-") in INFINITE else number(cell)


def _checked_times(times: np.ndarray, scene: Scene, path: Path) -> np.ndarray:
    if times[0] < 0 or np.any(np.diff(times) <= 0):
        raise SceneError([f"{path}: times must not be negative and must increase"])
    if times[-1] > LATE * scene.duration:
        raise SceneError(
            [
                f"{path}: times end at {times[-1]:g} s, and the scene's duration is {scene.duration:g} s; "
                "--column time=1:ms if they are in ms"
            ]
        )
    return times


def _letters(chosen: Mapping[str, int], order: str) -> dict[str, str]:
    """Return the true name of each quaternion component: the columns of a whole quaternion, from the left to
    the right of the table, have the letters of ``order``; one of a part has the letter of its own place."""
    if order not in ORDERS:
        raise SceneError([f"--quaternion: must be one of {', '.join(ORDERS)}, got {order!r}"])
    found: dict[str, str] = {}
    for body in {name[:-1] for name in chosen if kind_of(name) == "orientation"}:
        own = [f"{body}{letter}" for letter in ORDERS[0] if f"{body}{letter}" in chosen]
        if len(own) == len(order):
            own.sort(key=lambda name: chosen[name])
            found |= {name: f"{body}{letter}" for name, letter in zip(own, order, strict=True)}
        else:
            found |= {name: f"{body}{order[ORDERS[0].index(name[-1])]}" for name in own}
    return found
