"""Progress of a study on standard error: a bar with the remaining time, or plain lines without a terminal."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Protocol

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text

from crosscheck.processes.pool import starting
from crosscheck.study.grid import Record
from mbref.terminal import Console

PARTS = 10  # number of lines that show a progress without a terminal
QUIET = 20.0  # seconds without a printed line, after which a line names the running work
LOOKED = 0.5  # seconds between two checks for QUIET
HUNDREDTHS = 100  # number of progress reports for one motion
Show = Callable[[int, int, str], None]  # function of (finished runs, all runs, name of the last one)


class Shown(Protocol):
    """Progress callback of a study: called with the number of finished runs, of all runs, and the latest
    record."""

    under_way: UnderWay

    def __call__(self, done: int, total: int, record: Record) -> None:
        """Show the progress."""


class UnderWay:
    """Work that is running, by name, with its start time (s), and the output of engines that are being
    prepared.

    Several threads may work.
    """

    def __init__(self) -> None:
        self._began: dict[int, tuple[str, float]] = {}  # keyed by thread

    def named(self, run: Callable[[Any], Any], name: Callable[[Any], str]) -> Callable[[Any], Any]:
        """Return the function such that each of its calls is listed as running work under ``name`` of its
        argument."""

        def called(given: Any) -> Any:
            self._began[threading.get_ident()] = name(given), time.monotonic()
            try:
                return run(given)
            finally:
                del self._began[threading.get_ident()]

        return called

    def __str__(self) -> str:
        now, starts = time.monotonic(), starting()
        named = {
            thread: f"{name}, for {now - since:.0f} s" for thread, (name, since) in self._began.copy().items()
        }
        with_starts = [f"{text} ({starts.pop(k)})" if k in starts else text for k, text in named.items()]
        return "; ".join([*with_starts, *dict.fromkeys(starts.values())])


@contextmanager
def counted(what: str, total: int, quiet: float = 0.0) -> Iterator[Callable[[str], None]]:
    """Show progress from 0 to ``total``, after ``quiet`` seconds; yields a function that advances it by one
    and names the finished work."""
    with _display(what, total) as (show, _):
        done, began = 0, time.monotonic()

        def advance(last: str) -> None:
            nonlocal done
            done += 1
            if time.monotonic() - began >= quiet:
                show(done, total, last)

        yield advance


@contextmanager
def narrated(what: str, total: int) -> Iterator[tuple[Callable[[str], None], Callable[[str], None]]]:
    """Show progress from 0 to ``total``; yields a function that shows a sentence on the running work, and one
    that advances by one and names the finished part."""
    with _display(what, total) as (show, _):
        done = 0

        def advance(last: str) -> None:
            nonlocal done
            done += 1
            show(done, max(done, total), last)

        yield lambda text: show(done, max(done, total), text), advance


@contextmanager
def shown(what: str, total: int) -> Iterator[Shown]:
    """Show progress from 0 to ``total`` within a ``with`` block; yields the ``progress`` callback of
    ``study``.

    The progress names the work ``under_way``.
    """
    with _display(what, total) as (show, under_way):
        yield _OfRecords(show, under_way)


class _OfRecords:
    """Progress that shows each record by scene, engine, family and outcome."""

    def __init__(self, show: Show, under_way: UnderWay):
        self._show, self.under_way = show, under_way

    def __call__(self, done: int, total: int, record: Record) -> None:
        last = f"{record['scene']} {record['engine']} {record['family']}: {record['outcome']}"
        self._show(done, total, last)


@contextmanager
def followed(what: str, end: float) -> Iterator[Callable[[float], None]]:
    """Show the progress of a motion from t = 0 to ``end`` (s) in hundredths; yields a function of the reached
    time."""
    with _display(what, HUNDREDTHS) as (show, _):

        def reached(t: float) -> None:
            done = min(int(HUNDREDTHS * t / end), HUNDREDTHS)
            show(done, HUNDREDTHS, f"t = {min(t, end):.3g} s")

        yield reached


@contextmanager
def _display(what: str, total: int) -> Iterator[tuple[Show, UnderWay]]:
    """Show a bar on a terminal, otherwise a text line for every tenth and after QUIET seconds without a
    line."""
    console, under_way = Console(stderr=True), UnderWay()
    if not console.is_terminal:
        with _Lines(what, total, console, under_way) as lines:
            yield lines, under_way
        return
    with Progress(*_columns(under_way), console=console, transient=True) as bar:
        task = bar.add_task(what, total=total, last="")
        yield lambda done, total, last: bar.update(task, completed=done, total=total, last=last), under_way


def _columns(under_way: UnderWay) -> tuple[ProgressColumn, ...]:
    return (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        _Working(under_way),
    )


class _Working(ProgressColumn):
    """Column of the progress bar that names the running work, otherwise the last finished work."""

    max_refresh = 1.0

    def __init__(self, under_way: UnderWay):
        super().__init__()
        self._under_way = under_way

    def render(self, task: Task) -> Text:
        """Return the column's text."""
        return Text(str(self._under_way) or task.fields["last"])


class _Lines:
    """Progress as text lines, with the remaining time estimated from the elapsed time."""

    def __init__(self, what: str, total: int, console: Console, under_way: UnderWay):
        self._what, self._total, self._console, self._under_way = what, total, console, under_way
        self._start, self._reported, self._done = time.monotonic(), 0, 0
        self._printed, self._over = self._start, threading.Event()
        self._watch = threading.Thread(target=self._name_work, daemon=True)

    def __enter__(self) -> _Lines:
        self._watch.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._watch.join()

    def __call__(self, done: int, total: int, last: str) -> None:
        self._done, self._total = done, total
        if PARTS * done // total == PARTS * self._reported // total:
            return
        self._reported = done
        taken = time.monotonic() - self._start
        left = f", about {taken / done * (total - done):.0f} s left" if done < total else ""
        self._print(f"{left}; {last}")

    def _name_work(self) -> None:
        """Print a line that names the running work whenever QUIET seconds pass without a line."""
        while not self._over.wait(LOOKED):
            if time.monotonic() - self._printed >= QUIET and (working := str(self._under_way)):
                self._print(f"; now {working}")

    def _print(self, rest: str) -> None:
        self._printed = time.monotonic()
        line = f"{self._what}: {self._done} of {self._total}, {self._printed - self._start:.0f} s{rest}"
        self._console.print(line, markup=False, highlight=False, soft_wrap=True)
