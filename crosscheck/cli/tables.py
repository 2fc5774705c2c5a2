"""The tables that `crosscheck run` and `crosscheck compare` print."""

from __future__ import annotations

import math
import string
from collections.abc import Sequence

from rich.console import Console
from rich.table import Table
from rich.text import Text

from crosscheck.cli.terminal_plot import scatter
from crosscheck.study.grid import Record
from crosscheck.study.record_view import (
    by_scene,
    engine_and_family,
    error,
    error_text,
    is_completed,
    varied_settings,
)

MEASURED = ("violation_position", "energy_error")  # metrics that the table of runs shows beside the error


def print_runs(console: Console, records: Sequence[Record]) -> None:
    """One table a scene: settings, outcome, end time, error, violation, energy and time of every run."""
    header = (
        "engine",
        "family",
        "settings",
        "outcome",
        "end (s)",
        "error",
        "violation",
        "energy",
        "time (s)",
    )
    for name, group in by_scene(records).items():
        table = _table(name, header, right_from=4)
        for r in group:
            numbers = [error_text(r), *(_number(r["metrics"].get(m)) for m in MEASURED)]
            table.add_row(
                *_identity(r, group),
                _outcome(r),
                f"{r['t_end']:.4g}",
                *numbers,
                _number(r["cost"]["seconds"]),
            )
        console.print(table)
        _print_messages(console, group)


def print_comparison(console: Console, records: Sequence[Record]) -> None:
    """One table a scene, least error first, with times and ratios to the fastest; then the plot."""
    header = (
        "",
        "engine",
        "family",
        "settings",
        "outcome",
        "end (s)",
        "error",
        "best (s)",
        "median (s)",
        "ratio",
    )
    for name, group in by_scene(records).items():
        letters = _letters(group)
        fastest = min((r["cost"]["seconds"] for r in group if is_completed(r)), default=math.nan)
        table = _table(name, header, right_from=5)
        for r in sorted(group, key=lambda r: (not is_completed(r), error(r))):
            measured = (f"{r['t_end']:.4g}", error_text(r), *_times(r, fastest))
            table.add_row(letters[engine_and_family(r)], *_identity(r, group), _outcome(r), *measured)
        console.print(table)
        console.print(scatter(group, letters))
        _print_messages(console, group)


def _times(record: Record, fastest: float) -> tuple[str, str, str]:
    seconds = record["cost"]["seconds"]
    middle = _number(record.get("timing", {}).get("median"))
    return (
        _number(seconds),
        middle,
        f"{seconds / fastest:.1f}" if is_completed(record) and fastest > 0 else "–",
    )


def _print_messages(console: Console, records: Sequence[Record]) -> None:
    for r in records:
        if not is_completed(r):
            console.print(Text(f"{' '.join(_identity(r, records))}: {r['outcome']}: {r['message']}"))


def _letters(records: Sequence[Record]) -> dict[tuple[str, str], str]:
    marks = string.ascii_uppercase + string.ascii_lowercase + string.digits
    curves = dict.fromkeys(engine_and_family(record) for record in records)
    return {name: marks[i % len(marks)] for i, name in enumerate(curves)}


def _identity(record: Record, records: Sequence[Record]) -> tuple[str, str, str]:
    return (*engine_and_family(record), varied_settings(record, records))


def _outcome(record: Record) -> str:
    return record["outcome"].lower().replace("_", " ")


def _number(value: float | None) -> str:
    return "–" if value is None or not math.isfinite(value) else f"{value:.2e}"


def _table(title: str, header: Sequence[str], right_from: int) -> Table:
    table = Table(title=title)
    for i, name in enumerate(header):
        table.add_column(name, justify="right" if i >= right_from else "left", overflow="fold")
    return table
