"""The page on invariants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from crosscheck.invariants.laws import (
    COLUMNS,
    OF_SOLVERS,
    SOLVERS,
    Column,
    cell,
    columns_of,
    listed,
    options,
    tables,
)
from crosscheck.invariants.records import FILE, Record, read
from crosscheck.study.store import REFUSED

from ..blocks import Block, Fold, Parts, Table, Within, anchor, listing


def parts(records: Path = FILE) -> Parts:
    """Return the parts of the page from the records in a file."""
    found = tables(read(records))
    return {
        "tables": [_table(title, of_title) for title, of_title in found.items() if title != SOLVERS],
        "solvers": [_table(SOLVERS, found.get(SOLVERS, {}))],
        "columns": _about(COLUMNS),
        "columns_of_solvers": _about(OF_SOLVERS),
        "runs": [_runs(title, name, row) for title, rows in found.items() for name, row in rows.items()],
    }


def _about(columns: Sequence[Column]) -> list[Block]:
    return listing(f"**{column.heading}**: {column.about}" for column in columns)


def _anchor(title: str, row: str) -> str:
    return anchor(f"{row} by solver" if title == SOLVERS else row)


def _table(title: str, rows: Mapping[str, Sequence[Record]]) -> Table:
    columns = columns_of(title)
    header = ("engine, family", *(column.heading for column in columns))
    lines = [
        (Within(name, f"#{_anchor(title, name)}"), *(cell(row, column) for column in columns))
        for name, row in rows.items()
    ]
    return Table(f"{title[0].upper()}{title[1:]}.", header, lines)


def _runs(title: str, name: str, row: Sequence[Record]) -> Block:
    ran = [record for record in row if record["outcome"] != REFUSED]
    families = ", ".join(dict.fromkeys(record["family"] for record in ran)) or "no run"
    given = ", ".join(f"{k} {v}" for k, v in options(row).items())
    summary = f"{name} {row[0]['version']}: {families}" + f" ({given})" * bool(given)
    lines = listing(f"{column.heading}: {listed(row, column)}" for column in columns_of(title))
    return Fold(summary, _anchor(title, name), lines)
