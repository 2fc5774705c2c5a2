"""Every card on many drawn mechanisms, each until it has its number; records are kept, so that a run resumes.

All cards that ask something of a mechanism share its runs: the judged run, its perturbed run, coarser ones
and the exact motion are made once.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from crosscheck.conformance import suite
from crosscheck.conformance.drawn import floating, mechanism, rotor, without_masses
from crosscheck.conformance.properties import PROPERTIES
from crosscheck.conformance.runners import InProcess
from crosscheck.conformance.suite import CANNOT, FAIL, PASS, REFUSAL, RUN, Verdict
from crosscheck.conformance.trial import Bench, Broken, Specimen, difference, set_up
from crosscheck.engine import engine
from mbref.records import append, opened
from mbref.scene import Scene

AGREEMENT = "agreement"
ABOUT = "Trajectories of two engines agree within what the measured order and floor of both leave of error."
MOST = 3  # seeds for each mechanism asked for, where a card says nothing of some
DECIDED = (PASS, FAIL)
NOTHING: dict[str, Any] = {"verdicts": ()}
ELSEWHERE = ("momentum", "replayed", "dead end", "refined")  # cards of other kinds, or of scenes of the suite
KINDS: tuple[tuple[Callable[[int], Scene], tuple[str, ...]], ...] = (
    (mechanism, (RUN, AGREEMENT, *(card for card in PROPERTIES if card not in ELSEWHERE))),
    (floating, ("energy", "momentum", "reversed")),
    (rotor, ("replayed",)),
    (without_masses, (REFUSAL,)),
)


class Plan(NamedTuple):
    """So many ``mechanisms`` for each card, from seed ``first`` on, in an engine's best family or the one
    named; ``beside`` are engines to agree with, as NAME or NAME=FAMILY."""

    engine: str
    mechanisms: int
    first: int = 0
    family: str = ""
    beside: Sequence[str] = ()


@dataclass
class Tally:
    """Counts of verdicts by card and status, the largest part of the allowance that was used and where, and
    the violations."""

    plan: Plan
    version: str = ""
    seeds: int = 0
    counts: dict[str, Counter[str]] = field(default_factory=dict)
    worst: dict[str, tuple[float, str]] = field(default_factory=dict)
    violations: list[dict[str, Any]] = field(default_factory=list)

    @property
    def conforms(self) -> bool:
        """Whether no card is violated, and some mechanism was run."""
        return not self.violations and self.decided(RUN) > 0

    def open(self) -> list[str]:
        """Cards that are not decided on as many mechanisms as planned."""
        cards = list(dict.fromkeys(card for _, asked in KINDS for card in asked))
        asked = [card for card in cards if card != AGREEMENT or self.plan.beside]
        return [card for card in asked if self.decided(card) < self.plan.mechanisms]

    def decided(self, card: str) -> int:
        """Mechanisms that a card was decided on."""
        counts = self.counts.get(card, Counter())
        return sum(counts[status] for status in DECIDED)

    def add(self, record: dict[str, Any]) -> None:
        """Count a record's verdicts except for older cards; of a run that ended early count only that
        card."""
        self.version, self.seeds = record["version"], self.seeds + 1
        ended = [v["scene"] for v in record["verdicts"] if v["property"] == RUN and v["status"] == FAIL]
        for verdict in record["verdicts"]:
            card = verdict["property"]
            if verdict["card"] != card_of(card) or (card != RUN and verdict["scene"] in ended):
                continue
            self.counts.setdefault(card, Counter())[verdict["status"]] += 1
            if verdict["status"] == FAIL:
                self.violations.append(verdict)
            elif verdict["measured"] and verdict["allowed"]:
                part = verdict["measured"] / verdict["allowed"]
                self.worst[card] = max(self.worst.get(card, (0.0, "")), (part, verdict["scene"]))

    def to_record(self) -> dict[str, Any]:
        """The counts as JSON."""
        cards = {
            name: {
                "card": card_of(name),
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
            "cards": cards,
            "violations": self.violations,
        }


def card_of(name: str) -> str:
    """A card with its version."""
    return Verdict(name, "", PASS).card()


def about(name: str) -> str:
    """The check of a card in a sentence."""
    return ABOUT if name == AGREEMENT else suite.abouts()[name]


def examined(plan: Plan, path: str | None = None, progress: Callable[[str], None] | None = None) -> Tally:
    """Judge drawn mechanisms in this process until each card is decided on as many as planned, or seeds are
    MOST times as many; records at ``path`` (JSON lines) are taken instead of runs, and added to where a card
    is new."""
    known, tally = opened(path), Tally(plan)
    for seed in itertools.islice(itertools.count(plan.first), MOST * plan.mechanisms):
        wanted = tally.open()
        if not wanted:
            break
        key = f"{plan.engine} {plan.family} {seed}"
        before = known.get(key, NOTHING)
        if missing := unasked(before, wanted):
            added = _record(plan, seed, missing)
            asked = [*before.get("asked", ()), *map(card_of, missing)]
            verdicts = [*before["verdicts"], *added["verdicts"]]
            known[key] = {"key": key, **added, "asked": asked, "verdicts": verdicts}
            append(path, known[key])
        tally.add(known[key])
        if progress:
            progress(f"seed {seed}")
    return tally


def unasked(record: dict[str, Any], wanted: Collection[str]) -> list[str]:
    """Cards, of those wanted, that a seed's record says nothing of, in this version of the card; none where
    the run itself failed."""
    if any(v["property"] == RUN and v["status"] == FAIL for v in record["verdicts"]):
        return []
    asked = {*record.get("asked", ()), *(verdict["card"] for verdict in record["verdicts"])}
    return [card for card in wanted if card_of(card) not in asked]


def _record(plan: Plan, seed: int, wanted: Collection[str]) -> dict[str, Any]:
    """The verdicts of one seed: a card is asked of the next kind of mechanism where it has none yet."""
    runner, version = InProcess(engine(plan.engine), plan.engine), ""
    verdicts: list[Verdict] = []
    for draw, asked in KINDS:
        decided = {verdict.property for verdict in verdicts if verdict.status in DECIDED}
        cards = [card for card in asked if card in wanted and card not in decided]
        if cards:
            specimen = Specimen(draw(seed), None, True, reference_time=0.0)
            bench = suite.asked(runner, specimen, plan.family)
            version = bench.version if isinstance(bench, Bench) else version
            verdicts += _verdicts(plan, bench, cards) if isinstance(bench, Bench) else [bench]
    return {"version": version, "verdicts": [suite.record_of(verdict) for verdict in verdicts]}


def _verdicts(plan: Plan, bench: Bench, cards: Sequence[str]) -> Iterator[Verdict]:
    """Return the verdicts of the cards; only the verdict on the run if it does not complete."""
    if not bench.cannot and REFUSAL not in cards and (run := suite.first_run(bench)).status == FAIL:
        yield run
        return
    for card in cards:
        if bench.cannot and card != REFUSAL:
            yield Verdict(card, bench.scene.name, CANNOT, reason=str(bench.cannot))
        elif card == AGREEMENT:
            yield from (agreement(bench, other) for other in plan.beside)
        else:
            yield suite.verdict_on(card, bench)


def agreement(bench: Bench, other: str) -> Verdict:
    """Check the motion against another engine (NAME or NAME=FAMILY), by the finest settings of both."""
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
