"""The progress bar of a study, on standard error."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from crosscheck.study.grid import Progress as Advance
from crosscheck.study.grid import Record


@contextmanager
def counted(what: str, total: int) -> Iterator[Callable[[str], None]]:
    """A bar from 0 to ``total``; yields a function that moves it one on and names what is done."""
    with _bar() as bar:
        task = bar.add_task(what, total=total, last="")
        yield lambda last: bar.update(task, advance=1, last=last)


@contextmanager
def shown(what: str, total: int) -> Iterator[Advance]:
    """A bar from 0 to ``total`` while the context lasts; yields what ``study`` takes as ``progress``."""
    with _bar() as bar:
        task = bar.add_task(what, total=total, last="")

        def advance(done: int, total: int, record: Record) -> None:
            last = f"{record['scene']} {record['engine']} {record['family']}: {record['outcome']}"
            bar.update(task, completed=done, total=total, last=last)

        yield advance


def _bar() -> Progress:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
               TextColumn("{task.fields[last]}", markup=False))  # fmt: skip
    return Progress(*columns, console=Console(stderr=True), transient=True)
