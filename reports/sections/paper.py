"""The paper's Tables I to IV beside ours, cell by cell, and why the cells that differ do."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

from crosscheck.paper import settings, singular
from crosscheck.paper.cells import CELLS, CLOSE, COUNTS_III, COUNTS_IV, Cell, Counts, Match, match
from crosscheck.paper.runs import SPATIAL_DYNAMIC, Label, Records, ends
from crosscheck.paper.settings import LINKAGES
from reports.blocks import Block, Heading, Table, Text
from reports.runs import Run, power, ratio
from reports.sections import paper_figures, paper_methods, paper_sweep

TITLES = {
    "I": "Table I: the four-bar linkage",
    "II": "Table II: the five-bar linkage",
    "III": "Table III: the driven spatial slider-crank",
}
NEAR = 0.1  # rad from a multiple of π: a run that ends so near ended at that crossing


def render(records: Records) -> list[Block]:
    """The chapter."""
    return [
        Heading("The paper's tables and figures", 2),
        Text(score(records)),
        Text(
            f"In every cell: the paper's outcome; ours, with the footnote's letter (a singular matrix, b no "
            f"convergence, c violation, d integration failed); the error against truth, of a failed run at "
            f"{paper_sweep.SHARE_TEXT} of its end time. Marks: {Match.SAME.value} same outcome, end within "
            f"{CLOSE:g} s; {Match.OTHER_TIME.value} same outcome at another time; {Match.DIFFERENT.value} "
            "another outcome. A match of outcomes says nothing about correctness: the error does."
        ),
        _settings(),
        *(block for name in TITLES for block in _table(name, records)),
        *_counts(records),
        *_differences(records),
        *paper_sweep.render(records),
        *paper_methods.explained(),
        *paper_figures.render(records),
        *paper_methods.render(records),
    ]


def score(records: Records) -> str:
    """One sentence with the number of matching cells."""
    marks = Counter(_match(cell, records) for cell in CELLS)
    found = sum(_in_sweep(cell, records) for cell in CELLS)
    return (
        f"Of {len(CELLS)} cells of Tables I to III, {marks[Match.SAME]} have the paper's outcome and end "
        f"time, {marks[Match.OTHER_TIME]} its outcome at another time, {marks[Match.DIFFERENT]} another "
        f"outcome; with one setting varied at a time {found} have its outcome and end time in some run."
    )


def _run(cell: Cell, records: Records) -> Run:
    return Run(records[Label(cell.table, cell.row, cell.column)])


def _match(cell: Cell, records: Records) -> Match:
    run = _run(cell, records)
    return match(cell, run.outcome, run.t_end)


def _in_sweep(cell: Cell, records: Records) -> bool:
    """Whether the cell matches at the settings or anywhere in the sweep."""
    if _match(cell, records) is Match.SAME:
        return True
    return any(
        letter == cell.letter and cell.end is not None and abs(end - cell.end) <= CLOSE
        for end, letter in ends(records, cell.row, cell.column)
    )


def _settings() -> Table:
    rows = list(settings.REASONS.items())
    return Table(
        "The settings of all runs, none chosen for a cell.", ("Setting", "Meaning"), rows, folded=True
    )


def _table(name: str, records: Records) -> list[Block]:
    cells = [cell for cell in CELLS if cell.table == name]
    columns = list(dict.fromkeys(cell.column for cell in cells))
    header = ["Method", *(f"{word} {c}" for c in columns for word in ("Paper,", "Ours,", "Error,"))]
    rows = [
        [row, *(part for cell in cells if cell.row == row for part in _parts(cell, records))]
        for row in dict.fromkeys(cell.row for cell in cells)
    ]
    same = sum(_match(cell, records) is Match.SAME for cell in cells)
    caption = f"{same} of {len(cells)} cells have the paper's outcome and end time."
    right = frozenset(range(3, len(header), 3))
    return [Heading(TITLES[name]), Table(caption, header, rows, right=right)]


def _parts(cell: Cell, records: Records) -> tuple[str, str, str]:
    run = _run(cell, records)
    return str(cell), f"{_match(cell, records).value} {ended(run)}", _error(cell, records)


def ended(run: Run) -> str:
    """End time and letter; the outcome's name where the paper has no letter for it."""
    if run.completed:
        return "20 s"
    return f"{run.t_end:.4g} s {run.outcome.letter or run.outcome.label}"


