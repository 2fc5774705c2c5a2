"""Reads tables of other tools as columns in SI units, with any separator, units, and order of columns and
quaternions."""

from __future__ import annotations

import csv
import difflib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from crosscheck.recorded.columns import SI, UNITS, kind_of, names
from mbref.scene import Scene, SceneError

SHORT = {  # last part of a header → column of the scene
    **{a: f"position.{a}" for a in "xyz"},
    **{f"v{a}": f"velocity.{a}" for a in "xyz"},
    **{f"w{a}": f"angular_velocity.{a}" for a in "xyz"},
    **{f"q{a}": f"orientation.{a}" for a in "wxyz"},
}
ORDERS = ("wxyz", "xyzw")
WHOLE = 15  # number of significant digits of a column from which on the table has all digits
LATE = 50.0  # multiples of the scene's duration: later times are probably in another unit


@dataclass(frozen=True)
class Recording:
    """Columns (k,) of a recorded motion at times (k,), SI units.

    ``resolution`` is the last printed digit of each column, in its SI unit. ``ignored`` lists headers that
    are no column of the scene.
    """

    times: np.ndarray
    columns: Mapping[str, np.ndarray]
    resolution: Mapping[str, float] = field(default_factory=dict)
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
    found = {name: table[:, k] * factors[name] for name, k in chosen.items()}
    written = {name: [row[k] for row in cells] for name, k in chosen.items()}
    whole = any(_digits(column) >= WHOLE for name, column in written.items() if name != "time")
    last = {
        name: factors[name] * _last_digit(written[name], table[:, k], whole) for name, k in chosen.items()
    }
    times = _checked_times(found.pop("time"), scene, path)
    if order != "wxyz":
        found = _reordered(found, order)
    ignored = [h for k, h in enumerate(headers) if k not in chosen.values()]
    return Recording(times, found, last, ignored)


def _cells(path: Path) -> tuple[list[str], list[list[str]]]:
    """Return headers and cells of a table; the first line that begins with a number is the first row."""
    text = path.read_text(encoding="utf-8-sig", errors="replace")
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    first = next((k for k, line in enumerate(lines) if re.match(r"[-+.]?\d", line)), len(lines))
    head = lines[first - 1].lstrip("#%! ") if first else ""
    if first == len(lines):
        raise SceneError([f"{path}: has no row of numbers"])
    separator = next((s for s in (";", "\t", ",") if s in lines[first]), None)
    rows = [_split(line, separator) for line in lines[first:]]
    if separator == ";":
        rows = [[cell.replace(",", ".") for cell in row] for row in rows]
    headers = _split(head, separator) if head else []
    count = len(rows[0])
    return (headers if len(headers) == count else [f"column {k + 1}" for k in range(count)]), rows


def _split(line: str, separator: str | None) -> list[str]:
    """Return the cells of a line without quotes; cells are separated by blanks if there is no separator."""
    cells = next(csv.reader([line], delimiter=separator)) if separator else line.split()
    return [cell.strip().strip("\"'") for cell in cells]


def _chosen(
    scene: Scene, headers: list[str], columns: Mapping[str, str], path: Path
) -> tuple[dict[str, int], dict[str, str]]:
    """Return for each column of the scene the number of the table's column, and its unit if a unit is
    given."""
    known, chosen, units = ["time", *names(scene)], {}, {}
    for k, header in enumerate(headers):
        name, unit = _recognised(header, known)
        if name and name not in chosen:
            chosen[name], units[name] = k, unit
    for name, place in columns.items():
        if name not in known:
            near = difflib.get_close_matches(name, known, 1)
            meant = f"; did you mean {near[0]!r}?" if near else ""
            raise SceneError([f"--column {name}: the scene has no such column{meant}"])
        where, _, unit = place.partition(":")
        chosen[name], units[name] = _place(where, headers, name), unit
    if "time" not in chosen:
        raise SceneError([f"{path}: has no column time; --column time=1 gives one"])
    if len(chosen) < 2:
        listed = ", ".join(headers)
        raise SceneError([f"{path}: no column of the scene among {listed}; --column {known[1]}=2 gives one"])
    return chosen, units


