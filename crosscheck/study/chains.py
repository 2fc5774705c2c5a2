"""Runs of several engines at a time, the runs of each engine one after another, measured separately."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from threading import Lock
from typing import Any

from crosscheck.study.grid import Case, Record
from mbref.trajectory import Trajectory

Measure = Callable[[Case, Trajectory], Record]
Call = tuple[Future[Record], Callable[[Case], Trajectory], Case]


class Chains(ThreadPoolExecutor):
    """Threads, one a core, each of which stays with an engine as long as that has runs left.

    One child process serves an engine, and a run is over before the next of its family begins.  Records are
    made by ``measure`` in a thread of its own, which may wait for a truth while runs go on.
    """

    def __init__(self, measure: Measure) -> None:
        super().__init__(os.cpu_count())
        self._measure, self._measuring = measure, ThreadPoolExecutor(1)
        self._calls: dict[str, deque[Call]] = {}  # keyed by engine, as long as a thread stays with it
        self._changing = Lock()

    def submit(self, run: Callable[..., Any], case: Any, /) -> Future[Any]:  # type: ignore[override]
        """The future record of ``run(case)``, a trajectory."""
        future: Future[Any] = Future()
        with self._changing:
            is_new = case.engine not in self._calls
            self._calls.setdefault(case.engine, deque()).append((future, run, case))
        if is_new:
            super().submit(self._serve, case.engine)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the threads once their calls are done."""
        super().shutdown(wait, cancel_futures=cancel_futures)
        self._measuring.shutdown(wait, cancel_futures=cancel_futures)

    def _serve(self, engine: str) -> None:
        while call := self._next(engine):
            future, run, case = call
            if future.set_running_or_notify_cancel() and (made := _reported(future, run, case)):
                self._measuring.submit(self._finish, future, case, made)

    def _next(self, engine: str) -> Call | None:
        with self._changing:
            if self._calls[engine]:
                return self._calls[engine].popleft()
            del self._calls[engine]
            return None

    def _finish(self, future: Future[Record], case: Case, trajectory: Trajectory) -> None:
        if record := _reported(future, self._measure, case, trajectory):
            future.set_result(record)


def _reported(future: Future[Record], function: Callable[..., Any], *arguments: Any) -> Any:
    """Return the function's value; None if it raises, which the future then raises for its owner."""
    try:
        return function(*arguments)
    except BaseException as error:
        future.set_exception(error)
        return None
