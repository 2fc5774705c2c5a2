"""Limits of an engine's author: own limits of checks, failures that are expected, and an earlier run.

A file has the tables

    [limits]
    closure = 1e-5                        # the largest measured value of this check, on every scene
    [[limit]]
    check = "momentum"
    scenes = ["heavy top"]
    allowed = 1e-3
    [[expected]]
    check = "energy"
    scenes = ["heavy top", "pendulum"]    # default: every scene
    reason = "semi-implicit Euler gains energy"

An expected failure is strict: if the check passes on such a scene, it fails until the entry is removed.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from crosscheck.conformance.suite import EXPECTED, FAIL, PASS, UNKNOWN, Verdict, abouts
from crosscheck.study.record_shape import Verdicts, checked
from mbref.records import RecordsError, json_content
from mbref.scene import SceneError
from mbref.scene.fields import meant
from mbref.scene.toml import read_toml

EVERY = "*"  # scene of an entry that holds for every scene
WORSE = 2.0  # largest measured value of a failure / value in the baseline that counts as no worse
FIELDS = {"limit": {"check", "scenes", "allowed"}, "expected": {"check", "scenes", "reason"}}
Key = tuple[str, str]  # check and scene


@dataclass(frozen=True)
class OwnLimits:
    """Limits and expected failures by check and scene, and verdicts of an earlier run."""

    allowed: Mapping[Key, float] = field(default_factory=dict)
    expected: Mapping[Key, str] = field(default_factory=dict)
    baseline: Mapping[Key, Verdict] = field(default_factory=dict)

    def judged(self, verdict: Verdict) -> Verdict:
        """Return a verdict by these limits."""
        own = _of(self.allowed, verdict)
        if own is not None and verdict.measured is not None and verdict.status in (PASS, FAIL):
            status = PASS if verdict.measured <= own else FAIL
            verdict = replace(verdict, allowed=own, status=status)
        reason = _of(self.expected, verdict)
        if reason is not None and verdict.status == FAIL:
            return replace(verdict, status=EXPECTED, reason=reason)
        if reason is not None and verdict.status == PASS:
            says = f"passes, but is expected to fail ({reason}): remove it from the file of limits"
            return replace(verdict, status=FAIL, reason=says)
        return self._beside_baseline(verdict)

    def _beside_baseline(self, verdict: Verdict) -> Verdict:
        """Return a failure as expected if it is no worse than in the baseline, and a failure for a check that
        passes in the baseline and now cannot run."""
        before = self.baseline.get((verdict.property, verdict.scene))
        if verdict.status == PASS or before is None or before.check() != verdict.check():
            return verdict
        if before.status == PASS and not verdict.reason.startswith(UNKNOWN):
            says = f"{verdict.reason}; it passes in the baseline".lstrip("; ")
            return replace(verdict, status=FAIL, reason=says)
        if verdict.status != FAIL or before.status not in (FAIL, EXPECTED):
            return verdict
        now, then = _measured(verdict, before)
        if now is None or then is None:
            no_worse, values = now is then, ""
        else:
            no_worse, values = now <= WORSE * then, f" {then:.3g}"
        if no_worse:
            return replace(verdict, status=EXPECTED, reason=f"no worse than in the baseline{values}")
        return replace(
            verdict, reason=f"{verdict.reason}; the baseline has{values or ' a value'}".lstrip("; ")
        )


def _measured(*verdicts: Verdict) -> Iterator[float | None]:
    """Yield the measured values, None for one that is not finite, as files have it."""
    for verdict in verdicts:
        value = verdict.measured
        yield value if value is not None and math.isfinite(value) else None


def _of(table: Mapping[Key, Any], verdict: Verdict) -> Any:
    """Return the entry for the verdict's check and scene, or for its check on every scene."""
    return table.get((verdict.property, verdict.scene), table.get((verdict.property, EVERY)))


def read_limits(path: str | Path, scenes: Collection[str]) -> OwnLimits:
    """Return the limits of a file; raises SceneError that names each faulty entry, check and scene."""
    _, data = read_toml(path)
    tables = ("limits", *FIELDS)
    faults = [f"{path}: {key}: is not a known table{meant(key, tables)}" for key in data if key not in tables]
    allowed: dict[Key, float] = {}
    expected: dict[Key, str] = {}
    general = data.get("limits", {})
    if not isinstance(general, dict) or not all(isinstance(data.get(table, []), list) for table in FIELDS):
        raise SceneError([f"{path}: needs tables [limits], [[limit]] and [[expected]]"])
    entries: list[tuple[str, Any]] = [("limit", {"check": k, "allowed": v}) for k, v in general.items()]
    entries += [(table, entry) for table in FIELDS for entry in data.get(table, ())]
    for table, entry in entries:
        if found := [*_faults(table, entry, scenes)]:
            faults += [f"{path}: {table}: {fault}" for fault in found]
            continue
        for scene in entry.get("scenes", [EVERY]):
            if table == "limit":
                allowed[entry["check"], scene] = float(entry["allowed"])
            else:
                expected[entry["check"], scene] = entry["reason"]
    if faults:
        raise SceneError(faults)
    return OwnLimits(allowed, expected)


def _faults(table: str, entry: Any, scenes: Collection[str]) -> list[str]:
    """Return the faults of an entry of a file of limits."""
    if not isinstance(entry, Mapping):
        return ["must be a table"]
    fields = FIELDS[table]
    found = [f"{key} is not a known field{meant(key, fields)}" for key in entry if key not in fields]
    check, known = entry.get("check"), abouts()
    if not isinstance(check, str) or check not in known:
        found.append(f"unknown check {check!r}; known: {', '.join(known)}{meant(str(check), known)}")
    named = entry.get("scenes", [])
    if not isinstance(named, list) or not all(isinstance(name, str) for name in named):
        found.append("scenes must be a list of names")
    else:
        found += [f"unknown scene {name!r}{meant(name, scenes)}" for name in named if name not in scenes]
    number = entry.get("allowed", 0)
    if table == "limit" and not (
        isinstance(number, int | float) and not isinstance(number, bool) and 0 < number < math.inf
    ):
        found.append(f"allowed of check {check!r} must be a positive number")
    if table == "expected" and not (isinstance(entry.get("reason"), str) and entry["reason"]):
        found.append(f"reason of check {check!r} is required")
    return found


def read_baseline(path: str | Path) -> dict[Key, Verdict]:
    """Return the verdicts that ``verify --json`` printed, by check and scene; raises RecordsError for another
    file, OSError."""
    data, names = json_content(path), [each.name for each in fields(Verdict)]
    if not isinstance(data, dict) or "verdicts" not in data:
        raise RecordsError(f"{path}: is not a file that crosscheck verify --json printed")
    checked(path, [data], Verdicts)
    verdicts = [Verdict(**{k: v for k, v in each.items() if k in names}) for each in data["verdicts"]]
    found = {(verdict.property, verdict.scene): verdict for verdict in verdicts}
    for verdict in verdicts:
        if found[verdict.property, verdict.scene] != verdict:
            raise RecordsError(f"{path}: has two verdicts on {verdict.property} of {verdict.scene!r}")
    return found
