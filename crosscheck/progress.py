"""The progress bar of a study, on standard error."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from crosscheck.study import Progress as Advance
from crosscheck.study import Record


@contextmanager
def shown(what: str, total: int) -> Iterator[Advance]:
    """A bar from 0 to ``total`` while the context lasts; yields what ``study`` takes as ``progress``."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
               TextColumn("{task.fields[last]}"))  # fmt: skip
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=total, last="")

        def advance(done: int, total: int, record: Record) -> None:
            last = f"{record['scene']} {record['engine']} {record['family']}: {record['outcome']}"
            bar.update(task, completed=done, total=total, last=last)

        yield advance
