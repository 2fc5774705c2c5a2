"""Ensembles: many scenes by one method, spread over processes; results are streamed, stored and resumed."""

from __future__ import annotations

import hashlib
import json
import os
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path
from queue import SimpleQueue
from typing import Any, NamedTuple

import numpy as np

from mbref import __version__, records
from mbref.method import DEFAULT, Method
from mbref.scene import Scene
from mbref.simulation.simulate import Limits, checked_times, prepare, simulate
from mbref.trajectory import Outcome, Trajectory

AHEAD = 64  # runs handed to the executor before the first of them has to end


def ensemble(
    scenes: Iterable[Scene],
    times: Sequence[float] | np.ndarray,
    method: str = DEFAULT,
    limits: Limits | None = None,
    executor: Executor | None = None,
    path: str | Path | None = None,
) -> Iterator[tuple[int, Trajectory]]:
    """(place in ``scenes``, trajectory) of every scene as its run ends; times (k,) in s as for ``simulate``.

    ``scenes`` may be a generator: a few are drawn ahead of those that have ended.  ``executor`` is any of
    concurrent.futures; by default one process a core, for which a script needs the usual
    ``if __name__ == "__main__"``.  With ``path`` each result is appended to that file (JSON lines) before it
    is handed out, and a run of the same scene, times, method and limits in the file is not repeated.  A run
    whose process is killed has the outcome CRASHED; it is not stored, so that it is run again.  Raises the
    errors of ``simulate`` for the first scene that cannot be simulated, and RecordsError or OSError for a
    file that holds something else than records or cannot be written.
    """
    limits, times = limits or Limits(), checked_times(times)
    if executor is None:
        with processes() as pool:
            yield from ensemble(scenes, times, method, limits, pool, path)
        return
    known = records.opened(path)  # before anything is compiled or run for it
    prepare(Method.parse(method))  # once, not in every process at the same time
    pending: dict[Future[Trajectory], Job] = {}
    try:
        for place, scene in enumerate(scenes):
            key = _key(scene, times, method, limits)
            if key in known:
                yield place, Trajectory.from_record(scene.name, known[key])
                continue
            job = Job(place, key, scene, method, limits)
            pending[executor.submit(simulate, scene, method, times, limits)] = job
            while len(pending) >= AHEAD:
                yield from _ended(pending, path)
        while pending:
            yield from _ended(pending, path)
    finally:
        for future in pending:
            future.cancel()


class Processes(Executor):
    """Processes that each make one call after another; one that is killed fails its own call alone.

    (A ProcessPoolExecutor of several fails all the calls that it has been given.)
    """

    def __init__(self, workers: int) -> None:
        self._threads = ThreadPoolExecutor(workers)
        self._idle: SimpleQueue[ProcessPoolExecutor] = SimpleQueue()
        for _ in range(workers):
            self._idle.put(_process())

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **named: Any) -> Future[Any]:
        """The future of a call; BrokenExecutor is its exception where its process is killed."""
        return self._threads.submit(self._call, function, arguments, named)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes when their calls have ended."""
        self._threads.shutdown(wait, cancel_futures=cancel_futures)
        while not self._idle.empty():
            self._idle.get().shutdown(wait)

    def _call(self, function: Callable[..., Any], arguments: tuple[Any, ...], named: dict[str, Any]) -> Any:
        process = self._idle.get()
        try:
            return process.submit(function, *arguments, **named).result()
        except BrokenExecutor:
            process.shutdown()
            process = _process()
            raise
        finally:
            self._idle.put(process)


def processes(workers: int | None = None) -> Processes:
    """So many processes, by default one a core; an interrupt is heard by their parent alone."""
    return Processes(workers or os.cpu_count() or 1)


def _process() -> ProcessPoolExecutor:
    quiet = (signal.SIGINT, signal.SIG_IGN)
    return ProcessPoolExecutor(1, get_context("spawn"), initializer=signal.signal, initargs=quiet)


class Job(NamedTuple):
    """A run that has been handed to the executor."""

    place: int
    key: str
    scene: Scene
    method: str
    limits: Limits


def _ended(
    pending: dict[Future[Trajectory], Job], path: str | Path | None
) -> Iterator[tuple[int, Trajectory]]:
    """The results there are, at least one, stored and taken off the pending ones."""
    ended = []
    for future in wait(pending, return_when=FIRST_COMPLETED).done:
        job = pending.pop(future)
        try:
            run = future.result()
        except BrokenExecutor:
            run = _crashed(job)
        else:
            records.append(path, {"key": job.key, **run.to_record()})
        ended.append((job.place, run))
    yield from ended


def _crashed(job: Job) -> Trajectory:
    return Trajectory.failed(
        scene=job.scene.name, engine="mbref", version=__version__, method=str(Method.parse(job.method)),
        settings=asdict(job.limits), bodies=tuple(body.name for body in job.scene.body),
        outcome=Outcome.CRASHED, message="its process was killed",
    )  # fmt: skip


def _key(scene: Scene, times: np.ndarray, method: str, limits: Limits) -> str:
    """Hash of all that determines a result."""
    identity = [scene.to_dict(), times.tolist(), str(method), asdict(limits), __version__]
    return hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()
