"""Checks on many random mechanisms, until each check has a verdict on the planned number of mechanisms.
Records are stored, so that a run resumes.

All checks on a mechanism share its runs: the judged run, its perturbed run, runs at coarser settings, and the
exact motion.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from crosscheck.conformance import suite
from crosscheck.conformance.mechanisms.large_graphs import graph_of_suite
from crosscheck.conformance.mechanisms.random_scenes import floating, mechanism, rotor, without_masses
from crosscheck.conformance.mechanisms.specimens import Specimen
from crosscheck.conformance.properties import PROPERTIES
from crosscheck.conformance.runners import InProcess
from crosscheck.conformance.suite import CANNOT, FAIL, PASS, REFUSAL, RUN, Verdict, check_of
from crosscheck.conformance.trial import Bench, Broken, difference, set_up
from crosscheck.engine import engine
from crosscheck.study.record_shape import OfSeed, checked
from mbref.records import append, opened
from mbref.scene import Scene

AGREEMENT = "agreement"
ABOUT = (
    "Trajectories of two engines agree within the sum of their errors, estimated from order and "
    "accuracy limit."
)
# largest number of seeds for each planned mechanism; some mechanisms are outside the domain of a check
MOST = 3
DECIDED = (PASS, FAIL)
NOTHING: dict[str, Any] = {"verdicts": ()}
# checks that need other mechanisms, listed here, or scenes of the suite
ELSEWHERE = (
    *("momentum", "replayed", "dead end", "refined", "start", "alternatives"),
    *("momenta", "passive", "similar", "distant"),
)
KINDS: tuple[tuple[Callable[[int], Scene], tuple[str, ...]], ...] = (
    (mechanism, (RUN, AGREEMENT, *(check for check in PROPERTIES if check not in ELSEWHERE))),
    (floating, ("energy", "momentum", "reversed")),
    (rotor, ("replayed",)),
    (without_masses, (REFUSAL,)),
    (graph_of_suite, ("start", "alternatives")),
)


class Plan(NamedTuple):
    """Plan: number of ``mechanisms`` for each check, the first seed, and the engine with a family of settings
    (empty: its best).

    ``beside`` names engines whose motions must agree, as NAME or NAME=FAMILY.
    """

    engine: str
    mechanisms: int
    first: int = 0
    family: str = ""
    beside: Sequence[str] = ()


@dataclass
class Tally:
    """Counts of verdicts by check and status, the largest ratio of a measured value to its limit, and the
    violations."""

    plan: Plan
    version: str = ""
    seeds: int = 0
    counts: dict[str, Counter[str]] = field(default_factory=dict)
    worst: dict[str, tuple[float, str]] = field(default_factory=dict)
    violations: list[dict[str, Any]] = field(default_factory=list)

    @property
    def conforms(self) -> bool:
        """Return whether no check fails and at least one mechanism ran."""
        return not self.violations and self.decided(RUN) > 0

    def open(self) -> list[str]:
        """Return the checks that are decided on fewer mechanisms than planned."""
        checks = list(dict.fromkeys(check for _, asked in KINDS for check in asked))
        asked = [check for check in checks if check != AGREEMENT or self.plan.beside]
        return [check for check in asked if self.decided(check) < self.plan.mechanisms]

    def decided(self, check: str) -> int:
        """Return the number of mechanisms on which a check was decided."""
        counts = self.counts.get(check, Counter())
        return sum(counts[status] for status in DECIDED)

    def add(self, record: dict[str, Any]) -> None:
        """Count the verdicts of a record, except verdicts by older versions of a check.

        If the run itself failed, only that verdict counts.
        """
        self.version, self.seeds = record["version"], self.seeds + 1
        ended = [v["scene"] for v in record["verdicts"] if v["property"] == RUN and v["status"] == FAIL]
        for verdict in record["verdicts"]:
            check = verdict["property"]
            if verdict["card"] != check_of(check) or (check != RUN and verdict["scene"] in ended):
                continue
            self.counts.setdefault(check, Counter())[verdict["status"]] += 1
            if verdict["status"] == FAIL:
                self.violations.append(verdict)
            elif verdict.get("measured") and verdict.get("allowed"):
                part = verdict["measured"] / verdict["allowed"]
                self.worst[check] = max(self.worst.get(check, (0.0, "")), (part, verdict["scene"]))

    def to_record(self) -> dict[str, Any]:
        """Return the counts as a JSON document."""
        checks = {
            name: {
                "card": check_of(name),
                "about": about(name),
                **counts,
                "worst": self.worst.get(name, (0.0, "")),
            }
            for name, counts in self.counts.items()
        }
        return {
            "engine": self.plan.engine,
            "version": self.version,
            "family": self.plan.family,
            "mechanisms": self.plan.mechanisms,
            "first_seed": self.plan.first,
            "seeds": self.seeds,
            "cards": checks,
            "violations": self.violations,
        }


def about(name: str) -> str:
    """Return the sentence that describes a check."""
    return ABOUT if name == AGREEMENT else suite.abouts()[name]


def examined(plan: Plan, path: str | None = None, progress: Callable[[str], None] | None = None) -> Tally:
    """Judge random mechanisms in this process until each check is decided on the planned number of them.

    The search ends after MOST times as many seeds. Records at ``path`` (JSON lines) replace runs; verdicts of
    new checks are added to them.
    """
    known, tally = opened(path), Tally(plan)
    checked(path, list(known.values()), OfSeed)
    for seed in itertools.islice(itertools.count(plan.first), MOST * plan.mechanisms):
        wanted = tally.open()
        if not wanted:
            break
        key = f"{plan.engine} {plan.family} {seed}"
        before = known.get(key, NOTHING)
        if missing := unasked(before, wanted):
            added = _record(plan, seed, missing)
            asked = [*before.get("asked", ()), *map(check_of, missing)]
            verdicts = [*before["verdicts"], *added["verdicts"]]
            known[key] = {"key": key, **added, "asked": asked, "verdicts": verdicts}
            append(path, known[key])
        tally.add(known[key])
        if progress:
            progress(f"seed {seed}")
    return tally


def unasked(record: dict[str, Any], wanted: Collection[str]) -> list[str]:
    """Return the wanted checks, in their present version, on which a seed's record has no verdict; no check
    if the run of the seed failed."""
    if any(v["property"] == RUN and v["status"] == FAIL for v in record["verdicts"]):
        return []
    asked = {*record.get("asked", ()), *(verdict["card"] for verdict in record["verdicts"])}
    return [check for check in wanted if check_of(check) not in asked]


def _record(plan: Plan, seed: int, wanted: Collection[str]) -> dict[str, Any]:
    """Return the verdicts of one seed. A check without verdict on one kind of mechanism is made on the next
    kind."""
    runner, version = InProcess(engine(plan.engine), plan.engine), ""
    verdicts: list[Verdict] = []
    for draw, asked in KINDS:
        decided = {verdict.property for verdict in verdicts if verdict.status in DECIDED}
        checks = [check for check in asked if check in wanted and check not in decided]
        if checks:
            specimen = Specimen(draw(seed), None, True, reference_time=0.0, large=draw is graph_of_suite)
            bench = suite.asked(runner, specimen, plan.family)
            version = bench.version if isinstance(bench, Bench) else version
            verdicts += _verdicts(plan, bench, checks) if isinstance(bench, Bench) else [bench]
    return {"version": version, "verdicts": [suite.record_of(verdict) for verdict in verdicts]}


def _verdicts(plan: Plan, bench: Bench, checks: Sequence[str]) -> Iterator[Verdict]:
    """Return the verdicts of the checks; only the verdict on the run if it does not complete."""
    if not bench.cannot and REFUSAL not in checks and (run := suite.first_run(bench)).status == FAIL:
        yield run
        return
    for check in checks:
        if bench.cannot and check != REFUSAL:
            yield Verdict(check, bench.scene.name, CANNOT, reason=str(bench.cannot))
        elif check == AGREEMENT:
            yield from (agreement(bench, other) for other in plan.beside)
        else:
            yield suite.verdict_on(check, bench)


def agreement(bench: Bench, other: str) -> Verdict:
    """Compare the motion with another engine's (NAME or NAME=FAMILY), both at their finest settings."""
    name, (called, _, family) = bench.scene.name, other.partition("=")
    beside = set_up(InProcess(engine(called), called), bench.specimen, family)
    if beside.cannot:
        return Verdict(AGREEMENT, name, CANNOT, reason=f"{other}: {beside.cannot}")
    try:
        apart = difference(bench.scene, bench.motion, beside.motion)
        allowed = bench.resolution + beside.resolution
    except Broken as broken:
        return Verdict(AGREEMENT, name, FAIL, reason=f"{other}: {broken}")
    return Verdict(AGREEMENT, name, PASS if apart <= allowed else FAIL, apart, allowed, f"with {other}")
