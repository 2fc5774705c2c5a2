"""Section: results of the conformance checks for each engine, violations with their causes, and the planted
defects that the checks detect.

The section is rendered from the output of ``crosscheck verify ENGINE --json``: verdicts on the suite's
mechanisms, of an engine or one of its families, and, with ``--mechanisms``, counts on random mechanisms.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from crosscheck.conformance.explained import explanations, proofs
from crosscheck.conformance.suite import CANNOT, FAIL, OUTSIDE, PASS, abouts
from crosscheck.study.words.speed import title

from ..blocks import Block, Heading, Table, Text

Verified = Mapping[str, Any]  # an engine, its version and its verdicts, as stored in JSON
Verdict = Mapping[str, Any]

ENGINES = (
    "Each engine's verdicts, from `crosscheck verify ENGINE`: checks that it passes, checks that it "
    "violates, checks on mechanisms that it refuses, and checks that do not apply to a mechanism."
)
CHECKS = (
    "Checks of the conformance suite: the number of planted defects of an example engine that a check "
    "detects, how many engines pass it on each of their mechanisms, and which engines violate it."
)
FAMILIES = (
    "Formulations and stabilisations of mbref on six moving mechanisms: the number of verdicts. Mechanisms "
    "that a method does not support, such as redundant ones for some methods, are not counted."
)
DRAWN = (
    "Checks on random mechanisms: closed loops of 3 to 8 bodies with all kinds of joints, loads and drivers, "
    "floating ones, rotors, and ones without masses. Shown is on how many a check holds, of how many it was "
    "decided on."
)
CAUSES = (
    "Causes of violated checks: the checks, the most violated one first, each with its number of mechanisms; "
    "and the mechanism and numbers of the worst violation."
)
ANY_RANDOM = "random mechanisms"  # stands for all random mechanisms in the file of explanations
UNEXPLAINED = "not explained yet"


def render(verified: Sequence[Verified]) -> list[Block]:
    """Return the section; empty without verdicts."""
    if not verified:
        return []
    drawn = [found for found in verified if "mechanisms" in found]
    families = [found for found in verified if found.get("family") and "verdicts" in found]
    engines = [found for found in verified if "verdicts" in found and not found.get("family")]
    blocks: list[Block] = [Heading("Conformance", 2)]
    if engines:
        blocks += [_engines(engines), _checks(engines), *_violations(engines)]
    if families:
        blocks += [Heading("Methods of mbref"), _families(families)]
    if drawn:
        blocks += [Heading("Drawn mechanisms"), _drawn(drawn), *_drawn_violations(drawn)]
    return [*blocks, _defects()]


def _families(verified: Sequence[Verified]) -> Table:
    """Return a table with one row for each family: counts of verdicts, and violated checks with their
    causes."""
    rows = []
    for found in verified:
        counts = [
            str(sum(v["status"] == s for v in found["verdicts"])) for s in (PASS, FAIL, CANNOT, OUTSIDE)
        ]
        failed = [v for v in found["verdicts"] if v["status"] == FAIL]
        checks = dict.fromkeys(v["card"] for v in failed)
        scenes = dict.fromkeys(v["scene"] for v in failed)
        where = f"{', '.join(checks)} on {', '.join(scenes)}" if failed else "none"
        rows.append((found["family"], *counts, where, _cause(found["family"], failed)))
    header = ("Method", "Holds", "Violated", "Cannot", "Outside", "Violations", "Cause and remedy")
    return Table(FAMILIES, header, rows, frozenset({1, 2, 3, 4}))


def _cause(family: str, failed: Sequence[Mapping[str, Any]]) -> str:
    """Return the sentences on the causes of a family's violations."""
    causes = [explanations().get((f"mbref {family}", v["property"], v["scene"])) for v in failed]
    sentences = dict.fromkeys(f"{known.cause} {known.remedy}" for known in causes if known)
    return " ".join([*sentences, *([UNEXPLAINED] if None in causes else [])]) or "–"


def _drawn(verified: Sequence[Verified]) -> Table:
    """Return the table of checks and engines on random mechanisms: the number of mechanisms on which a check
    passes, and the number on which it has a verdict."""
    names = {name: check for found in verified for name, check in found["cards"].items()}
    rows = [
        (check["card"], check["about"], *(_share(found["cards"].get(name, {})) for found in verified))
        for name, check in names.items()
    ]
    engines = (" ".join(filter(None, (title(f["engine"]), f["family"]))) for f in verified)
    return Table(DRAWN, ("Check", "It checks", *engines), rows, frozenset(range(2, 2 + len(verified))))


def _share(counts: Mapping[str, Any]) -> str:
    held, judged = counts.get(PASS, 0), counts.get(PASS, 0) + counts.get(FAIL, 0)
    return "–" if not judged else f"{held}" if held == judged else f"{held} of {judged}"


