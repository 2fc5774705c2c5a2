"""Record files: results as JSON lines, each with a key. A result that the file contains is not computed
again.

A line is strict JSON (NaN becomes null, an infinite number 1e999), written by one call of the operating
system. So a kill or a power failure can leave only the last line incomplete. It is then reported, and removed
before a record is added. Files that are complete may be compressed (xz), to be read only.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from mbref import files
from mbref.input_error import InputError

COMPRESSED = b"\xfd7zXZ\x00"  # first bytes of a compressed file

# errors of reading an object from a record in which a field is missing or has a value of another type
BROKEN = (ValueError, KeyError, TypeError, AttributeError, OverflowError)
INFINITE_MARKS = {math.inf: "\ue000+", -math.inf: "\ue000-"}  # placeholders until the text is made
NO_MARKS: Mapping[float, str] = {}


class RecordsError(InputError):
    """Error: a file contains something else than records. The file is not changed."""


def stored(path: str | Path | None) -> dict[str, dict[str, Any]]:
    """Return the records of the file by ``key``, the last record of each key; an empty dictionary if there is
    no file.

    Lines that contain no record are reported by number on stderr and not changed. Raises RecordsError if no
    line contains a record or the file is compressed, OSError if the file cannot be read.
    """
    text = _content(path)
    if text.startswith(COMPRESSED):
        raise RecordsError(f"{path}: is compressed, so no record can be added; name another file")
    records, whole = _parsed(path, text)
    if path is not None and whole < len(text):
        os.truncate(path, whole)
    elif path is not None and text and not text.endswith(b"\n"):
        with open(path, "ab") as file:
            file.write(b"\n")
    return records


def looked_at(path: str | Path | None) -> dict[str, dict[str, Any]]:
    """Read records like ``stored``, also of a compressed file, without repairing an incomplete last line."""
    return _parsed(path, _decompressed(path, _content(path)))[0]


def _content(path: str | Path | None) -> bytes:
    """Return the bytes of a file; a device such as /dev/full, which may have no end, is not read."""
    if path is None or not Path(path).exists() or Path(path).is_char_device():
        return b""
    return Path(path).read_bytes()


def _decompressed(path: str | Path | None, text: bytes) -> bytes:
    """Return the text of a file; raises RecordsError for a damaged compressed file."""
    if not text.startswith(COMPRESSED):
        return text
    import lzma

    try:
        return lzma.decompress(text)
    except lzma.LZMAError:
        raise RecordsError(f"{path}: is damaged; name another file, or restore it") from None


def _parsed(path: str | Path | None, text: bytes) -> tuple[dict[str, dict[str, Any]], int]:
    """Return the records of a file's text by ``key``, and the size of its complete lines (bytes).

    The last line may lack its end.
    """
    end = text.rfind(b"\n") + 1
    if _record(text[end:]) is not None:
        end = len(text)
    lines = [_record(line) for line in text[:end].splitlines()]
    foreign = [number for number, record in enumerate(lines, 1) if record is None]
    if text and len(foreign) == len(lines):
        raise RecordsError(f"{path}: holds no records; name another file")
    if foreign:
        numbers = ", ".join(map(str, foreign))
        print(f"{path}: line {numbers} holds no record and was left unchanged", file=sys.stderr)
    if end < len(text):
        print(f"{path}: the last line is incomplete and was left out", file=sys.stderr)
    return {record["key"]: record for record in lines if record is not None}, end


def opened(path: str | Path | None) -> dict[str, dict[str, Any]]:
    """Read records like ``stored`` from a file that can be appended to; a missing file is created. Raises
    OSError."""
    if path is not None:
        open(path, "ab").close()
    return stored(path)


def append(path: str | Path | None, record: dict[str, Any]) -> None:
    """Add a record to the file, completely or not at all; without a path nothing is written.

    Raises OSError if the file cannot be written.
    """
    if path is None:
        return
    line = (strict_json(record) + "\n").encode()
    with open(path, "ab", buffering=0) as file:
        before = os.fstat(file.fileno()).st_size
        try:
            while line:  # usually one write suffices; on a full disk the next one raises
                line = line[file.write(line) :]
        except BaseException as error:
            with contextlib.suppress(OSError):  # the first failure is the reported one
                file.truncate(before)
            if isinstance(error, OSError):
                error.filename = str(path)
            raise


def rewrite(path: str | Path, records: Iterable[Mapping[str, Any]]) -> None:
    """Replace a file by records, one a line; it is compressed if its name ends in ``.xz``.

    A reader sees the old file or the new one. Raises OSError.
    """
    text = "".join(strict_json(record) + "\n" for record in records).encode()
    if Path(path).suffix == ".xz":
        import lzma

        text = lzma.compress(text, preset=lzma.PRESET_DEFAULT | lzma.PRESET_EXTREME)
    files.write(path, text)


def json_content(path: str | Path) -> Any:
    """Return the content of a JSON file; raises RecordsError for another file, OSError."""
    try:
        return json.loads(Path(path).read_text(encoding="utf-8"))
    except (ValueError, RecursionError):
        raise RecordsError(f"{path}: is not JSON; name another file, or remove it") from None


def strict_json(value: Any) -> str:
    """Return the value as JSON that any reader accepts: NaN becomes null, an infinite number becomes
    1e999."""
    text = json.dumps(finite(value, INFINITE_MARKS), allow_nan=False)
    for number, mark in INFINITE_MARKS.items():
        text = text.replace(json.dumps(mark), f"{math.copysign(1, number):.0f}e999")
    return text


def finite(value: Any, marks: Mapping[float, str] = NO_MARKS) -> Any:
    """Return the value with None for numbers that are not finite, or with their marks."""
    if isinstance(value, Mapping):
        return {key: finite(v, marks) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [finite(v, marks) for v in value]
    return marks.get(value) if isinstance(value, float) and not math.isfinite(value) else value


def _record(line: bytes) -> dict[str, Any] | None:
    """Return the record in a line, None if the line contains no record."""
    try:
        found = json.loads(line, parse_constant=_refused)
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) and isinstance(found.get("key"), str) else None


def _refused(name: str) -> float:
    raise ValueError(f"{name} is no JSON")
