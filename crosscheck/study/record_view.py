"""Views of a record for tables and files: its public fields, its error, and the settings that vary."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from crosscheck.judge.reference.cache import mechanism
from crosscheck.setting import ORIGIN, option_text
from crosscheck.study.grid import Record
from mbref.motions.trajectory import Outcome
from mbref.records import finite
from mbref.scene import Scene

PUBLIC = (
    "engine",
    "version",
    "method",
    "settings",
    "asked",
    "outcome",
    "message",
    "t_end",
    "times",
    "bodies",
    "reactions",
    "error_estimate",
    "metrics",
    "cost",
)
SMALLEST = 1e-16  # position of an error of exactly zero on a logarithmic axis
UNTIMED = 1e-6  # s; lower end of the axis of times, also for runs that report no time


def public(record: Record) -> Record:
    """Return the fields of a record that ``--json`` prints; ``timing`` only if the run was timed. Numbers
    that are not finite become null."""
    return {name: finite(record[name]) for name in (*PUBLIC, "timing") if name in record}


def is_completed(record: Record) -> bool:
    """Return whether the run reached its end time."""
    return record["outcome"] == Outcome.COMPLETED.label


def of_scenes(records: Sequence[Record], scenes: Sequence[Scene]) -> list[Record]:
    """Return the records of these scenes, without records of a scene's earlier version or duration. A record
    that names no mechanism or end time counts as a record of the present scene."""
    known = {scene.name: (mechanism(scene), scene.duration) for scene in scenes}

    def is_present(record: Record) -> bool:
        own, end = known.get(record["scene"], (None, None))
        asked = record.get("asked", {}).get("end")
        return own is not None and record.get("mechanism") in (None, own) and asked in (None, end)

    return [record for record in records if is_present(record)]


def ended(record: Record) -> str:
    """Return ``completed``, or how and when the run ended; without a time if a limit or a crash ended it."""
    said = record["outcome"].lower().replace("_", " ")
    if is_completed(record) or record["outcome"] in (Outcome.TIMED_OUT.label, Outcome.CRASHED.label):
        return str(said)
    return f"{said} at {max(record['t_end'], 0.0):.4g} s"


def by_scene(records: Sequence[Record]) -> dict[str, list[Record]]:
    """Return the records grouped by the scene's name, in their order."""
    groups: dict[str, list[Record]] = {}
    for record in records:
        groups.setdefault(record["scene"], []).append(record)
    return groups


def error(record: Record) -> float:
    """Return the error of a record; infinite if there is no truth."""
    value = record["metrics"].get("error")
    return math.inf if value is None or math.isnan(value) else value


def error_bound(record: Record) -> float:
    """Return the bound on the truth's error; 0 without a bound."""
    return record["metrics"].get("error_bound") or 0.0


def drawn(record: Record, seconds: float) -> tuple[float, float]:
    """Return error and time (s) of a record for logarithmic axes; the error is at least the bound on the
    truth's error."""
    return max(error(record), error_bound(record), SMALLEST), max(seconds, UNTIMED)


def error_text(record: Record) -> str:
    """Return the error as text: ``< 3e-12`` if it is below the bound on the truth's error, and a dash for a
    run without error or a run that ended at its start."""
    value, bound = error(record), error_bound(record)
    if not math.isfinite(value) or never_moved(record):
        return "–"
    return f"< {bound:.0e}" if value < bound else f"{value:.2e}"


def is_judged(record: Record) -> bool:
    """Return whether the error of a record covers all times that the run reached; also True for a run that
    reached no time."""
    metrics = record["metrics"]
    if never_moved(record) or not record["times"]:
        return True
    return metrics.get("error") is not None and metrics["error_until"] >= record["times"][-1]


def never_moved(record: Record) -> bool:
    """Return whether a run ended at its start, so that its numbers contain no information about the
    motion."""
    return not is_completed(record) and record["t_end"] <= 0


def engine_and_family(record: Record) -> tuple[str, str]:
    """Return engine and family of a record."""
    return record["engine"], record["family"]


def varied_settings(record: Record, records: Sequence[Record]) -> str:
    """Return the settings in which a record differs from others of its family, such as ``rtol=1e-06``.

    All requested settings are returned if it is the only record of its family.
    """
    own = record["settings"]
    settings = [r["settings"] for r in records if engine_and_family(r) == engine_and_family(record)]
    names = [k for k in own if any(s.get(k, own[k]) != own[k] for s in settings)]
    if len(settings) == 1:
        own = {k: v for k, v in record["asked"]["options"].items() if k not in ORIGIN}
        names = list(own)
    return ", ".join(f"{k}={option_text(own[k])}" for k in names)


def with_time(record: Record, known: dict[str, dict[str, Any]]) -> Record:
    """Return the record with the time that ``known`` contains for its key, if any."""
    if record["key"] not in known:
        return record
    entry = known[record["key"]]
    cost = {**record["cost"], "seconds": entry["seconds"]}
    return {**record, "cost": cost, "timing": entry["timing"]}
