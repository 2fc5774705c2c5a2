"""Interleaved timings of the short completed runs, stored with their records and not repeated."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from crosscheck.study.fair_timing import timed
from crosscheck.study.grid import Case, Record
from crosscheck.study.record_shape import Timing, checked
from crosscheck.study.record_view import with_time
from mbref.motions.trajectory import Outcome
from mbref.records import append, stored

REPEATS = 5
LONG = 0.5  # s; a longer run is timed by its single run, whose relative noise is small


def with_timings(
    cases: Sequence[Case],
    records: Sequence[Record],
    path: Path | None,
    notice: Callable[[str], None],
    long: float = LONG,
    repeats: int = REPEATS,
) -> list[Record]:
    """Return the records with the times stored at ``path`` (JSON lines); scenes with a missing time are
    timed.

    Only completed runs of up to ``long`` s are timed again, in turns.
    """
    done, known = list(records), stored(path)
    checked(path, list(known.values()), Timing)
    for name in dict.fromkeys(case.scene.name for case in cases):
        places = [i for i, r in enumerate(records) if r["scene"] == name and _is_short(r, long)]
        if any(records[i]["key"] not in known for i in places):
            notice(f"{name}: timing, {repeats} interleaved repeats")
            for record in timed([cases[i] for i in places], [records[i] for i in places], repeats, notice):
                if "timing" in record:
                    known[record["key"]] = _entry(record)
                    append(path, known[record["key"]])
        for i in places:
            done[i] = with_time(records[i], known)
    return done


def _is_short(record: Record, long: float) -> bool:
    return record["outcome"] == Outcome.COMPLETED.label and record["cost"]["seconds"] <= long


def _entry(record: Record) -> dict[str, Any]:
    return {"key": record["key"], "seconds": record["cost"]["seconds"], "timing": record["timing"]}
