"""Two sets of records: the runs that both have, and what changed between them beyond noise."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from crosscheck.study.grid import Record
from crosscheck.study.record_view import error, error_text, is_completed
from mbref.records import stored

ERROR_RATIO = 2.0  # of errors; rounding and another order of operations scatter them by less above NOISE
NOISE = 1e-12  # errors below it are rounding
TIME_RATIO, SINGLE_RATIO = 1.5, 2.0  # of times: of interleaved repeats on the same machine, of single runs

Identity = tuple[str, str, str, str, str]  # scene, engine, family, options, sample times


class Change(NamedTuple):
    """A run of both sets, or of one (the other None), and sentences on what changed; empty: nothing."""

    identity: Identity
    old: Record | None
    new: Record | None
    sentences: Sequence[str]


def load(path: str | Path) -> dict[Identity, Record]:
    """The runs of a record file or of a report's folder, with their interleaved times; ValueError for a file
    that holds none."""
    file = Path(path) / "records.jsonl" if Path(path).is_dir() else Path(path)
    if not file.exists():
        raise ValueError(f"{file}: no such file")
    times = stored(file.parent / "timings.jsonl")
    found = {}
    for record in stored(file).values():
        if "asked" not in record:
            raise ValueError(
                f"{file}: its records lack the field asked, the request of the run; make them again"
            )
        cost = {**record["cost"], "seconds": times.get(record["key"], record["cost"])["seconds"]}
        found[identity(record)] = {**record, "cost": cost, "repeated": record["key"] in times}
    return found


def identity(record: Record) -> Identity:
    """The request by which runs of two sets are matched; the version of the engine is no part of it."""
    asked = record["asked"]
    when = {name: asked[name] for name in ("samples", "times", "end") if name in asked}
    return (
        record["scene"],
        asked["engine"],
        record["family"],
        json.dumps(asked["options"]),
        json.dumps(when),
    )


def changes(old: Mapping[Identity, Record], new: Mapping[Identity, Record]) -> list[Change]:
    """Every run of either set, in the order of the new one and then of the old."""
    names = dict.fromkeys([*new, *old])
    return [
        Change(name, old.get(name), new.get(name), list(_sentences(old.get(name), new.get(name))))
        for name in names
    ]


def circumstances(old: Mapping[Identity, Record], new: Mapping[Identity, Record]) -> list[str]:
    """Sentences on versions and machines that differ between the sets."""
    before, after = (_circumstances(records) for records in (old, new))
    names = dict.fromkeys([*before, *after])
    return [
        f"{name}: {before.get(name, 'none')} → {after.get(name, 'none')}"
        for name in names
        if before.get(name) != after.get(name)
    ]


def _circumstances(records: Mapping[Identity, Record]) -> dict[str, str]:
    found: dict[str, dict[str, None]] = {}
    for record in records.values():
        told = {record["engine"]: record["version"], **record["versions"], **record["machine"],
                "commit": record.get("commit")}  # fmt: skip
        for name, value in told.items():
            if value not in ("", None):
                found.setdefault(name, {})[str(value)] = None
    return {name: ", ".join(sorted(values)) for name, values in found.items()}


def _sentences(old: Record | None, new: Record | None) -> Iterator[str]:
    if old is None or new is None:
        yield "only in the new set" if old is None else "only in the old set"
        return
    if old["outcome"] != new["outcome"]:
        yield f"outcome {_ended(old)} → {_ended(new)}"
        return
    bound = max(r["metrics"].get("error_bound") or 0.0 for r in (old, new))
    if _is_changed(error(old), error(new), ERROR_RATIO, max(NOISE, bound)):
        yield f"error {error_text(old)} → {error_text(new)}"
    if not (is_completed(new) and old["machine"] == new["machine"]):
        return
    both = old["repeated"] and new["repeated"]
    seconds = old["cost"]["seconds"], new["cost"]["seconds"]
    if _is_changed(*seconds, TIME_RATIO if both else SINGLE_RATIO, 0.0):
        yield f"time {seconds[0]:.2e} s → {seconds[1]:.2e} s"


def _ended(record: Record) -> str:
    end = "" if is_completed(record) else f" at {record['t_end']:.4g} s"
    return record["outcome"].lower().replace("_", " ") + end


def _is_changed(old: float, new: float, ratio: float, noise: float) -> bool:
    """Whether two numbers, raised to the noise, differ by more than a factor."""
    if not (math.isfinite(old) and math.isfinite(new)):
        return math.isfinite(old) != math.isfinite(new)
    low, high = sorted((max(old, noise), max(new, noise)))
    return high > ratio * low
