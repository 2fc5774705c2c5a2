"""Comparison of two sets of records: their common runs, and the changes that exceed noise."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from crosscheck.study.grid import Record
from crosscheck.study.record_shape import Timing, checked
from crosscheck.study.record_view import ended, error, error_bound, error_text, is_completed, of_scenes
from crosscheck.study.store import read, read_scenes, unpacked
from crosscheck.study.words.text import runs
from mbref.records import looked_at

ERROR_RATIO = 2.0  # larger ratios of errors are changes; rounding scatters errors above NOISE by less
NOISE = 1e-12  # smaller errors are rounding errors
EARLIER = 0.1  # fraction of the end time: a failed run whose end moves by more is reported as changed
MEASURES = {
    "velocities": "velocity_error",
    "closure": "violation_position",
    "energy": "energy_error",
    "reactions": "reaction_error",
}
"""Metrics that are compared where the error did not change."""
MEASURE_NOISE = 1e-11  # smaller values of METRICS are rounding errors and not compared
# larger ratios of times are changes: of interleaved repeats, of single runs
TIME_RATIO, SINGLE_RATIO = 1.5, 2.0

Identity = tuple[str, str, str, str, str]  # scene, engine, family, options, sample times


class Change(NamedTuple):
    """A run of both sets or of one set (the missing record is None), and sentences on changes; no sentence
    means no change."""

    identity: Identity
    old: Record | None
    new: Record | None
    sentences: Sequence[str]


def load(path: str | Path) -> dict[Identity, Record]:
    """Return the runs of a record file or a report's folder, with their interleaved times.

    Raises ValueError for a file without records.
    """
    given = Path(path)
    if not given.is_dir():
        return _loaded(given, given)
    with unpacked(given) as place:
        return _loaded(place / "records.jsonl", given / "records.jsonl")


def _loaded(file: Path, named: Path) -> dict[Identity, Record]:
    """Return the runs of a file; messages on a missing file name another path."""
    if not file.exists():
        raise ValueError(f"{named}: no such file")
    times, records = read(file.parent / "timings.jsonl", Timing), list(looked_at(file).values())
    if any("asked" not in record for record in records):
        raise ValueError(
            f"{file}: its records lack the field `asked` with the request of the run; run them again"
        )
    checked(file, records)
    found: dict[Identity, Record] = {}
    ours = _of_the_report(file, records)
    for record in ours:
        timed = times.get(record["key"]) or record["cost"]
        cost = {**record["cost"], "seconds": timed["seconds"]}
        found[identity(record)] = {**record, "cost": cost, "repeated": record["key"] in times}
    pairs = {(record["scene"], record.get("mechanism")) for record in ours}
    counts = Counter(scene for scene, mechanism in pairs if mechanism is not None)
    return {k: {**record, "mechanisms": counts[record["scene"]]} for k, record in found.items()}


def _of_the_report(file: Path, records: Sequence[Record]) -> Sequence[Record]:
    """Return the records whose mechanisms equal the present scenes of the report's folder; all records if the
    folder has no scenes."""
    scenes = read_scenes(file.parent)
    return of_scenes(records, scenes) if scenes else records


def identity(record: Record) -> Identity:
    """Return the request by which runs of two sets are matched; it does not contain the engine's version."""
    asked = record["asked"]
    when = {name: asked[name] for name in ("samples", "times", "end") if name in asked}
    return (
        record["scene"],
        asked["engine"],
        record["family"],
        json.dumps(asked["options"], sort_keys=True),
        json.dumps(when),
    )


def changes(old: Mapping[Identity, Record], new: Mapping[Identity, Record]) -> list[Change]:
    """Return every run of both sets, in the order of the new set and then of the old one.

    A run whose mechanism changed counts as two runs, each in one set only.
    """
    return [
        Change(name, before, after, list(_sentences(before, after)))
        for name in dict.fromkeys([*new, *old])
        for before, after in _paired(old.get(name), new.get(name))
    ]


def _paired(old: Record | None, new: Record | None) -> Sequence[tuple[Record | None, Record | None]]:
    return [(None, new), (old, None)] if _is_other_mechanism(old, new) else [(old, new)]


