"""Changes between two versions of an engine beyond noise: results, cost, default values, missing names."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from crosscheck.conformance.suite import FAIL, PASS
from crosscheck.judge.events import at_samples
from crosscheck.judge.metrics import error_series, in_scene_order
from crosscheck.judge.start_accelerations import starts
from crosscheck.setting import ORIGIN
from crosscheck.study.difference import ERROR_RATIO, Change, Identity, changes
from crosscheck.study.grid import Record
from crosscheck.study.record_view import error
from crosscheck.versions.measured import Measured
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

# of the largest acceleration, of the mechanism's length, or rad: iterations of an engine's solver end below
NOISE = 1e-6
# motions are compared if they differ by more than SHARE of their errors, and if no error exceeds LOST:
# rounding decides how motions go on that are wrong by so much (of the mechanism's length, or rad)
SHARE, LOST = 0.1, 0.1
NEAR_LIMIT = 0.1  # of the allowed value: smaller measured values of a check are not compared
SAME_VERDICT = tuple(f"{status}:" for status in (PASS, FAIL))  # beginnings of changes of a measured value
RESULTS = ("run", "outcome", "accelerations", "solvers", "motion", "error", "check")


class Found(NamedTuple):
    """One change: its kind, the scene with engine settings or the check, and a sentence with both values."""

    kind: str
    place: str
    change: str

    @property
    def is_result(self) -> bool:
        """Return whether results change, and not cost, a default value or a name."""
        return self.kind in RESULTS


def between(old: Measured, new: Measured, scenes: Sequence[Scene]) -> list[Found]:
    """Return the changes from one version to another: results, and among them other verdicts, first."""
    found = list(_of_faults(old, new))
    for before, after in zip(old.documents, new.documents, strict=True):
        if before is not None and after is not None:
            found += _of_documents(before, after, {scene.name: scene for scene in scenes})
    found += _of_facts(old.facts, new.facts)
    return sorted(found, key=lambda one: (not one.is_result, one.change.startswith(SAME_VERDICT)))


def _of_faults(old: Measured, new: Measured) -> Iterator[Found]:
    """Yield the commands that end without a result in one version, and in both, where nothing is compared."""
    for command in dict.fromkeys([*old.faults, *new.faults]):
        before, after = old.faults.get(command), new.faults.get(command)
        if before and after:
            yield Found("not compared", "", f"both: {after}")
        else:
            only = old.requirement if before else new.requirement
            yield Found("run", "", f"only {only}: {before or after}")


def _of_documents(before: Any, after: Any, scenes: Mapping[str, Scene]) -> Iterator[Found]:
    if isinstance(before, Mapping) and "scene" not in before:
        yield from _of_checks(before, after)
        return
    old, new = ([d] if isinstance(d, Mapping) else d for d in (before, after))
    for a, b in zip(old, new, strict=True):
        yield from _of_solvers(a, b)
        yield from _of_runs(scenes[b["scene"]], a, b)


def _of_solvers(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[Found]:
    """Yield the pairs of solvers that agree on a scene in one version and differ in the other."""
    before, after = ({tuple(one["ways"]): one for one in d.get("disagreements", ())} for d in (old, new))
    for ways in dict.fromkeys([*after, *before]):
        if (ways in before) != (ways in after):
            change = "agree → differ" if ways in after else "differ → agree"
            sentence = (after.get(ways) or before[ways])["sentence"]
            yield Found("solvers", new["scene"], f"{change}: {sentence}")


def _of_runs(scene: Scene, old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[Found]:
    """Yield changes of the runs of one scene at equal settings."""
    for change in changes(*(_by_request(document) for document in (old, new))):
        place = f"{scene.name}, {change.identity[2]} {_options(change)}".strip()
        kinds = [(_kind(sentence), sentence) for sentence in change.sentences]
        if change.old and change.new:
            kinds = [*_of_motions(scene, change.old, change.new), *kinds]
        yield from (Found(kind, place, sentence) for kind, sentence in kinds)


def _by_request(document: Mapping[str, Any]) -> dict[Identity, Record]:
    """Return the records of a document by family and options. The machine is the same; times are no
    interleaved ones."""
    return {
        ("", record["engine"], record["method"], repr(sorted(record["asked"]["options"].items())), ""): {
            **record,
            "machine": None,
            "repeated": False,
        }
        for record in document["records"]
    }


def _options(change: Change) -> str:
    record = change.new or change.old or {}
    options = record["asked"]["options"].items()
    return ", ".join(f"{name}={value}" for name, value in options if name not in ORIGIN)


def _kind(sentence: str) -> str:
    first = sentence.partition(" ")[0]
    return {"outcome": first, "end": "outcome", "time": "cost", "only": "settings"}.get(first, "error")


def _of_motions(scene: Scene, old: Record, new: Record) -> Iterator[tuple[str, str]]:
    """Yield changes of the accelerations at the start, and of the motion where they did not change."""
    before, after = (in_scene_order(scene, Trajectory.from_record(scene.name, r)) for r in (old, new))
    if not (len(before.times) and len(after.times)):
        return
    found = starts(scene, before, after)
    if found and found.apart > NOISE:
        errors = "; error {:.2g} → {:.2g}".format(*found.errors) if scene.has_mass() else ""
        yield "accelerations", f"at the start by {found.apart:.2g} of the largest{errors}"
        return
    both = np.arange(min(len(before.times), len(after.times)))
    apart = float(error_series(scene, at_samples(before, both), at_samples(after, both)).max())
    known = [e for e in map(error, (old, new)) if math.isfinite(e)]
    if apart > max([NOISE, *(SHARE * e for e in known)]) and max(known, default=0.0) < LOST:
        yield "motion", f"by up to {apart:.2g} of the mechanism's length, or rad"


def _of_checks(before: Mapping[str, Any], after: Mapping[str, Any]) -> Iterator[Found]:
    """Yield changed verdicts of the conformance suite, or of random mechanisms."""
    old, new = ({(v["scene"], v["card"]): v for v in _verdicts(d)} for d in (before, after))
    for scene, card in dict.fromkeys([*new, *old]):
        a, b = (known.get((scene, card)) for known in (old, new))
        if change := _of_verdict(a, b):
            yield Found("check", f"{scene}, {card}", change)


def _verdicts(document: Mapping[str, Any]) -> Sequence[Mapping[str, Any]]:
    """Return all verdicts of `verify`, and only the failures of `verify --mechanisms`."""
    found: Sequence[Mapping[str, Any]] = document.get("verdicts") or document.get("violations", ())
    return found


def _of_verdict(old: Mapping[str, Any] | None, new: Mapping[str, Any] | None) -> str:
    before, after = (verdict["status"] if verdict else "no failure" for verdict in (old, new))
    said = " ".join(filter(None, [_number(old), "→", _number(new)]))
    if before != after:
        reason = (new or old or {})["reason"]
        return f"{before} → {after} ({said}): {reason}".replace(" (→)", "").removesuffix(": ")
    if old is None or new is None or old["measured"] is None or new["measured"] is None:
        return ""
    low, high = sorted(v["measured"] for v in (old, new))
    is_near = high > NEAR_LIMIT * max(new["allowed"], 0.0) and math.isfinite(high)
    return f"{after}: {said}" if is_near and high > ERROR_RATIO * low else ""


def _number(verdict: Mapping[str, Any] | None) -> str:
    return "" if verdict is None or verdict["measured"] is None else f"{verdict['measured']:.2g}"


def _of_facts(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[Found]:
    """Yield changed default values, and names that the adapter misses in one version, if both have facts."""
    if not (old and new):
        return
    before, after = (facts.get("defaults", {}) for facts in (old, new))
    for name in dict.fromkeys([*before, *after]):
        a, b = before.get(name, "none"), after.get(name, "none")
        if a != b:
            yield Found("default", name, f"{a} → {b}")
    lost, gone = (set(facts.get("missing", ())) for facts in (old, new))
    yield from (Found("API", name, "missing → there") for name in sorted(lost - gone))
    yield from (Found("API", name, "there → missing") for name in sorted(gone - lost))
