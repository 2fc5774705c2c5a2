"""The page on invariants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from crosscheck.invariants.laws import COLUMNS, cell, listed, options, tables
from crosscheck.invariants.records import FILE, Record, read
from crosscheck.study.store import REFUSED

from ..blocks import Block, Fold, Parts, Table, Within, anchor, listing


def parts(records: Path = FILE) -> Parts:
    """Return the parts of the page from the records in a file."""
    found = tables(read(records))
    rows = [row for of_title in found.values() for row in of_title.items()]
    return {
        "tables": [_table(title, of_title) for title, of_title in found.items()],
        "columns": listing(f"**{column.heading}**: {column.about}" for column in COLUMNS),
        "runs": [_runs(name, row) for name, row in rows],
    }


def _table(title: str, rows: Mapping[str, Sequence[Record]]) -> Table:
    header = ("engine, family", *(column.heading for column in COLUMNS))
    lines = [
        (Within(name, f"#{anchor(name)}"), *(cell(row, column) for column in COLUMNS))
        for name, row in rows.items()
    ]
    return Table(f"{title[0].upper()}{title[1:]}.", header, lines)


def _runs(name: str, row: Sequence[Record]) -> Block:
    ran = [record for record in row if record["outcome"] != REFUSED]
    families = ", ".join(dict.fromkeys(record["family"] for record in ran)) or "no run"
    given = ", ".join(f"{k} {v}" for k, v in options(row).items())
    summary = f"{name} {row[0]['version']}: {families}" + f" ({given})" * bool(given)
    return Fold(
        summary, anchor(name), listing(f"{column.heading}: {listed(row, column)}" for column in COLUMNS)
    )
