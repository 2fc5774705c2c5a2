"""Stability ladders as heat maps: digits that each method and engine keeps while one difficulty grows."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from functools import partial

import matplotlib
import numpy as np
from matplotlib.figure import Figure as Drawing

from crosscheck.judge.tolerances import FALSE_SUCCESS
from crosscheck.study.grid import Record
from crosscheck.study.record_view import error, is_completed
from crosscheck.study.stability import FIXED_STEPS, MBREF, METHODS, RTOL, Ladder, ladders, place
from mbref.trajectory import Outcome
from reports import figures
from reports.blocks import Block, Figure, Heading, Table, Text
from reports.runs import Curve

ALLOWED = max(1e3 * RTOL, 1e-6)  # error of a method of mbref beyond which a completed run is a false success
MOST_DIGITS = 15.0
DARK = 14.0  # digits from which on a cell is so dark that white is read better on it
LETTERS = {  # of outcomes that the paper's tables do not have
    "UNDECIDED": "u", "LEFT_MOTION": "m", "TIMED_OUT": "t", "CRASHED": "x", "NOT_FINITE": "n",
}  # fmt: skip
HOW = (
    "Numbers are digits kept: minus the logarithm of the largest error. Red cells are false successes, "
    f"completed with an error above {ALLOWED:g}, or {FALSE_SUCCESS:g} of engines and of ali3-p, which has no "
    "tolerance. A letter names the outcome of a run that ended early: a singular matrix, b iteration not "
    "converged, c violation, d step failed, u branch undecided, m left the motion, t out of time, x crashed, "
    "n not finite. Empty cells were not run."
)
WHEN = (
    "Where a mechanism passes singular positions, or comes near them, projection (the default) and taylor "
    "follow the motion, whether it crosses, turns back or misses, and end UNDECIDED where double precision "
    "does not tell. Partitioning, the null space and rows dropped at every step pass some crossings with "
    "fewer digits and end early at others, ali3-p goes over them with the second order of its steps, and "
    "Baumgarte's feedback, unstabilised pseudo-inverses and rows dropped once suit motions without them."
)

Runs = Mapping[Curve, Mapping[float, Record]]  # by engine and family, by difficulty


def render(records: Sequence[Record]) -> list[Block]:
    """Advice, counts of false successes, and a heat map for each ladder."""
    found = _runs(records)
    shown = [ladder for ladder in ladders() if ladder.name in found]
    maps = [_figure(ladder, found[ladder.name]) for ladder in shown]
    return [Heading("Stability", 2), Text(WHEN), Text(HOW), _counts(shown, found), *maps]


def _runs(records: Iterable[Record]) -> dict[str, Runs]:
    """The runs of each ladder, mbref's methods first."""
    order = {method: k for k, method in enumerate(METHODS)}
    found: dict[str, dict[Curve, dict[float, Record]]] = {}
    for record in sorted(records, key=lambda r: (r["engine"] != MBREF, order.get(r["family"], 0))):
        ladder, difficulty = place(record["scene"])
        curve = record["engine"], record["family"]
        found.setdefault(ladder, {}).setdefault(curve, {})[difficulty] = record
    return dict(found)


def is_false(record: Record) -> bool:
    """Whether a run completed with an error above ALLOWED, or FALSE_SUCCESS where it has no tolerance."""
    has_tolerance = record["engine"] == MBREF and record["family"] not in FIXED_STEPS
    allowed = ALLOWED if has_tolerance else FALSE_SUCCESS
    return is_completed(record) and not error(record) <= allowed


def _counts(shown: Sequence[Ladder], found: Mapping[str, Runs]) -> Table:
    """Right, honestly ended and falsely completed runs of every method over all ladders."""
    curves = dict.fromkeys(curve for runs in found.values() for curve in runs)
    rows = []
    for curve in curves:
        records = [r for ladder in shown for r in found[ladder.name].get(curve, {}).values()]
        false = sum(map(is_false, records))
        right = sum(map(is_completed, records)) - false
        rows.append((*curve, str(right), str(len(records) - right - false), str(false)))
    caption = (
        "Runs of all ladders: completed and right, ended early, and completed but wrong (false successes)."
    )
    return Table(caption, ("Engine", "Method", "Right", "Ended", "False"), rows, right=frozenset({2, 3, 4}))


def _figure(ladder: Ladder, runs: Runs) -> Figure:
    draw = partial(plot, ladder.label, [d for d, _ in ladder.rungs], runs)
    return Figure(
        f"stability-{ladder.name}", f"{ladder.name.replace('_', ' ').capitalize()}. {ladder.words}", draw
    )


def plot(label: str, difficulties: Sequence[float], runs: Runs) -> Drawing:
    """One row a method, one column a rung, the digits kept in the cells."""
    drawing, [axes] = figures.canvas(7.4, 0.6 + 0.27 * len(runs))
    digits = np.array([[_digits(row.get(d)) for d in difficulties] for row in runs.values()])
    colours = matplotlib.colormaps["Blues"].with_extremes(bad="#eeeeee")
    axes.imshow(np.ma.masked_invalid(digits), cmap=colours, vmin=0, vmax=20, aspect="auto")
    for i, row in enumerate(runs.values()):
        for j, difficulty in enumerate(difficulties):
            _write(axes, i, j, row.get(difficulty))
    axes.set_xticks(range(len(difficulties)), [rung(d) for d in difficulties])
    axes.set_yticks(range(len(runs)), [_name(curve) for curve in runs])
    axes.set_xlabel(label)
    axes.grid(visible=False)
    axes.tick_params(length=0)
    return drawing


def rung(difficulty: float) -> str:
    """A difficulty below its column: 0.3, 1.5, 3e-5, 1e12."""
    return re.sub(r"e([+-])0?", lambda sign: "e" + sign[1].strip("+"), f"{difficulty:g}")


def _write(axes: figures.Axes, i: int, j: int, record: Record | None) -> None:
    if record is None:
        return
    if is_false(record):
        axes.fill_between([j - 0.5, j + 0.5], i - 0.5, i + 0.5, color="#c62828", linewidth=0)
    text = f"{_shown(record):.0f}" if is_completed(record) else _letter(record["outcome"])
    colour = "white" if is_false(record) or _digits(record) > DARK else "black"
    axes.text(j, i, text, ha="center", va="center", color=colour, fontsize=8)


def _name(curve: Curve) -> str:
    engine, family = curve
    return family if engine == MBREF else f"{engine} {family}"


def _letter(outcome: str) -> str:
    return Outcome[outcome].letter or LETTERS[outcome]


def _shown(record: Record) -> float:
    """Digits kept, 0 where none."""
    value = error(record)
    return 0.0 if not value < 1.0 else min(MOST_DIGITS, -math.log10(max(value, 10**-MOST_DIGITS)))


def _digits(record: Record | None) -> float:
    """Digits of a completed run that is right, else not a number."""
    return math.nan if record is None or not is_completed(record) or is_false(record) else _shown(record)