def _is_other_mechanism(old: Record | None, new: Record | None) -> bool:
    """Return whether both records name their mechanisms, and the mechanisms differ."""
    return bool(old and new and len({old.get("mechanism"), new.get("mechanism")} - {None}) > 1)


def circumstances(old: Mapping[Identity, Record], new: Mapping[Identity, Record]) -> list[str]:
    """Return sentences on versions, machines and mechanisms that differ between the sets."""
    before, after = (_circumstances(records) for records in (old, new))
    names = dict.fromkeys([*before, *after])
    both = [(old[name], new[name]) for name in new if name in old]
    others = dict.fromkeys(b["scene"] for a, b in both if _is_other_mechanism(a, b))
    unnamed = dict.fromkeys(b["scene"] for a, b in both if not (a.get("mechanism") and b.get("mechanism")))
    several = dict.fromkeys(r["scene"] for each in both for r in each if r.get("mechanisms", 1) > 1)
    untimed = sum(a["machine"] != b["machine"] for a, b in both if not _is_other_mechanism(a, b))
    return [
        *(
            f"{name}: {before.get(name, 'none')} → {after.get(name, 'none')}"
            for name in names
            if before.get(name) != after.get(name)
        ),
        *(f"{scene}: the mechanism was changed, so its runs are not compared." for scene in others),
        *(f"{scene}: records name no mechanism, so it may have changed unseen." for scene in unnamed),
        *(
            f"{scene}: a set has several mechanisms of this name; the last record of a request is compared."
            for scene in several
        ),
        *([f"Times of {runs(untimed)} are not compared: the machines differ."] if untimed else []),
    ]


def _circumstances(records: Mapping[Identity, Record]) -> dict[str, str]:
    found: dict[str, dict[str, None]] = {}
    for record in records.values():
        reported = {
            record["engine"]: record["version"],
            **record["versions"],
            **record["machine"],
            "commit": record.get("commit"),
        }
        for name, value in reported.items():
            if value not in ("", None):
                found.setdefault(name, {})[str(value)] = None
    return {name: ", ".join(sorted(values)) for name, values in found.items()}


def _sentences(old: Record | None, new: Record | None) -> Iterator[str]:
    if old is None or new is None:
        yield "only in the new set" if old is None else "only in the old set"
        return
    if old["outcome"] != new["outcome"]:
        yield f"outcome {ended(old)} → {ended(new)}"
        return
    little = EARLIER**3 * new["asked"].get("end", 0.0)
    if not math.isclose(old["t_end"], new["t_end"], rel_tol=EARLIER, abs_tol=little):
        yield f"end {ended(old)} → {ended(new)}"
    bound = max(map(error_bound, (old, new)))
    if _is_changed(error(old), error(new), ERROR_RATIO, max(NOISE, bound)):
        yield f"error {error_text(old)} → {error_text(new)}"
    else:
        yield from _measures(old["metrics"], new["metrics"])
    if not (is_completed(new) and old["machine"] == new["machine"]):
        return
    both = old["repeated"] and new["repeated"]
    seconds = old["cost"]["seconds"], new["cost"]["seconds"]
    if _is_changed(*seconds, TIME_RATIO if both else SINGLE_RATIO, 0.0):
        yield f"time {seconds[0]:.2e} s → {seconds[1]:.2e} s"


def _measures(old: Mapping[str, float | None], new: Mapping[str, float | None]) -> Iterator[str]:
    """Return sentences on changed metrics, apart from the error, that both runs have."""
    for name, metric in MEASURES.items():
        before, after = old.get(metric), new.get(metric)
        if before is None or after is None:
            continue
        if _is_changed(before, after, ERROR_RATIO, MEASURE_NOISE):
            yield f"{name} {before:.2e} → {after:.2e}"


def _is_changed(old: float, new: float, ratio: float, noise: float) -> bool:
    """Return whether two numbers differ by more than a factor; numbers below the noise count as the noise."""
    if not (math.isfinite(old) and math.isfinite(new)):
        return math.isfinite(old) != math.isfinite(new)
    low, high = sorted((max(old, noise), max(new, noise)))
    return high > ratio * low
