"""Interleaved timings of the short runs that completed, stored beside their records and not repeated."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from crosscheck.compare import timed
from crosscheck.study import Case, Record
from mbref.trajectory import Outcome

REPEATS = 5
LONG = 0.5  # s; a run that takes longer is timed by its single run, whose noise is small beside it


def with_timings(
    cases: Sequence[Case], records: Sequence[Record], path: Path, notice: Callable[[str], None]
) -> list[Record]:
    """The records with the times of ``path`` (JSON lines); a scene of which one is missing is timed."""
    done, known = list(records), _stored(path)
    for name in dict.fromkeys(case.scene.name for case in cases):
        places = [i for i, record in enumerate(records) if record["scene"] == name and _is_short(record)]
        if any(records[i]["key"] not in known for i in places):
            notice(f"{name}: timing, {REPEATS} interleaved repeats")
            _append(path, timed([cases[i] for i in places], [records[i] for i in places], REPEATS, notice))
            known = _stored(path)
        for i in places:
            done[i] = _with_cost(records[i], known)
    return done


def _is_short(record: Record) -> bool:
    return record["outcome"] == Outcome.COMPLETED.label and record["cost"]["seconds"] <= LONG


def _with_cost(record: Record, known: dict[str, dict[str, Any]]) -> Record:
    if record["key"] not in known:
        return record
    entry = known[record["key"]]
    cost = {**record["cost"], "seconds": entry["seconds"]}
    return {**record, "cost": cost, "timing": entry["timing"]}


def _stored(path: Path) -> dict[str, dict[str, Any]]:
    lines = path.read_text().splitlines() if path.exists() else []
    return {entry["key"]: entry for entry in map(json.loads, lines)}


def _append(path: Path, records: Sequence[Record]) -> None:
    with open(path, "a") as file:
        for record in records:
            if "timing" in record:
                entry = {
                    "key": record["key"],
                    "seconds": record["cost"]["seconds"],
                    "timing": record["timing"],
                }
                file.write(json.dumps(entry) + "\n")
