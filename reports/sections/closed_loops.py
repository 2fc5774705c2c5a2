"""Section: engines on mechanisms with closed loops, each hard in one way, from crosscheck's own records."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from crosscheck.closed_loops.matrix import LEGEND, Cell, is_refusal, is_run, matrix, rerun, sentence, shown
from crosscheck.closed_loops.mechanisms import DIFFICULTIES
from crosscheck.study.grades import Grade, grade
from crosscheck.study.grid import Record
from crosscheck.study.record_view import error

from ..blocks import Block, Heading, HeatMap, Listing, Table, Text
from ..blocks import Cell as Shown

KINDS = {Grade.RIGHT: "kept", Grade.INACCURATE: "kept", Grade.WRONG: "false", Grade.FAILED: "ended"}
MOST_DIGITS = 14  # digits of a cell of the deepest colour
ABOUT = (
    "Each row is an engine, each column a mechanism with closed loops that is hard in one way. A cell is "
    "the largest error of any body at any sample, as a fraction of the mechanism's length or in rad. A cell "
    "leads to its settings and its command."
)
BEST = (
    "Each engine by its best family of settings, at the finest setting of each family. In rows with terms "
    "the engine gives mass matrix, bias forces and Jacobians, and crosscheck closes the loops and integrates."
)
Cells = Mapping[str, Mapping[str, Cell]]


def render(records: Sequence[Record]) -> list[Block]:
    """Return the tables at the best settings and at the defaults, the mechanisms, and the runs of each
    cell."""
    cells = matrix(records)
    return [
        Heading("Engines on closed loops", 2),
        Text(ABOUT),
        _map(
            cells, True, "Each engine by its best family of settings, at the finest setting of each family."
        ),
        _map(cells, False, "Solver parameters as the library has them, with a fine step."),
        Table("How to read a cell.", ("Sign", "Meaning"), list(LEGEND.items())),
        Heading("The mechanisms", 2),
        Table("Scenes that the columns run.", ("Column", "Scene", "Until (s)", "Mechanism"), _mechanisms()),
        *(block for name, row in cells.items() for block in _engine(name, row)),
    ]


def _map(cells: Cells, is_best: bool, caption: str) -> HeatMap:
    rows = {}
    for name, row in cells.items():
        found = {cell: cell.best() if is_best else cell.defaults() for cell in row.values()}
        if is_best or any(map(is_run, found.values())):
            rows[name] = [_shown(*pair) for pair in found.items()]
    return HeatMap(caption, "engine", [column.heading for column in DIFFICULTIES], rows)


def _shown(cell: Cell, record: Record | None) -> Shown:
    if record is None:
        return Shown(shown(None), "")
    if is_refusal(record):
        return Shown(shown(record), "", href=_place(cell))
    digits = -math.log10(max(error(record), 10.0**-MOST_DIGITS)) if grade(record) is not Grade.FAILED else 0.0
    depth = max(0.0, digits / MOST_DIGITS)
    return Shown(shown(record), KINDS.get(grade(record), ""), depth, _place(cell))


def _place(cell: Cell) -> str:
    """Return the place of the row's heading in the page."""
    return f"#{cell.row.replace(', ', '-')}"


def _mechanisms() -> list[tuple[str, ...]]:
    return [(c.heading, c.place(), f"{c.end:g}", c.about) for c in DIFFICULTIES]


def _engine(name: str, row: Mapping[str, Cell]) -> Iterator[Block]:
    yield Heading(name, 2)
    version = next(record["version"] for cell in row.values() for record in cell.records)
    rows = [(cell.column.heading, *line) for cell in row.values() for line in _runs(cell)]
    yield Table(f"Version {version}.", ("Mechanism", "Result", "Run"), rows)
    commands = [rerun(best) for cell in row.values() if (best := cell.best()) and not is_refusal(best)]
    if commands:
        yield Text("Commands of the best runs, from the root of the checkout:")
        yield Listing("\n".join(commands))


def _runs(cell: Cell) -> list[tuple[str, str]]:
    best = cell.best()
    if best is None:
        return []
    found = [best] if is_refusal(best) else list(cell.families().values())
    return [(shown(record), sentence(record)) for record in found]
