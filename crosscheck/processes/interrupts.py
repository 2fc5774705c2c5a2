"""An interrupt ends the calls that threads make, instead of waiting for them."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from concurrent.futures import Future, wait
from contextlib import contextmanager
from typing import Any

from crosscheck.judge.deadline import given_up
from crosscheck.processes.child import stop_all

INTERVAL = 0.1  # s between two attempts, since a call may start a child after the children have ended


@contextmanager
def calls_ended(calls: Collection[Future[Any]]) -> Iterator[None]:
    """End the calls of threads if the ``with`` block ends early.

    Waiting calls are cancelled; children of running calls are killed, and references are given up.
    """
    try:
        yield
    except BaseException:
        for call in calls:
            call.cancel()
        with given_up():
            while wait(calls, timeout=INTERVAL).not_done:
                stop_all()
        raise
