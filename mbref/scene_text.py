"""A scene as the text of a TOML file in a readable layout: entry by entry, with each vector on one line."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import tomli_w

FIRST = ("name", "type", "joint", "joints", "bodies", "body")  # these keys come first in an entry


def scene_text(data: Mapping[str, Any]) -> str:
    """Return the TOML text of a scene's nested tables; lists of tables become entries such as [[joint]]."""
    entries = {key: value for key, value in data.items() if _is_of_tables(value)}
    blocks = ["\n".join(_lines({key: value for key, value in data.items() if key not in entries}))]
    blocks += [f"[[{key}]]\n" + "\n".join(_lines(entry)) for key, found in entries.items() for entry in found]
    return "\n\n".join(blocks) + "\n"


def _is_of_tables(value: Any) -> bool:
    return isinstance(value, list) and any(isinstance(item, Mapping) for item in value)


def _lines(table: Mapping[str, Any]) -> Iterator[str]:
    """Return lines ``key = value``, names and types first."""
    for key in sorted(table, key=lambda key: FIRST.index(key) if key in FIRST else len(FIRST)):
        yield f"{key} = {_value(table[key])}"


def _value(value: Any) -> str:
    """Return a value on one line."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(_lines(value)) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_value, value)) + "]"
    return tomli_w.dumps({"x": value}).removeprefix("x = ").rstrip("\n")


def as_lists(value: Any) -> Any:
    """Return tuples as lists, as writers of TOML and JSON need them."""
    if isinstance(value, Mapping):
        return {k: as_lists(v) for k, v in value.items()}
    return [as_lists(v) for v in value] if isinstance(value, tuple | list) else value
