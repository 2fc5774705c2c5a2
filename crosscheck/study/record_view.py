"""A record as tables and files show it: its public fields, its error, the settings that vary."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from crosscheck.engine import ORIGIN
from crosscheck.judge.reference.cache import mechanism
from crosscheck.study.grid import Record
from mbref.scene import Scene
from mbref.trajectory import Outcome

PUBLIC = (
    "engine",
    "version",
    "method",
    "settings",
    "outcome",
    "message",
    "t_end",
    "times",
    "bodies",
    "reactions",
    "metrics",
    "cost",
)
SMALLEST = 1e-16  # an error of exactly zero is drawn here
UNTIMED = 1e-6  # s; a run that reports no time is drawn no lower


def public(record: Record) -> Record:
    """The fields of a record that ``--json`` prints, ``timing`` too where the run was timed; numbers that
    are not finite become null."""
    return {name: _finite(record[name]) for name in (*PUBLIC, "timing") if name in record}


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {k: _finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def is_completed(record: Record) -> bool:
    """Whether the run reached its end time."""
    return record["outcome"] == Outcome.COMPLETED.label


def of_scenes(records: Sequence[Record], scenes: Sequence[Scene]) -> list[Record]:
    """Return the records of these scenes, without records of a scene's earlier version.
    Records that name no mechanism count as of the scene they name."""
    known = {scene.name: mechanism(scene) for scene in scenes}
    return [r for r in records if r["scene"] in known and r.get("mechanism") in (None, known[r["scene"]])]


def ended(record: Record) -> str:
    """``completed``, or how and when the run ended; no time where it was ended from outside."""
    said = record["outcome"].lower().replace("_", " ")
    if is_completed(record) or record["outcome"] in (Outcome.TIMED_OUT.label, Outcome.CRASHED.label):
        return str(said)
    return f"{said} at {max(record['t_end'], 0.0):.4g} s"


def by_scene(records: Sequence[Record]) -> dict[str, list[Record]]:
    """Records grouped by the scene's name, in their order."""
    groups: dict[str, list[Record]] = {}
    for record in records:
        groups.setdefault(record["scene"], []).append(record)
    return groups


def error(record: Record) -> float:
    """The error of a record; infinite where there is none to compare with."""
    value = record["metrics"].get("error")
    return math.inf if value is None or math.isnan(value) else value


def error_bound(record: Record) -> float:
    """The bound on the truth's own error; 0 without one."""
    return record["metrics"].get("error_bound") or 0.0


def drawn(record: Record, seconds: float) -> tuple[float, float]:
    """The error of a record, no lower than it is known, and its time (s), as drawn on logarithmic axes."""
    return max(error(record), error_bound(record), SMALLEST), max(seconds, UNTIMED)


def error_text(record: Record) -> str:
    """The error of a record as shown: ``< 3e-12`` below what the truth may be off itself, – without one and
    for a run that never moved."""
    value, bound = error(record), error_bound(record)
    if not math.isfinite(value) or never_moved(record):
        return "–"
    return f"< {bound:.0e}" if value < bound else f"{value:.2e}"


def is_judged(record: Record) -> bool:
    """Whether the error of a record is of all that the run reached; True where it reached nothing."""
    metrics = record["metrics"]
    if never_moved(record) or not record["times"]:
        return True
    return metrics.get("error") is not None and metrics["error_until"] >= record["times"][-1]


def never_moved(record: Record) -> bool:
    """Whether a run ended at its start, so that its numbers say nothing about the motion."""
    return not is_completed(record) and record["t_end"] <= 0


def engine_and_family(record: Record) -> tuple[str, str]:
    """Engine and family."""
    return record["engine"], record["family"]


def varied_settings(record: Record, records: Sequence[Record]) -> str:
    """The settings in which a record differs from others of its family, as printed (``rtol=1e-06``);
    those asked for when it is alone."""
    own = record["settings"]
    settings = [r["settings"] for r in records if engine_and_family(r) == engine_and_family(record)]
    names = [k for k in own if any(s.get(k, own[k]) != own[k] for s in settings)]
    if len(settings) == 1:
        own = names = {k: v for k, v in record["asked"]["options"].items() if k not in ORIGIN}
    return ", ".join(f"{k}={own[k]:g}" if isinstance(own[k], float) else f"{k}={own[k]}" for k in names)


def with_time(record: Record, known: dict[str, dict[str, Any]]) -> Record:
    """The record with the time that is known by its key, if there is one."""
    if record["key"] not in known:
        return record
    entry = known[record["key"]]
    cost = {**record["cost"], "seconds": entry["seconds"]}
    return {**record, "cost": cost, "timing": entry["timing"]}
