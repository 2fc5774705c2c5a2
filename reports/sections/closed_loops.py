"""Section: engines on mechanisms with closed loops, each hard in one way, from crosscheck's own records."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from crosscheck.closed_loops.matrix import LEGEND, Cell, is_refusal, is_run, matrix, rerun, sentence, shown
from crosscheck.closed_loops.mechanisms import DIFFICULTIES
from crosscheck.closed_loops.records import TIME_LIMIT
from crosscheck.engine import engine_names
from crosscheck.study.grades import Grade, grade
from crosscheck.study.grid import Record
from crosscheck.study.record_view import error

from ..blocks import Block, Fold, Heading, HeatMap, Listing, Table, Text, Within
from ..blocks import Cell as Shown

KINDS = {Grade.RIGHT: "kept", Grade.INACCURATE: "kept", Grade.WRONG: "false", Grade.FAILED: "ended"}
MOST_DIGITS = 14  # digits of a cell of the deepest colour
ABOUT = (
    "Each row is an engine, each column a mechanism with closed loops that is hard in one way. A cell is "
    "the largest error of any body at any sample, as a fraction of the mechanism's length or in rad. The "
    "name of an engine leads to its settings, reasons and commands."
)
BEST = (
    "Each engine by its best family of settings, at the finest setting of each family that was measured "
    f"within {TIME_LIMIT:g} s of CPU time. In rows with terms the engine gives mass matrix, bias forces and "
    "Jacobians, and crosscheck closes the loops and integrates. A coarser setting than the finest one can "
    "be more accurate on redundant loops and near singular positions; "
    "`crosscheck tune ENGINE SCENE --error 1e-6` finds it."
)
FAMILIES = "Rows are families of settings."
RUNS = "The best run of each family of settings, or the reason of a refusal."
COMMANDS = "Commands of the best runs, from the root of the checkout:"
DEFAULTS = "Solver parameters as the library has them, with a fine step."
SEVERAL = {  # engines whose families of settings are solvers of their own: the summary, and a remark
    "newton": (
        "Newton's solvers, each by its best run",
        "On Bennett's linkage over 1 s a finer step does not help `lox`: a fifth of its steps do not "
        "converge, and it magnifies roundings of single precision a thousandfold (finding "
        "`newton-lox-finer-steps`).",
    )
}
Cells = Mapping[str, Mapping[str, Cell]]


def render(records: Sequence[Record]) -> list[Block]:
    """Return a heading, the tables at the best settings and at the defaults, and the folded runs."""
    return [Heading("Engines on closed loops", 2), Text(ABOUT), *overview(records), *runs(records)]


def overview(records: Sequence[Record]) -> list[Block]:
    """Return the legend and the tables of engines and mechanisms."""
    cells = matrix(records)
    missing = [name for name in engine_names() if name not in cells]
    several = (_by_family(name, cells[name], *said) for name, said in SEVERAL.items() if name in cells)
    return [
        Table("How to read a cell.", ("Sign", "Meaning"), list(LEGEND.items())),
        _map(cells, BEST, Cell.best),
        *([Text(f"Engines that were not measured: {', '.join(missing)}.")] if missing else []),
        _map(cells, DEFAULTS, Cell.defaults, only_runs=True),
        *several,
    ]


def runs(records: Sequence[Record]) -> list[Block]:
    """Return the mechanisms, and the folded runs and commands of each engine."""
    header = ("Column", "Scene", "Until (s)", "Mechanism")
    rows = [(c.heading, c.place(), f"{c.end:g}", c.about) for c in DIFFICULTIES]
    folded = [_engine(name, row) for name, row in matrix(records).items()]
    return [
        Heading("The mechanisms", 2),
        Table("Scenes that the columns run.", header, rows),
        Heading("The runs", 2),
        *folded,
    ]


def _map(
    cells: Cells, caption: str, chosen: Callable[[Cell], Record | None], only_runs: bool = False
) -> HeatMap:
    """Return the chosen record of each cell; with ``only_runs`` without engines that have no chosen run."""
    found = {name: [(cell, chosen(cell)) for cell in row.values()] for name, row in cells.items()}
    rows: dict[str, list[Shown]] = {
        Within(name, f"#{_place(name)}"): [_shown(*pair) for pair in row]
        for name, row in found.items()
        if not only_runs or any(is_run(record) for _, record in row)
    }
    return HeatMap(caption, "engine", [column.heading for column in DIFFICULTIES], rows)


def _by_family(name: str, row: Mapping[str, Cell], summary: str, remark: str) -> Fold:
    """Return the folded table of an engine's families of settings, each by its best run."""
    rows = {
        family: [_shown(cell, _of(cell, family)) for cell in row.values()]
        for family in dict.fromkeys(name for cell in row.values() for name in cell.families())
    }
    found = HeatMap(FAMILIES, "family", [column.heading for column in DIFFICULTIES], rows)
    return Fold(summary, f"{_place(name)}-solvers", [found, Text(remark)])


def _of(cell: Cell, family: str) -> Record | None:
    best = cell.best()
    return best if best and is_refusal(best) else cell.families().get(family)


def _shown(cell: Cell, record: Record | None) -> Shown:
    if record is None:
        return Shown(shown(None), "")
    href = f"#{_place(cell.row)}"
    if is_refusal(record):
        return Shown(shown(record), "", href=href)
    digits = -math.log10(max(error(record), 10.0**-MOST_DIGITS)) if grade(record) is not Grade.FAILED else 0.0
    return Shown(shown(record), KINDS.get(grade(record), ""), max(0.0, digits / MOST_DIGITS), href)


def _place(name: str) -> str:
    """Return the place of an engine's runs in the page."""
    return name.replace(", ", "-")


def _engine(name: str, row: Mapping[str, Cell]) -> Fold:
    version = next(record["version"] for cell in row.values() for record in cell.records)
    rows = [(cell.column.heading, *line) for cell in row.values() for line in _runs(cell)]
    commands = [rerun(best) for cell in row.values() if (best := cell.best()) and not is_refusal(best)]
    told: list[Block] = [Table(RUNS, ("Mechanism", "Result", "Run"), rows)]
    if commands:
        told += [Text(COMMANDS), Listing("\n".join(commands))]
    return Fold(f"{name} {version}", _place(name), told)


def _runs(cell: Cell) -> list[tuple[str, str]]:
    best = cell.best()
    if best is None:
        return []
    found = [best] if is_refusal(best) else list(cell.families().values())
    return [(shown(record), sentence(record)) for record in found]
