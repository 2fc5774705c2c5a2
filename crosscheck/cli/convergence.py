"""`crosscheck convergence`: run engines at halved steps, and show least errors and orders of convergence."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from rich.box import SIMPLE
from rich.table import Table

from crosscheck.cli import request
from crosscheck.cli.rendering import write_page
from crosscheck.cli.running import COMPLETED, console, notice
from crosscheck.convergence import ladders, orders
from crosscheck.study.grid import Record
from crosscheck.study.store import read_runs


def convergence(arguments: argparse.Namespace) -> int:
    """Measure engines and write the page if requested, and print the table of errors and orders."""
    path = Path(arguments.records)
    if arguments.run:
        ladders.measure(request.find_engines(arguments.engine or ["all"], notice), path, notice)
    found = read_runs(path)
    if status := write_page("convergence", path, arguments.page):
        return status
    console().print(_table(found))
    return COMPLETED


def _table(records: Sequence[Record]) -> Table:
    headings = [mechanism.heading for mechanism in ladders.MECHANISMS]
    table = Table("engine, family", *headings, title="least errors, and orders in parentheses", box=SIMPLE)
    for row, found in orders.table(records).items():
        table.add_row(row.name, *map(orders.cell, found.values()))
    return table
