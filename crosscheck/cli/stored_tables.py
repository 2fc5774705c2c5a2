"""Commands that measure engines and print stored records: closed loops, convergence, invariants,
alternatives, small motions."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table
from rich.text import Text

from crosscheck.alternatives import records as agreeing
from crosscheck.alternatives import table as of_alternatives
from crosscheck.cli import request
from crosscheck.cli.rendering import write_page
from crosscheck.cli.running import COMPLETED, OTHERWISE, console, notice, print_json
from crosscheck.cli.scene_request import find_scenes
from crosscheck.closed_loops import records as closed
from crosscheck.closed_loops.matrix import LEGEND, Cell, is_run, matrix, shown
from crosscheck.convergence import every_scene, ladders, orders
from crosscheck.engine import all_engines
from crosscheck.invariants import laws
from crosscheck.invariants import records as kept
from crosscheck.small_motions import records as poses
from crosscheck.small_motions import sentences
from crosscheck.study.grid import Record
from crosscheck.study.progress import shown as progress_of
from crosscheck.study.store import read_runs
from mbref.records import rewrite

LOOKS = {"✓": "green", "≈": "yellow", "✗": "bold red", "!": "magenta"}
# engines whose accelerations at a pose are asked for, if they are installed
ENGINES = ("mujoco", "pinocchio", "exudyn", "simbody", "dart", "drake")


def closed_loops(arguments: argparse.Namespace) -> int:
    """Measure engines and write the page if requested, and print the table of engines and mechanisms."""

    def measure(engines: list[str], path: Path) -> None:
        wanted, unable = closed.cases(engines, arguments.family, path)
        with progress_of("measuring", len(wanted)) as progress:
            closed.measure(wanted, unable, path, progress)

    if status := measured(arguments, "closed-loops", measure):
        return status
    found = some(read_runs, arguments.records)
    cells = matrix(found)
    for is_best in (True, False):
        console().print(_errors(cells, is_best))
    _name_left_out(found, [r for row in cells.values() for cell in row.values() for r in cell.records])
    _legend(console())
    return COMPLETED


def measured(arguments: argparse.Namespace, page: str, measure: Callable[[list[str], Path], None]) -> int:
    """Measure engines and write a page if requested; return the exit status.

    Raises RequestError for an engine that no run measures.
    """
    _check_engine(arguments)
    path = Path(arguments.records)
    if arguments.run:
        if not path.parent.is_dir():
            raise request.RequestError(f"--records: there is no folder {path.parent}")
        measure(request.find_engines(arguments.engine or ["all"], notice), path)
    return write_page(page, path, arguments.page)


def some(read: Callable[[Path], list[Record]], file: str) -> list[Record]:
    """Return the records of a file; raises RequestError if there are none."""
    path = Path(file)
    if not (found := read(path)):
        raise request.RequestError(f"{path}: has no records; --run measures engines and writes them")
    return found


def _errors(cells: dict[str, dict[str, Cell]], is_best: bool) -> Table:
    title = "at its best settings" if is_best else "by the library's defaults"
    headings = next(iter(cells.values()), {})
    table = Table("engine", *headings, title=title, box=SIMPLE)
    for name, row in cells.items():
        found = [cell.best() if is_best else cell.defaults() for cell in row.values()]
        if is_best or any(map(is_run, found)):
            texts = [shown(record) for record in found]
            table.add_row(name, *(Text(text, LOOKS.get(text[:1], "dim")) for text in texts))
    return table


def _legend(out: Console) -> None:
    for sign, meaning in LEGEND.items():
        out.print(f"{sign:10} {meaning}", soft_wrap=True)


def convergence(arguments: argparse.Namespace) -> int:
    """Measure engines and write the page if requested, and print the table of errors and orders."""

    def measure(engines: list[str], path: Path) -> None:
        if arguments.every_scene:
            ladders.measure(engines, every_scene.FILE, notice, every_scene.ROWS, every_scene.mechanisms())
        else:
            ladders.measure(engines, path, notice)

    if status := measured(arguments, "convergence", measure):
        return status
    if arguments.every_scene:
        console().print(_of_scenes())
        return COMPLETED
    runs = some(read_runs, arguments.records)
    rows = orders.table(runs)
    console().print(_orders(rows))
    _name_left_out(runs, [r for row in rows.values() for cell in row.values() for r in cell])
    return COMPLETED


def _orders(rows: orders.Table) -> Table:
    headings = [mechanism.heading for mechanism in ladders.MECHANISMS]
    table = Table("engine, family", *headings, title="least errors, and orders in parentheses", box=SIMPLE)
    for row, found in rows.items():
        table.add_row(row.name, *map(orders.cell, found.values()))
    return table


def _of_scenes() -> Table:
    found = every_scene.table(read_runs(every_scene.FILE))
    headings = [row.name for row in every_scene.ROWS]
    table = Table("scene", *headings, title="least errors, orders, CPU time", box=SIMPLE)
    for name, rows in found.items():
        table.add_row(name, *map(every_scene.cell, rows.values()))
    return table


def _check_engine(arguments: argparse.Namespace) -> None:
    """Raise RequestError for an engine that no run measures."""
    if arguments.engine and not arguments.run:
        raise request.RequestError(
            "--engine: names an engine that --run measures; without --run all stored runs are shown"
        )


def _name_left_out(records: Sequence[Record], shown: Sequence[Record]) -> None:
    """Print which records belong to no row and column of a table."""
    keys = {record["key"] for record in shown}
    if left := [record["key"] for record in records if record["key"] not in keys]:
        more = f" and {len(left) - 1} more" * (len(left) > 1)
        notice(f"no row and column of the table has record {left[0][:40]!r}{more}")


def invariants(arguments: argparse.Namespace) -> int:
    """Measure engines and write the page if requested, and print the tables of invariants and laws."""
    if status := measured(arguments, "invariants", partial(kept.measure, report=notice)):
        return status
    runs = some(kept.read, arguments.records)
    known = {column.experiment for column in (*laws.COLUMNS, *laws.OF_SOLVERS)}
    _name_left_out(runs, [record for record in runs if record["experiment"] in known])
    for title, found in laws.tables(runs).items():
        columns = laws.columns_of(title)
        table = Table("row", *(column.heading for column in columns), title=title, box=SIMPLE)
        for name, row in found.items():
            table.add_row(name, *(laws.cell(row, column) for column in columns))
        console().print(table)
    return COMPLETED


def alternatives(arguments: argparse.Namespace) -> int:
    """Measure engines and write the page if requested, and print a line for each engine and for each
    cause of differences above a limit."""
    measure = partial(agreeing.measure, graphs=arguments.mechanisms, report=notice)
    if status := measured(arguments, "alternatives", measure):
        return status
    found = of_alternatives.engines(some(agreeing.read, arguments.records))
    table = Table(*of_alternatives.HEADER, title="ways to solve the same equations", box=SIMPLE)
    for records in found.values():
        table.add_row(*of_alternatives.line(records))
    console().print(table)
    for cause, pairs in of_alternatives.above(found):
        worst = max(pair.found[0] for pair in pairs)
        said = f"{cause.engine}, {cause.way}: up to {worst.size:.0e} on {worst.scene}: {cause.because}"
        console().print(said, soft_wrap=True)
    return COMPLETED


def modes(arguments: argparse.Namespace) -> int:
    """Measure a scene, or show the stored records of mechanisms with closed forms."""
    engines = _engines(arguments.engine)
    if arguments.scene:
        (scene,) = find_scenes([arguments.scene], notice=notice)
        found = poses.measured(scene, engines, starts=arguments.starts, progress=notice)
    else:
        _check_engine(arguments)
        if arguments.run:
            rewrite(poses.FILE, poses.merged(poses.of_mechanisms(engines, notice), poses.read()))
        found = poses.read()
    with TemporaryDirectory() as place:
        path = Path(place) / "records.jsonl"
        rewrite(path, found)
        if status := write_page("small-motions", path, arguments.page):
            return status
    if arguments.json:
        print_json([{"poses": found}])
    else:
        _show(console(), found)
    return COMPLETED if found else OTHERWISE


def _engines(named: Sequence[str] | None) -> list[str]:
    if named:
        return request.find_engines(named, notice)
    here = all_engines()
    return [name for name in ENGINES if name in here]


def _show(out: Console, found: Sequence[Record]) -> None:
    if not found:
        out.print("The judge's search finds no equilibrium and no steady motion; --starts tries more.")
    for record in found:
        listed = ", ".join(sentences.written(*s) for s in record["eigenvalues"])
        out.print(f"{record['scene']}: {sentences.heading(record)}", soft_wrap=True)
        out.print(f"  s = {listed} 1/s", soft_wrap=True)
        out.print(f"  {sentences.search(record)}".replace("`", ""), soft_wrap=True)
        table = Table("method", "error of the eigenvalues", box=SIMPLE)
        for name, value in sentences.rows(record):
            table.add_row(name, value)
        out.print(table)
