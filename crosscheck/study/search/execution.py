"""Order of the runs: several engines at once, each from coarse to fine, without hopeless settings.

Metrics are computed in parallel with the runs.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from threading import Lock
from typing import Any

from crosscheck.processes.pool import run_estimated
from crosscheck.processes.serve import failed
from crosscheck.study.grid import Case, Record, record_of
from mbref.motions.trajectory import Outcome, Trajectory

NOT_STARTED = "not started: a coarser setting of the family reached the time limit"

Measure = Callable[[Case, Trajectory], Record]
Call = tuple[Future[Record], Callable[[Case], Trajectory], Case]


class Chains(ThreadPoolExecutor):
    """Executor with one thread for each core; a thread runs the cases of one engine as long as cases are
    left.

    One child process serves an engine, and the next run of a family begins after the end of the previous one.
    A further thread calls ``measure``, which makes the record and may wait for a truth while runs continue.
    """

    def __init__(self, measure: Measure) -> None:
        super().__init__(os.cpu_count())
        self._measure, self._measuring = measure, ThreadPoolExecutor(1)
        # waiting calls of each engine; an entry exists as long as a thread serves the engine
        self._calls: dict[str, deque[Call]] = {}
        self._changing = Lock()

    def submit(self, run: Callable[..., Any], case: Any, /) -> Future[Any]:  # type: ignore[override]
        """Return the future of the record that is made from the trajectory ``run(case)``."""
        future: Future[Any] = Future()
        with self._changing:
            is_new = case.engine not in self._calls
            self._calls.setdefault(case.engine, deque()).append((future, run, case))
        if is_new:
            super().submit(self._serve, case.engine)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the threads after their calls."""
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
    """Return the function's value; an exception is also stored in the future, which raises it in the
    caller."""
    try:
        return function(*arguments)
    except BaseException as error:
        future.set_exception(error)
        return None


class CoarseFirst:
    """Replacement of ``run_case`` for cases that come coarse to fine in each family.

    After a run that ran out of time, finer settings of its family are not started.
    """

    def __init__(self) -> None:
        self._slow: set[tuple[str, str, str]] = set()

    def __call__(self, case: Case) -> Record:
        """Return the record of a case; TIMED_OUT without a run if a coarser setting ran out of time."""
        return record_of(case, self.trajectory(case))

    def trajectory(self, case: Case) -> Trajectory:
        """Return the trajectory of a case; TIMED_OUT without a run if a coarser setting ran out of time."""
        family = case.scene.name, case.engine, case.setting.family
        if family in self._slow:
            return failed(case.engine, "", case.scene, case.setting, Outcome.TIMED_OUT, NOT_STARTED)
        run = run_estimated(case.engine, case.scene, case.times, case.setting, case.time_limit)
        if run.outcome is Outcome.TIMED_OUT:
            self._slow.add(family)
        return run
