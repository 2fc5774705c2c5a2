"""Record files: results as JSON lines, each with a key; records in the file need not be computed again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any


def stored(path: str | Path | None) -> dict[str, dict[str, Any]]:
    """Records of the file by ``key``, the last of each; none where there is no file.

    A last line that an interruption cut short is removed from the file.
    """
    if path is None or not Path(path).exists():
        return {}
    text = Path(path).read_bytes()
    whole = text[: text.rfind(b"\n") + 1]
    if len(whole) < len(text):
        Path(path).write_bytes(whole)
    return {record["key"]: record for record in map(json.loads, whole.splitlines())}


def append(path: str | Path | None, record: dict[str, Any]) -> None:
    """Add a record to the file; nowhere without a path."""
    if path is not None:
        with open(path, "a") as file:
            file.write(json.dumps(record) + "\n")
