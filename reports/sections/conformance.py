"""Conformance: cards of the suite against engines, violations explained, and the defects that prove cards.

Rendered from what ``crosscheck verify ENGINE --json`` prints.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from crosscheck.conformance.explained import explanations, proofs
from crosscheck.conformance.suite import CANNOT, FAIL, MARKS, OUTSIDE, PASS, abouts
from crosscheck.study.sentences import title
from reports.blocks import Block, Heading, Table, Text

Verified = Mapping[str, Any]  # an engine, its version and its verdicts

CAPTION = (
    "Cards of the conformance suite against engines: the number of the suite's mechanisms on which an engine "
    "passes (✓) and fails (✗); –: on no mechanism can the engine be asked, ○: no mechanism is in the card's "
    "domain. Defects: the planted defects of an example engine that the card tells, each of one line."
)
UNEXPLAINED = "not explained yet"


def render(verified: Sequence[Verified]) -> list[Block]:
    """The section; nothing without verified engines."""
    if not verified:
        return []
    return [Heading("Conformance", 2), Text(_engines(verified)), _cards(verified), *_violations(verified),
            _defects()]  # fmt: skip


def _engines(verified: Sequence[Verified]) -> str:
    """The engines with their versions and the counts of their verdicts."""
    told = []
    for found in verified:
        counts = {status: sum(v["status"] == status for v in found["verdicts"]) for status in MARKS}
        violated = f"{counts[FAIL]} violated" if counts[FAIL] else "none violated"
        told.append(
            f"{title(found['engine'])} {found['version']}: {counts[PASS]} verdicts hold, {violated}, "
            f"{counts[CANNOT]} cannot be asked, {counts[OUTSIDE]} are outside their card's domain."
        )
    return f"crosscheck verify holds every engine against the same cards. {' '.join(told)}"


def _cards(verified: Sequence[Verified]) -> Table:
    names = {v["property"]: v["card"] for found in verified for v in found["verdicts"]}
    header = ("Card", "It checks", "Defects", *(title(found["engine"]) for found in verified))
    rows = [
        (card, abouts().get(name, ""), str(sum(proof.card == name for proof in proofs())),
         *(_cell([v["status"] for v in found["verdicts"] if v["property"] == name]) for found in verified))
        for name, card in names.items()
    ]  # fmt: skip
    return Table(CAPTION, header, rows, frozenset({2}))


def _cell(statuses: Sequence[str]) -> str:
    counts = [f"{MARKS[s][0]} {statuses.count(s)}" for s in (PASS, FAIL) if s in statuses]
    return ", ".join(counts) or (MARKS[CANNOT][0] if CANNOT in statuses else MARKS[OUTSIDE][0])


def _violations(verified: Sequence[Verified]) -> list[Block]:
    """Each violation with its numbers, cause and remedy."""
    rows = [
        _violation(found["engine"], v) for found in verified for v in found["verdicts"] if v["status"] == FAIL
    ]
    if not rows:
        return [Text("No engine violates a card.")]
    header = ("Engine", "Mechanism", "Card", "Measured", "Allowed", "Cause", "Remedy")
    return [
        Heading("Violations"),
        Table("Every violated card, with its cause.", header, rows, frozenset({3, 4})),
    ]


def _violation(engine: str, verdict: Mapping[str, Any]) -> tuple[str, ...]:
    known = explanations().get((engine, verdict["property"], verdict["scene"]))
    cause, remedy = known or (verdict["reason"] or UNEXPLAINED, "–")
    measured, allowed = (_number(verdict[name]) for name in ("measured", "allowed"))
    return title(engine), verdict["scene"], verdict["card"], measured, allowed, cause, remedy


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.1e}"


def _defects() -> Table:
    rows = [(proof.about, proof.scene, proof.card) for proof in proofs()]
    return Table(f"The {len(rows)} planted defects, each with the card that tells it.",
                 ("Defect", "Mechanism", "Card"), rows, folded=True)  # fmt: skip
