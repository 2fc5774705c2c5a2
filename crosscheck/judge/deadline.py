"""A limit of CPU time for the calling thread, checked in all long computations of the judge.

``within(seconds)`` sets the limit, and ``ask()`` raises TimeIsUp after it. Long computations call ``ask`` in
their inner loops, so that no function needs an argument for the limit.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

_given_up = threading.Event()


class TimeIsUp(ArithmeticError):
    """The CPU time for the work has passed."""

    def __init__(self) -> None:
        super().__init__("the CPU time has passed")


class GivenUp(Exception):
    """The work was cancelled, because its result is no longer needed."""


class _Limit(threading.local):
    """The CPU time (s) of the thread at which its work ends."""

    end = float("inf")


_limit = _Limit()


@contextmanager
def within(seconds: float) -> Iterator[None]:
    """Limit the CPU time (s) of the calling thread in the ``with`` block; an outer limit that ends sooner
    stays valid."""
    before = _limit.end
    _limit.end = min(before, time.thread_time() + seconds)
    try:
        yield
    finally:
        _limit.end = before


def ask() -> None:
    """Raise TimeIsUp after the calling thread's limit, and GivenUp if all work was cancelled."""
    if _given_up.is_set():
        raise GivenUp("the computation was cancelled")
    if time.thread_time() > _limit.end:
        raise TimeIsUp


@contextmanager
def given_up() -> Iterator[None]:
    """Cancel the work of other threads while the ``with`` block runs, so that an interrupt does not wait for
    it."""
    _given_up.set()
    try:
        yield
    finally:
        _given_up.clear()
