"""`crosscheck closed-loops`: measure engines on closed loops, and show the table of engines and
mechanisms."""

from __future__ import annotations

import argparse
from pathlib import Path

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table
from rich.text import Text

from crosscheck.cli import request
from crosscheck.cli.rendering import write_page
from crosscheck.cli.running import COMPLETED, console, notice
from crosscheck.closed_loops import records
from crosscheck.closed_loops.matrix import LEGEND, Cell, is_run, matrix, shown
from crosscheck.study.progress import shown as progress_of
from crosscheck.study.store import read_runs

LOOKS = {"✓": "green", "≈": "yellow", "✗": "bold red", "!": "magenta"}


def closed_loops(arguments: argparse.Namespace) -> int:
    """Measure engines and write the page if requested, and print the table of engines and mechanisms."""
    path = Path(arguments.records)
    if arguments.run:
        _measure(arguments, path)
    found = read_runs(path)
    if status := write_page("closed-loops", path, arguments.page):
        return status
    for is_best in (True, False):
        console().print(_table(matrix(found), is_best))
    _legend(console())
    return COMPLETED


def _measure(arguments: argparse.Namespace, path: Path) -> None:
    engines = request.find_engines(arguments.engine or ["all"], notice)
    wanted, unable = records.cases(engines, arguments.family, path)
    with progress_of("measuring", len(wanted)) as progress:
        records.measure(wanted, unable, path, progress)


def _table(cells: dict[str, dict[str, Cell]], is_best: bool) -> Table:
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