def _recognised(header: str, known: Sequence[str]) -> tuple[str, str]:
    """Return column and unit of a header such as ``rod.position.x [mm]`` or ``rod.x``; empty if the header
    names no column of the scene."""
    match = re.fullmatch(r"\s*(.*?)\s*(?:[\[(/]\s*([\w/]*)\s*[\])]?)?\s*", header)
    text, unit = (match[1], match[2] or "") if match else (header, "")
    if text.lower() in ("t", "time"):
        return "time", unit
    for name in known:
        if text.lower() == name.lower():
            return name, unit
    body, _, last = text.rpartition(".")
    full = f"{body}.{SHORT[last.lower()]}" if last.lower() in SHORT else ""
    return next((name for name in known if name.lower() == full.lower()), ""), unit


def _place(where: str, headers: Sequence[str], name: str) -> int:
    if where in headers:
        return headers.index(where)
    if where.isdecimal() and 1 <= int(where) <= len(headers):
        return int(where) - 1
    raise SceneError([f"--column {name}: no column {where!r}; columns: {', '.join(headers)}"])


def _factor(name: str, own: str, units: Sequence[str]) -> float:
    """Return the factor to SI, from the column's own unit or from the unit given for its quantity."""
    dimension = SI["time" if name == "time" else kind_of(name)]
    if own and own not in UNITS:
        raise SceneError([f"column {name}: unknown unit {own!r}; known: {', '.join(filter(None, UNITS))}"])
    fitting = [u for u in units if _dimension(u) == dimension]
    unit = own or (fitting[-1] if fitting else "")
    if unit and _dimension(unit) != dimension:
        raise SceneError([f"column {name}: {unit!r} is not a unit of a quantity in {dimension}"])
    return UNITS[unit]


def _dimension(unit: str) -> str:
    """Return the SI unit of a unit's quantity."""
    for si, known in (
        ("s", ("s", "ms", "min")),
        ("m", ("m", "mm", "cm", "um", "in", "ft")),
        ("rad", ("rad", "deg", "rev")),
        ("m/s", ("m/s", "mm/s", "cm/s")),
        ("rad/s", ("rad/s", "deg/s", "rpm")),
        ("1", ("1",)),
    ):
        if unit in known:
            return si
    raise SceneError([f"unknown unit {unit!r}; known: {', '.join(filter(None, UNITS))}"])


def _numbers(rows: Sequence[Sequence[str]], count: int, path: Path) -> np.ndarray:
    found = np.empty((len(rows), count))
    for i, row in enumerate(rows):
        try:
            numbers = [float(cell) for cell in row]
        except ValueError:
            numbers = []
        if len(numbers) != count:
            raise SceneError([f"{path}: row {i + 1} of numbers is not {count} numbers"])
        found[i] = numbers
    if not np.isfinite(found).all():
        raise SceneError([f"{path}: row {int(np.argwhere(~np.isfinite(found))[0, 0]) + 1} is not finite"])
    return found


def _digits(cells: Sequence[str]) -> int:
    """Return the largest number of significant digits in a column."""
    return max(len(re.sub(r"[eE].*", "", cell).replace(".", "").lstrip("+-0")) for cell in cells)


def _last_digit(cells: Sequence[str], numbers: np.ndarray, whole: bool) -> float:
    """Return the coarsest last digit of a column. Numbers of a table that is written with all digits
    (``whole``) are rounded by the arithmetic alone: a column with 1.5 in each row has the number 1.5.
    """
    size = float(np.abs(numbers).max(initial=0.0))
    if whole or not size:
        return float(np.finfo(float).eps * size)
    point = [len(re.sub(r"[eE].*", "", c).partition(".")[2]) for c in cells]
    powers = [int((re.search(r"[eE]([-+]?\d+)", c) or ["", "0"])[1]) for c in cells]
    return float(max(10.0 ** (power - p) for power, p in zip(powers, point, strict=True)))


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


def _reordered(columns: dict[str, np.ndarray], order: str) -> dict[str, np.ndarray]:
    """Return columns in which the quaternion components are named by their place in the table's order."""
    if order not in ORDERS:
        raise SceneError([f"--quaternion: must be one of {', '.join(ORDERS)}, got {order!r}"])
    rename = dict(zip(ORDERS[0], order, strict=True))
    return {f"{n[:-1]}{rename[n[-1]]}" if kind_of(n) == "orientation" else n: v for n, v in columns.items()}
