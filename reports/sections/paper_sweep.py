"""Section: influence of the settings on the paper's failure times. The set of possible times is reproducible,
but not each time."""

from __future__ import annotations

from collections import Counter
from functools import partial

from matplotlib.figure import Figure as Drawing

from crosscheck.paper import singular
from crosscheck.paper.cells import CELLS, FIVE_BAR, FOUR_BAR_COLUMNS, Cell, Match, match
from crosscheck.paper.runs import SHORT, SIZED_ROWS, Label, Records, found
from crosscheck.paper.settings import BASE, DRAWN, FEW, LINKAGES, SIZE, SIZES, SWEEP

from .. import figures
from ..blocks import Block, Figure, Heading, Table, Text
from ..runs import Run

COLUMNS = (*FOUR_BAR_COLUMNS, FIVE_BAR)
LAST = 0.15  # s, length of the time axis
SWEPT = tuple(cell for cell in CELLS if cell.table != "III" and cell.letter not in ("a", ""))


def render(records: Records) -> list[Block]:
    """Return the number of matching cells for every variant, the end times of every cell, and their
    distribution."""
    return [
        Heading("Influence of the settings"),
        Text(
            "An unstabilised run is off the true branch by no more than its tolerance until the Jacobian "
            "loses rank; near that position its accelerations are errors divided by a small singular value. "
            "The crossing at which a run leaves the branch depends on the size of those errors and on the "
            "instants of its steps. The mechanism determines the set of times, chance the choice within "
            "it: here one "
            "setting at a time is varied, and the draw of first step and data errors."
        ),
        _scores(records),
        _sizes(records),
        _times(records, "settings", (BASE.name, *(v.name for v in SWEEP))),
        _times(records, "draws of first step and data errors", ("seed 0", *(v.name for v in DRAWN))),
        Figure("paper-failure-times", _caption(), partial(plot, records)),
    ]


def _variants(records: Records, cell: Cell) -> dict[str, Run]:
    """Return the cell's runs by variant; runs of the tables have the key ``BASE.name``."""
    return {name: Run(r) for name, r in found(records, cell, ("tables", "sweep", "drawn")).items()}


def _scores(records: Records) -> Table:
    runs = {cell: _variants(records, cell) for cell in SWEPT}
    rows = []
    for variant in (BASE, *SWEEP):
        there = [(cell, run) for cell in SWEPT if (run := runs[cell].get(variant.name))]
        marks = Counter(match(cell, run.outcome, run.t_end) for cell, run in there)
        rows.append((variant.name, *(str(marks[mark]) for mark in Match), str(len(there))))
    header = ("Varied", "Outcome and time", "Outcome only", "Another outcome", "Cells")
    caption = (
        "How many of the cells that fail at singular positions in the paper (Tables I and II) match; a "
        "penalty or a tolerance of ALF is varied in its own cells."
    )
    return Table(caption, header, rows, right=frozenset({1, 2, 3, 4}))


def _sizes(records: Records) -> Table:
    rows = []
    for size in SIZES:
        for row in SIZED_ROWS:
            labels = [
                [Label("sized", row, column, f"{size:g} m, seed {k}") for k in range(FEW)]
                for column in COLUMNS
            ]
            runs = [[Run(records[label]) for label in column if label in records] for column in labels]
            rows.append((f"{size:g}", row, *map(_most, runs)))
    caption = (
        f"The most frequent end (s, letter) among {FEW} draws with data errors of each size; – is "
        f"{SHORT[-1]:g} s reached. MPI without partitioning goes through the first crossing and ends at the "
        f"first bifurcation, as in the paper, in most draws with errors of 1e-12 m and {SIZE:g} m; from 1e-9 "
        "m on it ends at the first crossing, where ALF ends whatever their size. Hence "
        f"{SIZE:g} m: the largest with which both are as in the paper."
    )
    return Table(caption, ("Errors, m", "Method", *COLUMNS), rows)


def _most(runs: list[Run]) -> str:
    if not runs:
        return "–"
    [(most, count)] = Counter(
        "–" if run.completed else f"{run.t_end:.3f} {run.outcome.letter}" for run in runs
    ).most_common(1)
    return f"{most} ({count} of {len(runs)})"


def _times(records: Records, what: str, names: tuple[str, ...]) -> Table:
    rows = []
    for cell in SWEPT:
        runs = _variants(records, cell)
        runs["seed 0"] = runs[BASE.name]
        rows.append((cell.column, cell.row, str(cell), *(_text(runs.get(name)) for name in names)))
    header = ("Column", "Method", "Paper", *names)
    return Table(f"End time (s) and letter of every cell over {what}.", header, rows, folded=True)


def _text(run: Run | None) -> str:
    if run is None:
        return "–"
    return "20" if run.completed else f"{run.t_end:.4f} {run.outcome.letter or run.outcome.label}"


def _caption() -> str:
    return (
        "End times over settings and draws, all methods without partitioning; a bar's height is the number "
        "of runs. Dashed: θ₂ an odd multiple of π, where both branches admit a turning "
        "crank; dotted: an even one, where the fold does not. Triangles: the paper's end times."
    )


def plot(records: Records) -> Drawing:
    """Return histograms of end times, one panel for each column of the tables."""
    drawing, panels = figures.canvas(7.4, 7.0, len(COLUMNS))
    for axes, column in zip(panels, COLUMNS, strict=True):
        cells = [cell for cell in SWEPT if cell.column == column and "CP" not in cell.row]
        runs = [run for cell in cells for run in _variants(records, cell).values()]
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
