"""The suite: every check on every scene for one engine, as verdicts and as a table."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from typing import Any

from rich.box import SIMPLE
from rich.table import Column, Table
from rich.text import Text

from crosscheck.conformance.changes.copies import Outside
from crosscheck.conformance.hint import Failure, hint
from crosscheck.conformance.mechanisms.features import is_undetermined, undetermined
from crosscheck.conformance.mechanisms.specimens import Specimen
from crosscheck.conformance.properties import PROPERTIES, Finding
from crosscheck.conformance.runners import InProcess, Isolated, Runner
from crosscheck.conformance.trial import Bench, Broken, NoExact, set_up
from crosscheck.engine import engine
from crosscheck.processes.interrupts import calls_ended
from crosscheck.processes.pool import ChildFailed
from mbref.records import finite

PASS, FAIL, CANNOT, OUTSIDE = "pass", "fail", "cannot", "outside"
EXPECTED = "expected"  # a failure that the author of the engine expects
REFUSAL, RUN = "refusal", "run"
UNKNOWN = "its exact motion is not known"  # reason of a check that is outside
MARK_OF_EXPECTED = {EXPECTED: ("≈", "yellow")}
MARKS = {PASS: ("✓", "green"), FAIL: ("✗", "bold red"), CANNOT: ("–", "yellow"), OUTSIDE: ("○", "dim")}
FIRST = {
    REFUSAL: "cannot() refuses scenes that the engine cannot run, with a reason, and has settings for "
    "all others.",
    RUN: "A run with the finest setting of the engine's best family completes.",
}


@dataclass(frozen=True)
class Verdict:
    """Result of one check on one scene.

    ``status`` is pass, fail, cannot (the engine refuses the scene) or outside (the check does not apply to
    the scene). A number ``measured`` is compared with ``allowed``. ``reason`` is a sentence if one is needed,
    and ``check`` is the name of the check with its version.
    """

    property: str
    scene: str
    status: str
    measured: float | None = None
    allowed: float | None = None
    reason: str = ""

    def is_within(self) -> bool:
        """Return whether the measured number is within its limit, as of a check that is expected to fail."""
        return self.measured is not None and self.allowed is not None and self.measured <= self.allowed

    def check(self) -> str:
        """Return the name of the check with its version; verdicts by different versions are not compared."""
        return f"{self.property}/{PROPERTIES[self.property].version if self.property in PROPERTIES else 1}"


@dataclass(frozen=True)
class Conformance:
    """Verdicts on an engine by all checks on all scenes, with the engine's version."""

    engine: str
    version: str
    verdicts: Sequence[Verdict]
    family: str = ""  # family of settings; empty: the engine's best family
    hint: str = ""  # one sentence on the cause of failures
    left_out: Sequence[str] = ()  # scenes that a time budget left out

    @property
    def conforms(self) -> bool:
        """Return whether no check failed and some checks passed in a run; an engine that refuses all scenes
        does not conform."""
        failed = any(verdict.status == FAIL for verdict in self.verdicts)
        return not failed and any(v.status == PASS and v.property != REFUSAL for v in self.verdicts)

    def to_record(self) -> dict[str, Any]:
        """Return the record that ``verify --json`` prints; numbers that are not finite are null."""
        verdicts = [record_of(verdict) for verdict in self.verdicts]
        lists = {"verdicts": verdicts, "left_out": list(self.left_out)}
        return {**asdict(self), "conforms": self.conforms, **lists}

    @property
    def marks(self) -> dict[str, tuple[str, str]]:
        """Marks and styles of the statuses that tables show."""
        has_expected = any(verdict.status == EXPECTED for verdict in self.verdicts)
        return {**MARKS, **(MARK_OF_EXPECTED if has_expected else {})}


def record_of(verdict: Verdict) -> dict[str, Any]:
    """Return a verdict as a JSON record; numbers that are not finite are null."""
    return {"card": verdict.check(), **finite(asdict(verdict))}


def runner(name: str, time_limit: float, in_process: bool = False) -> Runner:
    """Return a runner of an engine (a known name or ``module:attribute``).

    Every run has a ``time_limit`` (s) and is in a child process, or in this process. Raises LookupError.
    """
    return InProcess(engine(name), name, time_limit) if in_process else Isolated(name, time_limit)


