"""Ensembles: many scenes by one method, spread over processes; results are streamed, stored and resumed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future
from dataclasses import asdict
from pathlib import Path
from queue import SimpleQueue
from typing import NamedTuple

import numpy as np

from mbref import __version__, records
from mbref.method import DEFAULT, Method
from mbref.scene import Scene
from mbref.simulation.processes import processes
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
    done: SimpleQueue[Future[Trajectory]] = SimpleQueue()
    run: Callable[..., Trajectory] = simulate
    try:
        for place, scene in enumerate(scenes):
            key = _key(scene, times, method, limits) if path else ""
            if key in known:
                yield place, Trajectory.from_record(scene.name, known[key])
                continue
            future = executor.submit(run, scene, method, times, limits)
            pending[future] = Job(place, key, scene, method, limits)
            future.add_done_callback(done.put)
            while len(pending) >= AHEAD:
                yield _ended(done.get(), pending, path)
        while pending:
            yield _ended(done.get(), pending, path)
    finally:
        for future in pending:
            future.cancel()


class Job(NamedTuple):
    """A run that has been handed to the executor."""

    place: int
    key: str
    scene: Scene
    method: str
    limits: Limits


def _ended(
    future: Future[Trajectory], pending: dict[Future[Trajectory], Job], path: str | Path | None
) -> tuple[int, Trajectory]:
    """A result, stored and taken off the pending ones."""
    job = pending.pop(future)
    try:
        run = future.result()
    except BrokenExecutor:
        return job.place, _crashed(job)
    if path:
        records.append(path, {"key": job.key, **run.to_record()})
    return job.place, run


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
