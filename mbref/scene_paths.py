"""Paths to the fields of a scene, such as ``body[rod].mass`` or ``joint[0].anchor[1]``."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from mbref.scene_validation import SceneError

STEP = re.compile(r"\.?([A-Za-z_]\w*)|\[([^\]]+)\]")


def replaced_at(fields: Mapping[str, Any], path: str, change: Callable[[Any], Any]) -> dict[str, Any]:
    """The fields of a scene with the value at a path changed; tables on the way become dictionaries.

    An entry is named by its place or its name (a driver by its joint's).  Raises SceneError where the path
    leads nowhere.
    """
    first, *rest = _steps(fields, path)
    return {**fields, first: _replaced(fields[first], rest, change, path)}


def _steps(fields: Mapping[str, Any], path: str) -> list[str]:
    """The fields and entries that a path leads through."""
    found = [name or entry for name, entry in STEP.findall(path)]
    if STEP.sub("", path) or not found or found[0] not in fields:
        raise SceneError([f"{path}: is not a path of a scene, such as body[0].mass or joint[B].anchor[0]"])
    return found


def _replaced(value: Any, steps: Sequence[str], change: Callable[[Any], Any], path: str) -> Any:
    if not steps:
        return change(value)
    step, rest = steps[0], steps[1:]
    if isinstance(value, tuple):
        place = _place(value, step, path)
        return tuple(_replaced(v, rest, change, path) if i == place else v for i, v in enumerate(value))
    if step not in getattr(type(value), "model_fields", {}):
        raise SceneError([f"{path}: the scene has no {step!r} there"])
    fields = {field: getattr(value, field) for field in type(value).model_fields}
    return {**fields, step: _replaced(fields[step], rest, change, path)}


def _place(entries: tuple[Any, ...], step: str, path: str) -> int:
    """The index that a step names: a number, or the name of the entry (a driver has its joint's)."""
    names = [getattr(entry, "name", getattr(entry, "joint", None)) for entry in entries]
    if step in names:
        return names.index(step)
    if step.isdigit() and int(step) < len(entries):
        return int(step)
    raise SceneError([f"{path}: the scene has no {step!r} there"])
