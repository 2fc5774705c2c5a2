"""Record files: results as JSON lines, each with a key; records in the file need not be computed again.

A line is strict JSON (no NaN: null; an infinite number is 1e999) and is handed to the operating system in
one write.  So only the last line can be cut short, by a kill or a power cut; reading the file takes it off.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

INFINITE = {math.inf: "\ue000+", -math.inf: "\ue000-"}  # stand for these until the text is made


class RecordsError(ValueError):
    """A file that holds something else than records, and is left as it is."""


def stored(path: str | Path | None) -> dict[str, dict[str, Any]]:
    """Records of the file by ``key``, the last of each; none where there is no file.

    Lines that hold no record are reported by number on stderr and left alone.  Raises RecordsError where
    no line
    holds one, OSError where the file cannot be read.
    """
    records, whole, size = _parsed(path)
    if path is not None and whole < size:
        os.truncate(path, whole)
    return records


def looked_at(path: str | Path | None) -> dict[str, dict[str, Any]]:
    """Read records like ``stored``, without repairing a last line that is cut short."""
    return _parsed(path)[0]


def _parsed(path: str | Path | None) -> tuple[dict[str, dict[str, Any]], int, int]:
    """The records of the file by ``key``, the size of its whole lines, and its own (bytes)."""
    if path is None or not Path(path).exists():
        return {}, 0, 0
    text = Path(path).read_bytes()
    end = text.rfind(b"\n") + 1
    lines = [_record(line) for line in text[:end].splitlines()]
    foreign = [number for number, record in enumerate(lines, 1) if record is None]
    if text and len(foreign) == len(lines):
        raise RecordsError(f"{path}: holds no records; name another file, or remove it")
    if foreign:
        numbers = ", ".join(map(str, foreign))
        print(f"{path}: line {numbers} holds no record and was left unchanged", file=sys.stderr)
    return {record["key"]: record for record in lines if record is not None}, end, len(text)


def opened(path: str | Path | None) -> dict[str, dict[str, Any]]:
    """Read records like ``stored`` from a file that can be appended to; make a missing file.  Raises
    OSError."""
    if path is not None:
        open(path, "ab").close()
    return stored(path)


def append(path: str | Path | None, record: dict[str, Any]) -> None:
    """Add a record to the file, whole or not at all; nowhere without a path.

    Raises OSError where the file cannot take it.
    """
    if path is None:
        return
    line = (strict_json(record) + "\n").encode()
    with open(path, "ab", buffering=0) as file:
        before = os.fstat(file.fileno()).st_size
        try:
            while line:  # usually one write; on a full disk the next one raises
                line = line[file.write(line) :]
        except BaseException:
            with contextlib.suppress(OSError):  # the first failure is the one reported
                file.truncate(before)
            raise


def strict_json(value: Any) -> str:
    """The value as JSON that any reader takes: NaN is null, an infinite number one beyond every double."""
    text = json.dumps(_finite(value), allow_nan=False)
    for number, mark in INFINITE.items():
        text = text.replace(json.dumps(mark), f"{math.copysign(1, number):.0f}e999")
    return text


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(v) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(v) for v in value]
    return INFINITE.get(value) if isinstance(value, float) and not math.isfinite(value) else value


def _record(line: bytes) -> dict[str, Any] | None:
    """The record of a line, None where it holds none."""
    try:
        found = json.loads(line, parse_constant=_refused)
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) and isinstance(found.get("key"), str) else None


def _refused(name: str) -> float:
    raise ValueError(f"{name} is no JSON")
