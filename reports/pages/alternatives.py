"""The page on alternatives of engines."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from crosscheck.alternatives import table
from crosscheck.alternatives.records import EVERY, FILE, GRAPHS, TIME_LIMIT, Record, read

from ..blocks import Fold, Parts, Table, Within

PAIRS = ("pair of ways", "mechanisms", "median", "worst", "in", "of", "limit", "above")


def parts(records: Path = FILE) -> Parts:
    """Return the parts of the page from the records in a file."""
    found = table.engines(read(records))
    rows = [
        (pair.engine, *_pair(pair), _cause(pair.cause))
        for own in found.values()
        for pair in table.pairs(own)
        if pair.cause
    ]
    return {
        "summary": [Table("Ways of engines on random mechanisms.", table.HEADER, _summary(found))],
        "above": [Table("Pairs above their limit.", ("engine", *PAIRS, "cause"), rows)],
        "engines": [_engine(name, own) for name, own in found.items()],
        "graphs": str(GRAPHS),
        "every": str(EVERY),
        "limit": f"{TIME_LIMIT:g}",
    }


def _summary(found: dict[str, list[Record]]) -> list[Sequence[str]]:
    return [(Within(name, f"#{name}"), *table.line(own)[1:]) for name, own in found.items()]


def _pair(pair: table.Pair) -> tuple[str, ...]:
    worst = pair.found[0]
    return (
        " – ".join(pair.ways),
        str(len(pair.found)),
        f"{pair.median:.0e}",
        f"{worst.size:.0e}",
        worst.quantity,
        f"{worst.body} of `{worst.scene}`",
        f"{pair.within:.0e}",
        str(pair.above),
    )


def _cause(cause: table.Cause | None) -> str:
    assert cause
    return cause.because + f" ([{cause.finding}](findings.md#{cause.finding}))" * bool(cause.finding)


def _engine(name: str, own: Sequence[Record]) -> Fold:
    off = [(way, str(len(s)), f"{s[len(s) // 2]:.0e}", f"{s[0]:.0e}") for way, s in table.off(own).items()]
    ends = [(way, outcome, str(count)) for way, outcome, count in table.ends(own)]
    blocks = [
        Table("Largest relative difference of two ways.", PAIRS, [_pair(pair) for pair in table.pairs(own)]),
        Table("Distance from Gauss's principle at the start.", ("way", "mechanisms", "median", "worst"), off),
        Table("Ways that end early.", ("way", "outcome", "mechanisms"), ends),
    ]
    return Fold(f"{name} {own[0]['version']}", name, [block for block in blocks if block.rows])
