"""What the settings matter for the paper's failure times: the set of times, not one, is reproducible."""

from __future__ import annotations

from collections import Counter
from functools import partial

from matplotlib.figure import Figure as Drawing

from crosscheck.paper import singular
from crosscheck.paper.cells import CELLS, FIVE_BAR, FOUR_BAR_COLUMNS, Cell, Match, match
from crosscheck.paper.runs import SHARE, SWEPT_ROWS, Label, Records
from crosscheck.paper.settings import BASE, LINKAGES, SWEEP
from reports import figures
from reports.blocks import Block, Figure, Heading, Table, Text
from reports.runs import Run

SHARE_TEXT = f"{100 * SHARE:g} %"
COLUMNS = (*FOUR_BAR_COLUMNS, FIVE_BAR)
LAST = 0.15  # s, of the figure


def render(records: Records) -> list[Block]:
    """How many cells match at every variant, the end times of every cell, and their distribution."""
    return [
        Heading("What the settings decide"),
        Text(
            "An unstabilised run is off the true branch by no more than its tolerance until the Jacobian "
            "loses rank; near that position its accelerations are errors divided by a small singular value. "
            "Which of the crossings does the damage depends on where steps happen to fall. The set of times "
            "is the mechanism's, the choice within it is chance: one setting at a time is varied here."
        ),
        _scores(records),
        _times(records),
        Figure("paper-failure-times", _caption(), partial(plot, records)),
    ]


def _variants() -> list[str]:
    return [BASE.name, *(variant.name for variant in SWEEP)]


def _found(records: Records, cell: Cell, variant: str) -> Run | None:
    part = cell.table if variant == BASE.name else "sweep"
    record = records.get(Label(part, cell.row, cell.column, variant))
    return None if record is None else Run(record)


def _swept() -> list[Cell]:
    return [cell for cell in CELLS if cell.row in SWEPT_ROWS and cell.column in COLUMNS]


def _scores(records: Records) -> Table:
    rows = []
    for variant in _variants():
        runs = [(cell, run) for cell in _swept() if (run := _found(records, cell, variant))]
        marks = Counter(match(cell, run.outcome, run.t_end) for cell, run in runs)
        rows.append((variant, *(str(marks[mark]) for mark in Match), str(len(runs))))
    header = ("Varied", "Outcome and time", "Outcome only", "Another outcome", "Cells")
    caption = "How many of the cells that end at singular positions in the paper (Tables I and II) match."
    return Table(caption, header, rows, right=frozenset({1, 2, 3, 4}))


def _times(records: Records) -> Table:
    rows = []
    for cell in _swept():
        texts = [_text(_found(records, cell, variant)) for variant in _variants()]
        rows.append((cell.column, cell.row, str(cell), *texts))
    header = ("Column", "Method", "Paper", *_variants())
    return Table("End time (s) and letter of every cell at every variant.", header, rows, folded=True)


def _text(run: Run | None) -> str:
    if run is None:
        return "–"
    return "20" if run.completed else f"{run.t_end:.4f} {run.outcome.letter or run.outcome.label}"


def _caption() -> str:
    return (
        "End times over the sweep, all methods without partitioning; a bar's height is the number of runs. "
        "Dashed: θ₂ an odd multiple of π, where both branches admit a turning crank; dotted: an even one, "
        "where the fold does not. Triangles: the paper's end times."
    )


def plot(records: Records) -> Drawing:
    """Histograms of end times, one panel a column."""
    drawing, panels = figures.canvas(7.4, 7.0, len(COLUMNS))
    for axes, column in zip(panels, COLUMNS, strict=True):
        cells = [cell for cell in _swept() if cell.column == column and "CP" not in cell.row]
        runs = [run for cell in cells for v in _variants() if (run := _found(records, cell, v))]
        times = [run.t_end for run in runs if run.t_end <= LAST]
        axes.hist(times, bins=150, range=(0, LAST), color=figures.COLOURS[0])
        for t, k in singular.crossings(LINKAGES[column][1], LAST):
            axes.axvline(t, color=figures.GREY, linestyle="--" if k % 2 else ":", linewidth=0.9, zorder=0)
        paper = sorted({cell.end for cell in cells if cell.end is not None})
        axes.plot(paper, [0.0] * len(paper), "^", color=figures.COLOURS[1], markersize=7, clip_on=False)
        late = len(runs) - len(times)
        axes.set(ylabel="runs", title=f"{column}: {len(times)} runs end here, {late} later or never")
        axes.title.set_fontsize(9)
    panels[-1].set_xlabel("end time (s)")
    return drawing
