"""The command line that repeats the run of a record: its scene, engine, family, options and sample times."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from typing import Any

from crosscheck.setting import ORIGIN
from crosscheck.study.grid import TIME_LIMIT, Record


def command(record: Record, scene: str) -> str:
    """Return the ``crosscheck run`` command that repeats a record.

    ``scene`` is a built-in name or a path with options for reading it, as words of a shell.
    """
    asked = record["asked"]
    words = [
        "crosscheck",
        "run",
        *shlex.split(scene),
        "--engine",
        asked["engine"],
        "--setting",
        record["family"],
    ]
    for name, value in asked["options"].items():
        if name in ORIGIN:
            continue
        words += ["--option", f"{name}={json.dumps(value)}"]
    return shlex.join([*words, *_when(asked), *_limit(record["time_limit"])])


def parsed_option(text: str) -> tuple[str, Any]:
    """Return (name, value) of the text ``name=value``; the value is read as JSON, otherwise it is the text
    itself.

    Raises ValueError if ``=`` is missing.
    """
    name, equals, value = text.partition("=")
    if not (name and equals):
        raise ValueError(f"must be name=value, got {text!r}")
    try:
        return name, json.loads(value)
    except (ValueError, RecursionError):  # also a number of thousands of digits, and deep nesting
        return name, value


def _when(asked: Mapping[str, Any]) -> list[str]:
    if "times" in asked:
        return ["--times", ",".join(map(repr, asked["times"])), "--duration", repr(asked["end"])]
    return ["--samples", str(asked["samples"]), "--duration", repr(asked["end"])]


def _limit(seconds: float) -> list[str]:
    return [] if seconds == TIME_LIMIT else ["--time-limit", f"{seconds:g}"]