def held_against(
    runner: Runner,
    specimens: Sequence[Specimen],
    progress: Callable[[str], None] | None = None,
    family: str = "",
    judged_by: Callable[[Verdict], Verdict] | None = None,
    budget: float = math.inf,
) -> Conformance:
    """Return the verdicts on a runner's engine in its best family of settings, or in the given family.

    Runs in this process take place one after another. ``progress`` receives each finished scene.
    ``judged_by`` returns a verdict by limits of the engine's author. No scene begins after ``budget`` (s).
    """
    versions: set[str] = set()
    end, left_out = time.monotonic() + budget, []

    def examined(specimen: Specimen) -> list[Verdict]:
        if time.monotonic() > end:
            left_out.append(specimen.scene.name)
            return []
        bench = asked(runner, specimen, family)
        if isinstance(bench, Bench):
            versions.add(bench.version)
        verdicts = list(examine(bench)) if isinstance(bench, Bench) else [bench]
        if judged_by:
            verdicts = [judged_by(verdict) for verdict in verdicts]
        if progress:
            progress(specimen.scene.name)
        return verdicts

    with ThreadPoolExecutor(1 if isinstance(runner, InProcess) else os.cpu_count()) as threads:
        calls = [threads.submit(examined, specimen) for specimen in [Specimen(undetermined()), *specimens]]
        with calls_ended(calls):
            verdicts = [verdict for call in calls for verdict in call.result()]
    failures = _failures(specimens, verdicts)
    found = hint(runner, failures, family)
    return Conformance(runner.name, ", ".join(sorted(versions)), verdicts, family, found, left_out)


def _failures(specimens: Sequence[Specimen], verdicts: Sequence[Verdict]) -> list[Failure]:
    """Return the first check on the motion that fails, for each failing scene; not one that an author expects
    to fail, and that passes."""
    failed: dict[str, str] = {}
    for verdict in verdicts:
        if verdict.status == FAIL and verdict.property not in FIRST and not verdict.is_within():
            failed.setdefault(verdict.scene, verdict.property)
    return [Failure(s, failed[s.scene.name]) for s in specimens if s.scene.name in failed]


def asked(runner: Runner, specimen: Specimen, family: str = "") -> Bench | Verdict:
    """Return a bench; if the engine crashes when asked for its settings, return a failed verdict instead."""
    try:
        return set_up(runner, specimen, family)
    except ChildFailed as failure:
        return Verdict(REFUSAL, specimen.scene.name, FAIL, reason=str(failure))


def examine(bench: Bench) -> Iterator[Verdict]:
    """Return the verdicts of all checks on one bench."""
    yield (first := refusal(bench))
    if first.status == PASS and not bench.cannot:
        yield from _run(bench)


def refusal(bench: Bench) -> Verdict:
    """Check that the engine refuses what it cannot run, and has settings for what it can run."""
    name = bench.scene.name
    impossible = is_undetermined(bench.scene)
    if bench.cannot:
        return Verdict(REFUSAL, name, PASS if impossible else CANNOT, reason=str(bench.cannot))
    if impossible or not bench.settings:
        reason = "cannot() does not refuse a motion without masses" if impossible else "it offers no setting"
        return Verdict(REFUSAL, name, FAIL, reason=reason)
    return Verdict(REFUSAL, name, PASS)


def verdict_on(check: str, bench: Bench) -> Verdict:
    """Return the verdict of one check, named as in `abouts`, on a bench."""
    known = {REFUSAL: refusal, RUN: first_run}
    return known[check](bench) if check in known else judged(check, bench)


def _run(bench: Bench) -> Iterator[Verdict]:
    """Return the verdict on completing the run at the finest setting, and then the verdicts on its motion."""
    for label in checks_of(bench.specimen):
        yield (verdict := verdict_on(label, bench))
        if label == RUN and verdict.status == FAIL:
            return


def checks_of(specimen: Specimen) -> list[str]:
    """Return the checks that apply to a scene which the engine can run; completing is not required at a dead
    end."""
    asked = [check for check, entry in PROPERTIES.items() if entry.of(specimen)]
    return asked if specimen.dead_end else [RUN, *asked]


def first_run(bench: Bench) -> Verdict:
    """Return the verdict on completing the run at the finest setting."""
    try:
        reached = bench.motion.t_end
    except Broken as broken:
        return Verdict(RUN, bench.scene.name, FAIL, reason=str(broken))
    return Verdict(RUN, bench.scene.name, PASS, reason=f"reached {reached:g} s")


def judged(label: str, bench: Bench) -> Verdict:
    """Return the verdict of one check on a bench whose engine can run the scene."""
    try:
        found = PROPERTIES[label].check(bench)
    except (Broken, ChildFailed) as broken:
        return Verdict(label, bench.scene.name, FAIL, reason=str(broken))
    except NoExact as unknown:
        return Verdict(label, bench.scene.name, OUTSIDE, reason=f"{UNKNOWN}: {unknown}")
    if isinstance(found, Finding):
        status = PASS if found.measured <= found.allowed else FAIL
        return Verdict(label, bench.scene.name, status, found.measured, found.allowed, found.remark)
    if isinstance(found, Outside):
        return Verdict(label, bench.scene.name, OUTSIDE, reason=found.reason)
    return Verdict(label, bench.scene.name, CANNOT, reason=str(found))