def _drawn_violations(verified: Sequence[Verified]) -> list[Block]:
    """Return the violations by engine and check, with the largest number, cause and remedy."""
    rows = []
    for found in verified:
        for name in dict.fromkeys(v["property"] for v in found["violations"]):
            here = [v for v in found["violations"] if v["property"] == name]
            worst = max(here, key=_excess)
            why = _explanation(found["engine"], worst, ANY_RANDOM)
            where = (str(len(here)), worst["scene"])
            rows.append((title(found["engine"]), worst["card"], *where, *_numbers(worst), *why))
    if not rows:
        return [Text("No random mechanism violates a check.")]
    header = ("Engine", "Check", "Times", "Worst", "Measured", "Allowed", "Cause", "Remedy")
    return [
        Table(
            "Violated checks on random mechanisms, each with its worst violation.",
            header,
            rows,
            frozenset({2, 4, 5}),
        )
    ]


def _engines(verified: Sequence[Verified]) -> Table:
    """Return a table with one row for each engine: its version and the counts of its verdicts."""
    rows = []
    for found in verified:
        counts = [sum(v["status"] == s for v in found["verdicts"]) for s in (PASS, FAIL, CANNOT, OUTSIDE)]
        rows.append((title(found["engine"]), found["version"], *map(str, counts)))
    header = ("Engine", "Version", "Passed", "Violated", "Refused", "Not applicable")
    return Table(ENGINES, header, rows, frozenset({2, 3, 4, 5}))


def _checks(verified: Sequence[Verified]) -> Table:
    """Return a table with one row for each check: its meaning, and the engines that pass and violate it."""
    names = {v["property"]: v["card"] for found in verified for v in found["verdicts"]}
    rows = []
    for name, check in names.items():
        counts = {found["engine"]: _counts(found, name) for found in verified}
        judged = {engine: (passed, failed) for engine, (passed, failed) in counts.items() if passed + failed}
        violated = [f"{title(e)} on {f} of {p + f}" for e, (p, f) in judged.items() if f]
        rows.append(
            (
                check,
                abouts().get(name, ""),
                str(sum(proof.check == name for proof in proofs())),
                f"{len(judged) - len(violated)} of {len(judged)}",
                ", ".join(violated) or "none",
            )
        )
    header = ("Check", "It checks", "Defects", "Engines pass", "Violated by")
    return Table(CHECKS, header, rows, frozenset({2, 3}))


def _counts(found: Verified, check: str) -> tuple[int, int]:
    """Return the numbers of mechanisms on which an engine passes and violates a check."""
    statuses = [v["status"] for v in found["verdicts"] if v["property"] == check]
    return statuses.count(PASS), statuses.count(FAIL)


def _violations(verified: Sequence[Verified]) -> list[Block]:
    """Return a table with one row for each cause of violations, and a folded table of all violations."""
    failed = [(found["engine"], v) for found in verified for v in found["verdicts"] if v["status"] == FAIL]
    if not failed:
        return [Text("No engine violates a check.")]
    groups: dict[tuple[str, str, str], list[Verdict]] = {}
    for engine, verdict in failed:
        groups.setdefault((engine, *_explanation(engine, verdict, verdict["scene"])), []).append(verdict)
    causes = []
    for (engine, cause, remedy), of in groups.items():
        worst = sorted(of, key=_excess, reverse=True)
        numbers = worst[0]["scene"], *_numbers(worst[0])
        causes.append((title(engine), _counted(worst), *numbers, cause, remedy))
    single = [(title(engine), v["scene"], v["card"], *_numbers(v)) for engine, v in failed]
    header = ("Engine", "Violated checks", "Worst on", "Measured", "Allowed", "Cause", "Remedy")
    return [
        Heading("Violations"),
        Table(CAUSES, header, causes, frozenset({3, 4})),
        Table(
            f"The {len(single)} violated checks, each with its number and limit.",
            ("Engine", "Mechanism", "Check", "Measured", "Allowed"),
            single,
            frozenset({3, 4}),
            folded=True,
        ),
    ]


def _counted(violations: Sequence[Verdict]) -> str:
    """Return the names of violated checks in their order, each with its number of mechanisms."""
    counts = Counter(v["card"] for v in violations)
    return ", ".join(f"{card} ({n})" for card, n in counts.items())


def _excess(verdict: Verdict) -> float:
    """Return a violation's number as a multiple of its limit; 0 without a number."""
    return (verdict["measured"] or 0.0) / (verdict["allowed"] or 1.0)


def _explanation(engine: str, verdict: Verdict, scene: str) -> tuple[str, str]:
    """Return cause and remedy of a violation."""
    return explanations().get((engine, verdict["property"], scene)) or (verdict["reason"] or UNEXPLAINED, "–")


def _numbers(verdict: Verdict) -> tuple[str, str]:
    """Return the measured number and its limit."""
    measured, allowed = ("–" if (n := verdict[k]) is None else f"{n:.1e}" for k in ("measured", "allowed"))
    return measured, allowed


def _defects() -> Table:
    rows = [(proof.about, proof.scene, proof.check) for proof in proofs()]
    return Table(
        f"The {len(rows)} planted defects, each with the check that detects it.",
        ("Defect", "Mechanism", "Check"),
        rows,
        folded=True,
    )
