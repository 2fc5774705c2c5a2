"""Line numbers of faulty fields in a scene file."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

TABLE = re.compile(r"\s*\[\[?\s*([\w.-]+)\s*\]\]?")
KEY = re.compile(r"\s*([\w-]+|\"[^\"]*\")\s*=")
NAME = re.compile(r"\s*(?:name|joint)\s*=\s*[\"']([^\"']*)[\"']")
SINGLE = re.compile(r"\s*\[\s*(body|joint|coupling|driver|load)\s*\]")
LINE = re.compile(r" \(line \d+\)$")
AT = re.compile(r"at line (\d+)")
PATH = re.compile(r"(\w+)(?:\[([^\]]*)\])?(?:\.(\w+))?")

Line = tuple[int, str, int, str]  # number from 1, table, index in the table, key (empty for a header)


def with_lines(text: str, faults: Sequence[str]) -> list[str]:
    """Return the faults, each with the line of the file that its path names, if the file has such a line."""
    lines = list(_lines(text))
    names = _names(text, lines)
    return [
        fault if LINE.search(fault) else f"{fault}{_said(_line_of(lines, names, fault))}" for fault in faults
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
        if key == ("joint" if table == "driver" else "name") and (name := NAME.match(rows[number - 1])):
            found.setdefault((table, name[1]), place)
    return found


def _line_of(lines: Sequence[Line], names: dict[tuple[str, str], int], fault: str) -> int | None:
    """Return the line of the field, or of its entry's header if the field is missing; None if the file has
    neither line."""
    match = PATH.match(fault)
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