def _error(cell: Cell, records: Records) -> str:
    run = _run(cell, records)
    again = records.get(Label("error", cell.row, cell.column))
    return power(run.error if run.completed or again is None else Run(again).error)


def _counts(records: Records) -> list[Block]:
    iii = _count_rows("III", settings_column := CELLS[-1].column, COUNTS_III, records)
    iv = _count_rows("dynamic", SPATIAL_DYNAMIC, COUNTS_IV, records)
    header = ("Method", "Paper: steps/s", "Ours: steps/s", "Paper: steps, ratio", "Ours: steps, ratio",
              "Paper: time, ratio", "Ours: time, ratio", "Ours ended", "Error")  # fmt: skip
    about = "Per second of simulation; ratios to the first row. "
    right = frozenset({1, 2, 3, 4, 5, 6, 8})
    return [
        Heading("Table III: steps and cost"),
        Table(f"{about}The scene: {settings_column}.", header, iii, right=right),
        Heading("Table IV: dynamic analysis of the spatial slider-crank"),
        Table(
            f"{about}The paper gives no inertias; ours has the flywheel that puts the first singular "
            "position of the planar mechanism at the paper's 1.81 s, so that the crank turns slower than the "
            "paper's step counts suggest. Its steps are bounded by the largest step and by samples "
            "every 0.05 s, which leaves little for partitioning to lengthen.",
            header, iv, right=right,
        ),
    ]  # fmt: skip


def _count_rows(part: str, column: str, paper: Counts, records: Records) -> list[Sequence[str]]:
    rows = []
    first_steps, first_time = next(iter(paper.values()))
    first = Run(records[Label(part, next(iter(paper)), column)])
    for row, (steps, time) in paper.items():
        run = Run(records[Label(part, row, column)])
        mine = (_rate(run, "steps"), _rate(run, "seconds"))
        rows.append((
            row, f"{steps}", f"{mine[0]:.0f}", f"{steps / first_steps:.3f}",
            f"{mine[0] / _rate(first, 'steps'):.3f}", ratio(time / first_time),
            ratio(mine[1] / _rate(first, "seconds")), ended(run), power(run.error),
        ))  # fmt: skip
    return rows


def _rate(run: Run, count: str) -> float:
    return run.record["cost"][count] / run.t_end if run.t_end > 0 else math.nan


def _differences(records: Records) -> list[Block]:
    rows = [
        (cell.table, cell.column, cell.row, str(cell), ended(_run(cell, records)), _reason(cell, records))
        for cell in CELLS
        if _match(cell, records) is not Match.SAME
    ]
    header = ("Table", "Column", "Method", "Paper", "Ours", "Measured")
    return [Heading("Cells that differ"), Table("Every cell without the mark =.", header, rows)]


def _reason(cell: Cell, records: Records) -> str:
    run = _run(cell, records)
    if cell.table == "III":
        if run.completed:
            violation = power(run.metric("violation_position"))
            return f"the violation stays at {violation}, below the tolerance"
        return f"drift: {run.reason}; roundoff of the method sets when"
    parts = [_where(cell.column, run)]
    found = ends(records, cell.row, cell.column)
    if len(found) > 1:
        inside = "among them" if _in_sweep(cell, records) else "not among them"
        times = ", ".join(f"{t:.4g}{letter}" for t, letter in found)
        parts.append(f"in the sweep it ends at {times} s, the paper's {inside}")
    return "; ".join(parts)


def _where(column: str, run: Run) -> str:
    """Which singular position a linkage's run ended at."""
    if run.completed:
        return f"passes every crossing, violation {power(run.metric('violation_position'))}"
    theta0 = LINKAGES[column][1]
    t, k = min(singular.crossings(theta0, 25.0), key=lambda crossing: abs(crossing[0] - run.t_end))
    near = abs(t - run.t_end) * singular.CRANK_RATE
    if near > NEAR:
        return f"ends {near:.2g} rad from the crossing θ₂ = {_turns(k)}, off the branch since an earlier one"
    others = [time for time, _ in singular.crossings(theta0, t + 0.06)]
    return f"ends at θ₂ = {_turns(k)} ({others.index(t) + 1} of {', '.join(f'{o:.4f}' for o in others)} s)"


def _turns(k: int) -> str:
    """k π as written."""
    return {0: "0", 1: "π", -1: "-π"}.get(k, f"{k}π")
