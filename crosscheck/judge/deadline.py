"""A limit of CPU time for the calling thread, asked wherever the judge computes for long.

``within(seconds)`` sets the limit, ``ask()`` raises TimeIsUp once it has passed.  Long work asks in its
innermost loop of more than a few array operations, so that no caller hands a deadline down.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

_given_up = threading.Event()


class TimeIsUp(ArithmeticError):
    """The CPU time that the work was given has passed."""

    def __init__(self) -> None:
        super().__init__("the time for it was up")


class GivenUp(Exception):
    """The work was not finished, because its result is no longer wanted."""


class _Limit(threading.local):
    """The thread's CPU time (s) at which its work ends."""

    end = float("inf")


_limit = _Limit()


@contextmanager
def within(seconds: float) -> Iterator[None]:
    """Limit the CPU time (s) of the calling thread in the block; an outer limit that ends sooner stays."""
    before = _limit.end
    _limit.end = min(before, time.thread_time() + seconds)
    try:
        yield
    finally:
        _limit.end = before


def ask() -> None:
    """Raise TimeIsUp past the calling thread's limit, and GivenUp where no thread's result is wanted."""
    if _given_up.is_set():
        raise GivenUp("the computation was cancelled")
    if time.thread_time() > _limit.end:
        raise TimeIsUp


@contextmanager
def given_up() -> Iterator[None]:
    """End the work of other threads by GivenUp until the block is left: an interrupt does not wait for it."""
    _given_up.set()
    try:
        yield
    finally:
        _given_up.clear()
