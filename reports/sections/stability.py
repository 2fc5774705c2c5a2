"""Section: stability ladders as heat maps, the number of correct digits of each method and engine as one
difficulty grows."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from crosscheck.judge.tolerances import FALSE_SUCCESS
from crosscheck.study.grid import Record
from crosscheck.study.record_view import error, is_completed
from crosscheck.study.stability import MBREF, METHODS, RTOL, Ladder, ladders, place
from mbref.motions.trajectory import Outcome

from ..blocks import Block, Cell, Heading, HeatMap, Table, Text
from ..runs import Curve

# largest error of a right run of an mbref method; a completed run with a larger error is a false success
ALLOWED = 1e3 * RTOL
MOST_DIGITS = 15.0
LETTERS = {  # letters of outcomes that the paper's tables do not contain
    "SINGULAR_POSITION": "s",
    "UNDECIDED": "u",
    "LEFT_MOTION": "m",
    "TIMED_OUT": "t",
    "CRASHED": "x",
    "NOT_FINITE": "n",
}
HOW = (
    "Numbers are digits kept: minus the logarithm of the largest error. Red cells, bold in the text, are "
    f"false successes: completed with an error above {ALLOWED:g}, of other engines above {FALSE_SUCCESS:g}. "
    "A letter names the outcome of a run that ended early: a singular "
    "matrix, b iteration not converged, c violation, d step failed, s singular position, u branch undecided, "
    "m left the motion, t out of time, x crashed, n not finite. Empty cells were not run."
)
WHEN = (
    "taylor, the default, follows a motion across singular positions, and ends UNDECIDED where double "
    "precision cannot decide the branch; projection ends at the singular position, because it watches the "
    "rank. The other methods run on by their own rules: some cross, with all digits or with fewer, some fail "
    "there, and a run that ends on another branch has the outcome LEFT_MOTION."
)

SERIES = "taylor"  # the default method
Runs = Mapping[Curve, Mapping[float, Record]]  # by engine and family, by difficulty


def render(records: Sequence[Record]) -> list[Block]:
    """Return two sentences of result, advice, counts of false successes, and a heat map for each ladder."""
    found = _runs(records)
    shown = [ladder for ladder in ladders() if ladder.name in found]
    maps = [_map(ladder, found[ladder.name]) for ladder in shown]
    counts = _counts(shown, found)
    return [
        Heading("Stability", 2),
        *(Text(sentence) for sentence in _results(counts)),
        Text(WHEN),
        Text(HOW),
        _table(counts),
        *maps,
    ]


def _runs(records: Iterable[Record]) -> dict[str, Runs]:
    """Return the runs of each ladder, mbref's methods first."""
    order = {method: k for k, method in enumerate(METHODS)}
    found: dict[str, dict[Curve, dict[float, Record]]] = {}
    for record in sorted(records, key=lambda r: _place(r, order)):
        ladder, difficulty = place(record["scene"])
        curve = record["engine"], record["family"]
        found.setdefault(ladder, {}).setdefault(curve, {})[difficulty] = record
    return dict(found)


def _place(record: Record, order: Mapping[str, int]) -> tuple[bool, int, str, str]:
    return record["engine"] != MBREF, order.get(record["family"], 0), record["engine"], record["family"]


def is_false(record: Record) -> bool:
    """Return whether a run completed with an error above ALLOWED, or above FALSE_SUCCESS for other
    engines."""
    allowed = ALLOWED if record["engine"] == MBREF else FALSE_SUCCESS
    return is_completed(record) and not error(record) <= allowed


class Count(NamedTuple):
    """Runs of a method over all ladders: completed and right, ended early, and completed but wrong."""

    right: int
    ended: int
    false: int


def _counts(shown: Sequence[Ladder], found: Mapping[str, Runs]) -> dict[Curve, Count]:
    """Return the counts of every engine and method."""
    counts: dict[Curve, Count] = {}
    for curve in dict.fromkeys(curve for runs in found.values() for curve in runs):
        records = [r for ladder in shown for r in found[ladder.name].get(curve, {}).values()]
        false = sum(map(is_false, records))
        right = sum(map(is_completed, records)) - false
        counts[curve] = Count(right, len(records) - right - false, false)
    return counts


def _results(counts: Mapping[Curve, Count]) -> list[str]:
    """Return a sentence on `taylor`, and one on the other methods and engines."""
    first = counts.get((MBREF, SERIES))
    others = {curve: count for curve, count in counts.items() if curve != (MBREF, SERIES)}
    if first is None or not others:
        return []
    best = max(others, key=lambda curve: others[curve].right)
    worst = max(others, key=lambda curve: others[curve].false)
    wrong = (
        f"{_name(worst)} completes wrong motions most often ({others[worst].false} of {sum(others[worst])})"
        if others[worst].false
        else "none completes a wrong motion"
    )
    return [
        f"Of {sum(first)} runs by taylor {first.right} are right, {first.ended} ended early, and "
        f"{first.false} completed with a wrong motion.",
        f"Of the others, {_name(best)} is right most often "
        f"({others[best].right} of {sum(others[best])} runs), and {wrong}.",
    ]


def _table(counts: Mapping[Curve, Count]) -> Table:
    """Return the counts as a table."""
    rows = [(*curve, *map(str, count)) for curve, count in counts.items()]
    caption = (
        "Runs of all ladders: completed and right, ended early, and completed but wrong (false successes)."
    )
    return Table(caption, ("Engine", "Method", "Right", "Ended", "False"), rows, right=frozenset({2, 3, 4}))


def _map(ladder: Ladder, runs: Runs) -> HeatMap:
    """Return a heat map with one row for each method and one column for each rung."""
    difficulties = [difficulty for difficulty, _ in ladder.rungs]
    rows = {_name(curve): [_cell(row.get(d)) for d in difficulties] for curve, row in runs.items()}
    caption = f"{ladder.name.replace('_', ' ').capitalize()}. {ladder.words}"
    return HeatMap(caption, ladder.label, [rung(d) for d in difficulties], rows)


def rung(difficulty: float) -> str:
    """Return a difficulty as the label of its column: 0.3, 1.5, 3e-5, 1e12."""
    return re.sub(r"e([+-])0?", lambda sign: "e" + sign[1].strip("+"), f"{difficulty:g}")


def _cell(record: Record | None) -> Cell:
    """Return the cell of a run: correct digits, the letter of an early end, or nothing."""
    if record is None:
        return Cell("", "")
    if not is_completed(record):
        return Cell(_letter(record["outcome"]), "ended")
    digits = _digits(error(record))
    return (
        Cell(f"{digits:.0f}", "false")
        if is_false(record)
        else Cell(f"{digits:.0f}", "kept", digits / MOST_DIGITS)
    )


def _name(curve: Curve) -> str:
    engine, family = curve
    return family if engine == MBREF else f"{engine} {family}"


def _letter(outcome: str) -> str:
    return Outcome[outcome].letter or LETTERS[outcome]


def _digits(value: float) -> float:
    """Return the number of correct digits for an error; at least 0."""
    return 0.0 if not value < 1.0 else -math.log10(max(value, 10**-MOST_DIGITS))
