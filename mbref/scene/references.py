"""References between the entries of a scene's tables, read from raw data: names, and joints that are able."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mbref.scene.fields import field_of, meant
from mbref.scene.function_faults import Faults, listed
from mbref.scene.joints import JOINT_TYPES

GROUND = "ground"


def entries(data: Mapping[str, Any], key: str) -> list[Any]:
    """Return the entries of a table, such as ``joint``; empty if it is no list."""
    return listed(data.get(key, ()))


def text_of(entry: Any, key: str) -> str:
    """Return a text of an entry, empty if it is missing."""
    return found if isinstance(found := field_of(entry, key), str) else ""


def unknown(what: str, name: str, known: Sequence[str] | set[str]) -> str:
    """Return the message for a name that nothing has, with the known names."""
    sentence = ", ".join(sorted(filter(None, known))) or "none"
    return f"unknown {what} {name!r}; known: {sentence}{meant(name, known)}"


def joint_faults(path: str, name: Any, types: Mapping[str, Any], able: Sequence[str], what: str) -> Faults:
    """Yield the fault of a joint that does not exist, or whose type is not among the ``able`` ones."""
    if not isinstance(name, str) or not name:
        return  # already reported as a fault of the field
    if name not in types:
        yield path, unknown("joint", name, list(types))
    elif types[name] in JOINT_TYPES and types[name] not in able:
        yield path, f"{name!r} is {types[name]}; only {', '.join(able)} joints can {what}"
