"""The page on alternatives of engines."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from statistics import fmean, median

from crosscheck.alternatives import table
from crosscheck.alternatives.records import EVERY, FILE, GRAPHS, TIME_LIMIT, Record, read

from ..blocks import Fold, Marked, Parts, Table, Within

ABOVE = ("engine", "way", "pairs", "mechanisms", "worst", "in", "of", "limit", "cause")
WAYS = ("way", "mechanisms", "mean CPU time, s", "median distance", "worst distance")
PAIRS = ("pair of ways", "mechanisms", "median", "worst", "in", "of", "limit", "above")


def parts(records: Path = FILE) -> Parts:
    """Return the parts of the page from the records in a file."""
    found = table.engines(read(records))
    return {
        "summary": [Table("Ways of engines on random mechanisms.", table.HEADER, _summary(found))],
        "above": [Table("Ways that differ, and why.", ABOVE, [_above(row) for row in table.above(found)])],
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
        f"`{worst.body}` of `{worst.scene}`",
        f"{pair.within:.0e}",
        str(len(pair.above)),
    )


def _above(row: table.Above) -> tuple[str, ...]:
    worst, cause = max(pair.found[0] for pair in row.pairs), row.cause
    return (
        cause.engine,
        cause.way,
        str(len(row.pairs)),
        str(len({each.scene for pair in row.pairs for each in pair.above})),
        f"{worst.size:.0e}",
        worst.quantity,
        f"`{worst.body}` of `{worst.scene}`",
        f"{row.pairs[0].within:.0e}",
        Marked(cause.because + f" ([finding](findings.md#{cause.finding}))" * bool(cause.finding)),
    )


def _way(name: str, of_way: table.Completed) -> tuple[str, ...]:
    off = (f"{median(of_way.off):.0e}", f"{max(of_way.off):.0e}") if of_way.off else ("", "")
    return name, str(len(of_way.seconds)), f"{fmean(of_way.seconds):.1g}", *off


def _engine(name: str, own: Sequence[Record]) -> Fold:
    ways = [_way(name, of_way) for name, of_way in table.ways(own).items()]
    ends = [(way, outcome, str(count)) for way, outcome, count in table.ends(own)]
    blocks = [
        Table("Largest relative difference of two ways.", PAIRS, [_pair(pair) for pair in table.pairs(own)]),
        Table("Ways, and their distance from Gauss's principle at the start.", WAYS, ways),
        Table("Ways that end early.", ("way", "outcome", "mechanisms"), ends),
    ]
    return Fold(f"{name} {own[0]['version']}", name, [block for block in blocks if block.rows])
