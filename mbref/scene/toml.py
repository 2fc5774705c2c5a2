"""Scene files: reading and writing of TOML text, and the lines of faulty fields."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import tomli_w

from mbref.files import content
from mbref.scene.validation import SceneError

NEWLINE = re.compile(r"\r\n?")  # TOML has no line that ends with \r alone; some editors do
TABLE = re.compile(r"\s*\[\[?\s*([\w.-]+)\s*\]\]?")
KEY = re.compile(r"\s*([\w-]+|\"[^\"]*\")\s*=")
NAME = re.compile(r"\s*(?:name|joint)\s*=\s*[\"']([^\"']*)[\"']")
SINGLE = re.compile(r"\s*\[\s*(body|joint|coupling|driver|load)\s*\]")
LINED = re.compile(r" \(line \d+\)$")
AT = re.compile(r"at line (\d+)")
FAULT_PATH = re.compile(r"(\w+)(?:\[([^\]]*)\])?(?:\.(\w+))?")
FIRST = ("name", "type", "joint", "joints", "bodies", "body")  # keys that come first in a written entry

Line = tuple[int, str, int, str]  # number from 1, table, index in the table, key (empty for a header)


def read_toml(path: str | Path) -> tuple[str, dict[str, Any]]:
    """Return the text of a TOML file (UTF-8) and its tables; raises SceneError that names the file."""
    try:
        text = NEWLINE.sub("\n", content(path).decode("utf-8-sig"))
        data = tomllib.loads(text)
    except OSError as error:
        raise SceneError([f"{path}: cannot be read: {error.strerror}"]) from None
    except tomllib.TOMLDecodeError as error:
        raise SceneError([f"{path}: is not TOML: {error}{toml_hint(text, str(error))}"]) from None
    except UnicodeDecodeError as error:
        raise SceneError([f"{path}: is not UTF-8 text (at byte {error.start})"]) from None
    except ValueError as error:  # a number of thousands of digits
        raise SceneError([f"{path}: is not TOML: {error}"]) from None
    except RecursionError:
        raise SceneError([f"{path}: is nested too deeply"]) from None
    return text, data


def with_lines(text: str, faults: Sequence[str]) -> list[str]:
    """Return the faults, each with the line of the file that its path names, if the file has such a line."""
    lines = list(_lines(text))
    names = _names(text, lines)
    return [
        fault if LINED.search(fault) else f"{fault}{_said(_line_of(lines, names, fault))}" for fault in faults
    ]


def toml_hint(text: str, error: str) -> str:
    """Return the hint after a TOML reader's message: single brackets that must be double, otherwise the
    faulty line."""
    lines = text.splitlines()
    for number, line in enumerate(lines, 1):
        if single := SINGLE.match(line):
            return f"; line {number}: [{single[1]}] must be [[{single[1]}]], one for each {single[1]}"
    if (at := AT.search(error)) and int(at[1]) <= len(lines):
        return f": {lines[int(at[1]) - 1].strip()[:80]}"
    return ""


def _said(line: int | None) -> str:
    return "" if line is None else f" (line {line})"


def _lines(text: str) -> Iterator[Line]:
    """Return the lines with headers and keys."""
    table, counts = "", {"": 0}
    for number, line in enumerate(text.splitlines(), 1):
        if header := TABLE.match(line):
            table = header[1]
            counts[table] = counts.get(table, -1) + 1
            yield number, table, counts[table], ""
        elif key := KEY.match(line):
            yield number, table, counts[table], key[1].strip('"')


def _names(text: str, lines: Sequence[Line]) -> dict[tuple[str, str], int]:
    """Return the index of the first entry of each name, by table and name. A driver has the name of its
    joint."""
    rows, found = text.splitlines(), dict[tuple[str, str], int]()
    for number, table, place, key in lines:
        if key in (("joint", "name") if table == "driver" else ("name",)) and (
            name := NAME.match(rows[number - 1])
        ):
            found.setdefault((table, name[1]), place)
    return found


def _line_of(lines: Sequence[Line], names: dict[tuple[str, str], int], fault: str) -> int | None:
    """Return the line of the field, or of its entry's header if the field is missing; None if the file has
    neither line."""
    match = FAULT_PATH.match(fault)
    if not match:
        return None
    table, entry, key = match.groups()
    if entry is None and (header := [number for number, t, p, k in lines if t == table and not (p or k)]):
        return header[0]
    if entry is None or not any(line[1] == table for line in lines):
        table, place, key = "", 0, match[1]
    else:
        place = names.get((table, entry), int(entry) if entry.isdigit() else -1)
    at = {(t, p, k): number for number, t, p, k in reversed(lines)}
    return at.get((table, place, key or ""), at.get((table, place, "")))


def scene_text(data: Mapping[str, Any]) -> str:
    """Return the TOML text of a scene's nested tables: entries such as [[joint]], with each vector on one
    line."""
    entries = {key: value for key, value in data.items() if _is_of_tables(value)}
    blocks = ["\n".join(_key_lines({key: value for key, value in data.items() if key not in entries}))]
    blocks += [
        f"[[{key}]]\n" + "\n".join(_key_lines(entry)) for key, found in entries.items() for entry in found
    ]
    return "\n\n".join(blocks) + "\n"


def _is_of_tables(value: Any) -> bool:
    return isinstance(value, list) and any(isinstance(item, Mapping) for item in value)


def _key_lines(table: Mapping[str, Any]) -> Iterator[str]:
    """Return lines ``key = value``, names and types first."""
    for key in sorted(table, key=lambda key: FIRST.index(key) if key in FIRST else len(FIRST)):
        yield f"{key} = {_value(table[key])}"


def _value(value: Any) -> str:
    """Return a value on one line."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(_key_lines(value)) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_value, value)) + "]"
    return tomli_w.dumps({"x": value}).removeprefix("x = ").rstrip("\n")


def as_lists(value: Any) -> Any:
    """Return tuples as lists, as writers of TOML and JSON need them."""
    if isinstance(value, Mapping):
        return {k: as_lists(v) for k, v in value.items()}
    return [as_lists(v) for v in value] if isinstance(value, tuple | list) else value