def tables(conformance: Conformance) -> Iterator[Table | Text]:
    """Return a table of scenes with the number of checks by status, then refusals, checks and failures."""
    properties = [n for n in (*FIRST, *PROPERTIES) if any(v.property == n for v in conformance.verdicts)]
    marks = conformance.marks
    named = " ".join(filter(None, (conformance.engine, conformance.version, conformance.family)))
    title = f"{named}: checks that {', '.join(f'{mark} {status}' for status, (mark, _) in marks.items())}"
    counts = [Column(mark, justify="right") for mark, _ in marks.values()]
    table = Table(
        "scene",
        *counts,
        "value and limit of failures, and of the pass nearest to its limit",
        title=title,
        box=SIMPLE,
    )
    for scene in dict.fromkeys(v.scene for v in conformance.verdicts):
        own = [v for v in conformance.verdicts if v.scene == scene]
        table.add_row(
            scene, *(_count(own, status, style) for status, (_, style) in marks.items()), _worst(own)
        )
    yield table
    yield from (Text(sentence_of(v)) for v in conformance.verdicts if v.status in (CANNOT, EXPECTED))
    yield from _domains(conformance)
    yield from (Text(f"{check_of(name)}: {abouts()[name]}", style="dim") for name in properties)
    yield from (Text(sentence_of(verdict)) for verdict in conformance.verdicts if verdict.status == FAIL)
    if conformance.hint:
        yield Text(conformance.hint)
    yield _summary(conformance)


def _domains(conformance: Conformance) -> Iterator[Text]:
    """Return the reasons why checks do not apply to scenes, one line for each check and reason."""
    places: dict[tuple[str, str], list[str]] = {}
    for verdict in conformance.verdicts:
        if verdict.status == OUTSIDE:
            places.setdefault((verdict.property, verdict.reason), []).append(verdict.scene)
    for (name, reason), scenes in places.items():
        yield Text(f"outside: {name}: {reason} ({', '.join(scenes)})", style="dim")


def check_of(name: str) -> str:
    """Return the name of a check with its version."""
    return Verdict(name, "", PASS).check()


def abouts() -> dict[str, str]:
    """Return the sentence that describes each check, by name."""
    return {**FIRST, **{name: entry.about for name, entry in PROPERTIES.items()}}


def _count(verdicts: Sequence[Verdict], status: str, style: str) -> Text:
    """Return the number of verdicts with a status in words; empty if no verdict has the status."""
    number = sum(verdict.status == status for verdict in verdicts)
    return Text(str(number or ""), style=style)


def _worst(verdicts: Sequence[Verdict]) -> Text:
    """Return the names of the failed checks, otherwise the pass that is nearest to its limit."""
    if failed := [verdict.property for verdict in verdicts if verdict.status == FAIL]:
        return Text(", ".join(failed), style=MARKS[FAIL][1])
    shares = {v.property: v.measured / v.allowed for v in verdicts if v.measured is not None and v.allowed}
    nearest = max(shares, key=lambda name: shares[name], default=None)
    return Text("" if nearest is None else f"{nearest} at {100 * shares[nearest]:.2g} % of its limit")


def sentence_of(verdict: Verdict) -> str:
    """Return one sentence on a verdict: scene, check, measured value, limit, and reason."""
    measured = ""
    if verdict.measured is not None:
        measured = f" {verdict.measured:.3g}, allowed {verdict.allowed:.3g}"
    tail = f"({verdict.reason})" if measured and verdict.reason else verdict.reason
    return f"{verdict.status}: {verdict.scene}, {verdict.property}:{measured} {tail}".rstrip()


def _summary(conformance: Conformance) -> Text:
    counts = [
        f"{sum(v.status == status for v in conformance.verdicts)} {status}" for status in conformance.marks
    ]
    scenes = {v.scene for v in conformance.verdicts}
    run = {v.scene for v in conformance.verdicts if v.property == "run" and v.status in (PASS, FAIL)}
    nothing = "" if run else "; an engine that runs no scene is not shown to conform"
    late = f"; left out by the time budget: {', '.join(conformance.left_out)}" if conformance.left_out else ""
    ran = f"{len(run)} of {len(scenes)} scenes run"
    return Text(f"{conformance.engine}: {', '.join(counts)}; {ran}{late}{nothing}")
