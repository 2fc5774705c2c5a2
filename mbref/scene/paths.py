"""Paths to the fields of a scene, such as ``body[rod].mass``, ``joint[0].anchor[1]`` or ``gravity.y``."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from mbref.scene.fields import SceneEntry, meant
from mbref.scene.validation import SceneError

VECTOR_COMPONENTS = ("x", "y", "z")  # of a vector
PATH_STEP = re.compile(r"\.?([A-Za-z_]\w*)|\[([^\]]+)\]")


def replaced_at(fields: Mapping[str, Any], path: str, change: Callable[[Any], Any]) -> dict[str, Any]:
    """Return the fields of a scene with the value at a path changed; tables along the path become
    dictionaries.

    An entry is given by its index or its name, a driver by the name of its joint. Raises SceneError if the
    path does not exist.
    """
    first, *rest = _steps(fields, path)
    return {**fields, first: _replaced(fields[first], rest, change, path)}


def located_at(fields: Mapping[str, Any], path: str) -> tuple[Any, tuple[str | int, ...]]:
    """Return the value of a scene at a path, and the fields and indices that lead to it, which are equal for
    all paths to one number; rows of a periodic table count by their first period. Raises SceneError if the
    path does not exist."""
    first, *rest = _steps(fields, path)
    steps: list[str | int] = [first]
    value, period = fields[first], 0
    for step in rest:
        if isinstance(value, tuple):
            place = _place(value, step, path)
            value = value[place]
            steps.append(place % period if period else place)
            period = 0
        else:
            of = _fields_with(step, value, path)
            periodic = step == "table" and of.get("periodic")
            period = (of.get("period_rows") or len(of[step]) - 1) if periodic else 0
            value = of[step]
            steps.append(step)
    return value, tuple(steps)


def _steps(fields: Mapping[str, Any], path: str) -> list[str]:
    """Return the fields and entries along a path."""
    found = [name or entry for name, entry in PATH_STEP.findall(path)]
    if PATH_STEP.sub("", path) or not found or found[0] not in fields:
        raise SceneError([f"{path}: is not a path of a scene, such as body[0].mass or joint[B].anchor[0]"])
    return found


def _replaced(value: Any, steps: Sequence[str], change: Callable[[Any], Any], path: str) -> Any:
    if not steps:
        return change(value)
    step, rest = steps[0], steps[1:]
    if isinstance(value, tuple):
        place = _place(value, step, path)
        return tuple(_replaced(v, rest, change, path) if i == place else v for i, v in enumerate(value))
    fields = _fields_with(step, value, path)
    if step == "table" and not rest and fields.get("period_rows"):
        return {**fields, step: change(fields[step]), "period_rows": None}  # another table has another period
    if step == "table" and rest and fields.get("periodic"):
        period = fields.get("period_rows") or len(fields[step]) - 1
        return {**fields, step: _in_all_periods(fields[step], period, rest, change, path)}
    return {**fields, step: _replaced(fields[step], rest, change, path)}


def _in_all_periods(
    table: tuple[Any, ...], period: int, steps: Sequence[str], change: Callable[[Any], Any], path: str
) -> tuple[Any, ...]:
    """Return the rows [time, value] of a periodic table with one row, or a number in it, changed in all
    periods of ``period`` rows, and at both ends of a period."""
    place = _place(table, steps[0], path)
    changed = _replaced(table[place], steps[1:], change, path)
    if not isinstance(changed, tuple):  # a mark, or a row that is given as a list
        return tuple(changed if k == place else row for k, row in enumerate(table))
    time, value = changed
    return tuple(
        (_later(time, row[0], table[place][0]), value) if (k - place) % period == 0 else row
        for k, row in enumerate(table)
    )


def _later(time: Any, own: float, before: float) -> Any:
    """Return the changed time (s) of a row, moved from the time before of the changed row to its own; a time
    that is no number stays."""
    return time + (own - before) if isinstance(time, int | float) else time


def _fields_of(value: Any) -> Mapping[str, Any]:
    """Return the fields of an entry; an entry that was changed before is a dictionary, and a number has no
    fields."""
    return dict(value) if isinstance(value, dict | SceneEntry) else {}


def _fields_with(step: str, value: Any, path: str) -> Mapping[str, Any]:
    """Return the fields of an entry; raises SceneError if the step of a path is none of them."""
    fields = _fields_of(value)
    if step not in fields:
        raise SceneError([f"{path}: the scene has no {step!r} there{meant(step, fields)}"])
    return fields


def _place(entries: tuple[Any, ...], step: str, path: str) -> int:
    """Return the index for a step of a path: a number, or the name of the entry (for a driver its joint's
    name)."""
    tables = [vars(e) if isinstance(e, SceneEntry) else _fields_of(e) for e in entries]
    names = [table.get("name") or table.get("joint") for table in tables]
    if step in names:
        return names.index(step)
    if step.isdigit() and int(step) < len(entries):
        return int(step)
    if step in VECTOR_COMPONENTS and len(entries) == len(VECTOR_COMPONENTS) and not any(tables):
        return VECTOR_COMPONENTS.index(step)
    named = [name for name in names if isinstance(name, str)]
    raise SceneError([f"{path}: the scene has no {step!r} there{meant(step, named)}"])
