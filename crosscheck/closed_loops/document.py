"""The table of engines and closed-loop mechanisms as a page of the documentation, from stored records."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from crosscheck.closed_loops.matrix import LEGEND, Cell, is_refusal, is_run, matrix, rerun, sentence, shown
from crosscheck.closed_loops.mechanisms import DIFFICULTIES
from crosscheck.closed_loops.records import TIME_LIMIT
from crosscheck.engine import engine_names
from crosscheck.study.grid import Record

HEAD = """# Engines on closed loops

This page helps to choose an engine for a mechanism with closed loops. An engine closes a loop where the last
joint of the loop stays closed and the motion is right. Each row is an engine, each column a mechanism that
is hard in one way. A cell has the largest error of any body at any sample, against a closed form or the
[reference solution](reference.md). Its link leads to the settings, the reason and the command.

```sh
crosscheck closed-loops                        # print the two tables; nothing is simulated
crosscheck closed-loops --run --engine drake   # measure an engine that is installed here
crosscheck closed-loops --force --page docs/closed-loops.md
```
"""
BEST = f"""Each engine by its best family of settings, at the finest setting of each family that was
measured within {TIME_LIMIT:g} s of CPU time. In rows with *terms* the engine gives mass matrix, bias forces
and Jacobians. There crosscheck closes the loops and integrates. A coarser setting than the finest one can be
more accurate on redundant loops and near singular positions; `crosscheck tune ENGINE SCENE --error 1e-6`
finds it:"""
DEFAULTS = "Solver parameters as the library has them, with a fine step:"
# engines whose families of settings are solvers of their own
SEVERAL = {"newton": "Newton's solvers"}
REMARKS = {
    "newton": "On Bennett's linkage over 1 s a finer step does not help `lox`: a fifth of its steps do not "
    "converge, and it magnifies roundings of single precision a thousandfold "
    "([finding](findings.md#newton-lox-finer-steps))."
}
Cells = Mapping[str, Mapping[str, Cell]]


def page(records: Sequence[Record]) -> str:
    """Return the page in Markdown."""
    cells = matrix(records)
    left_out = [name for name in engine_names() if name not in cells]
    missing = [f"Engines that were not measured: {', '.join(left_out)}.", ""] if left_out else []
    parts = [HEAD, *_legend(), BEST, "", *_table(cells, True), *missing, DEFAULTS, "", *_table(cells, False)]
    for name in (name for name in SEVERAL if name in cells):
        parts += [f"{SEVERAL[name]} (families of settings of `{name}`), each by its best run:", ""]
        parts += [*_by_family(cells[name]), REMARKS[name], ""]
    parts += ["## The mechanisms", "", *_mechanisms(), "## The runs", ""]
    parts += [line for name, row in cells.items() for line in _engine(name, row)]
    return "\n".join(parts).rstrip() + "\n"


def _legend() -> Iterator[str]:
    yield "| sign | meaning |"
    yield "| :-- | --- |"
    yield from (f"| {sign} | {meaning} |" for sign, meaning in LEGEND.items())
    yield ""


def _head(first: str) -> Iterator[str]:
    headings = [column.heading for column in DIFFICULTIES]
    yield f"| {first} | " + " | ".join(headings) + " |"
    yield "| --- |" + " :-: |" * len(headings)


def _by_family(row: Mapping[str, Cell]) -> Iterator[str]:
    """Return a table of an engine's families of settings, each by its best run."""
    yield from _head("family")
    for family in dict.fromkeys(name for cell in row.values() for name in cell.families()):
        yield f"| {family} | " + " | ".join(_linked(*_of(cell, family)) for cell in row.values()) + " |"
    yield ""


def _of(cell: Cell, family: str) -> tuple[Cell, Record | None]:
    best = cell.best()
    return cell, best if best and is_refusal(best) else cell.families().get(family)


def _table(cells: Cells, is_best: bool) -> Iterator[str]:
    yield from _head("engine")
    for name, row in cells.items():
        found = {cell: cell.best() if is_best else cell.defaults() for cell in row.values()}
        if is_best or any(map(is_run, found.values())):
            yield f"| {name} | " + " | ".join(_linked(*pair) for pair in found.items()) + " |"
    yield ""


def _linked(cell: Cell, record: Record | None) -> str:
    return f"[{shown(record)}](#{cell.place})" if record else shown(None)


def _mechanisms() -> Iterator[str]:
    for column in DIFFICULTIES:
        yield f"- **{column.heading}** (`{column.place()}`, to {column.end:g} s): {column.about}"
    yield ""


def _engine(name: str, row: Mapping[str, Cell]) -> Iterator[str]:
    """Return the runs of an engine as a table, and the commands of its best runs."""
    version = next(record["version"] for cell in row.values() for record in cell.records)
    yield f"### {name}\n\nVersion {version}.\n"
    yield "| mechanism | result | family of settings, its options, error and time; or the reason |"
    yield "| --- | --- | --- |"
    for cell in row.values():
        yield from _cell(cell)
    commands = [rerun(best) for cell in row.values() if (best := cell.best()) and not is_refusal(best)]
    if commands:
        yield from ("", "Commands that repeat the best runs:", "", "```text", *commands, "```")
    yield ""


def _cell(cell: Cell) -> Iterator[str]:
    """Return one line of the table for each family of settings, the first with the anchor of the cell."""
    best = cell.best()
    found = [] if best is None else [best] if is_refusal(best) else list(cell.families().values())
    for k, record in enumerate(found):
        place = "" if k else f'<a id="{cell.place}"></a>{cell.column.heading}'
        text = sentence(record).replace("|", "\\|").replace("\n", " ")
        yield f"| {place} | {shown(record)} | {text} |"
