"""The progress of a study on standard error: a bar with the time left, or plain lines."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from crosscheck.study.grid import Progress as Advance
from crosscheck.study.grid import Record

PARTS = 10  # lines of a progress that no terminal shows
HUNDREDTHS = 100  # parts in which the progress of one motion is told
COLUMNS = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
           TextColumn("left"), TimeRemainingColumn(),
           TextColumn("{task.fields[last]}", markup=False))  # fmt: skip
Show = Callable[[int, int, str], None]  # done, in all, what was done last


@contextmanager
def counted(what: str, total: int) -> Iterator[Callable[[str], None]]:
    """Progress from 0 to ``total``; yields a function that moves it one on and names what is done."""
    with _display(what, total) as show:
        done = 0

        def advance(last: str) -> None:
            nonlocal done
            done += 1
            show(done, total, last)

        yield advance


@contextmanager
def shown(what: str, total: int) -> Iterator[Advance]:
    """Progress from 0 to ``total`` while the context lasts; yields what ``study`` takes as ``progress``."""
    with _display(what, total) as show:

        def advance(done: int, total: int, record: Record) -> None:
            show(done, total, f"{record['scene']} {record['engine']} {record['family']}: {record['outcome']}")

        yield advance


@contextmanager
def followed(what: str, end: float) -> Iterator[Callable[[float], None]]:
    """Progress of a motion from t = 0 to ``end`` (s), in hundredths; yields a function that takes the time
    reached."""
    with _display(what, HUNDREDTHS) as show:

        def reached(t: float) -> None:
            done = min(int(HUNDREDTHS * t / end), HUNDREDTHS)
            show(done, HUNDREDTHS, f"t = {min(t, end):.3g} s")

        yield reached


@contextmanager
def _display(what: str, total: int) -> Iterator[Show]:
    """A bar on a terminal, else a line of text for every tenth."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield _Lines(what, console)
        return
    with Progress(*COLUMNS, console=console, transient=True) as bar:
        task = bar.add_task(what, total=total, last="")
        yield lambda done, total, last: bar.update(task, completed=done, total=total, last=last)


class _Lines:
    """Progress as lines, the time left told from the time taken."""

    def __init__(self, what: str, console: Console):
        self._what, self._console = what, console
        self._start, self._told = time.monotonic(), 0

    def __call__(self, done: int, total: int, last: str) -> None:
        if PARTS * done // total == PARTS * self._told // total:
            return
        self._told = done
        taken = time.monotonic() - self._start
        left = f", about {taken / done * (total - done):.0f} s left" if done < total else ""
        line = f"{self._what}: {done} of {total}, {taken:.0f} s{left}; {last}"
        self._console.print(line, markup=False, highlight=False, soft_wrap=True)
