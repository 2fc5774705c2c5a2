"""Ensembles: many scenes by one method, spread over processes; results are streamed, stored and resumed."""

from __future__ import annotations

import hashlib
import json
import os
import signal
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from mbref import __version__, records
from mbref.method import DEFAULT, Method
from mbref.scene import Scene
from mbref.simulation.simulate import Limits, checked_times, prepare, simulate
from mbref.trajectory import Trajectory

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
    is handed out, and a run of the same scene, times, method and limits in the file is not
    repeated.  Raises the errors of ``simulate`` for the first scene that cannot be simulated.
    """
    limits, times = limits or Limits(), checked_times(times)
    if executor is None:
        with processes() as pool:
            yield from ensemble(scenes, times, method, limits, pool, path)
        return
    prepare(Method.parse(method))  # once, not in every process at the same time
    known = records.stored(path)
    pending: dict[Future[Trajectory], tuple[int, str]] = {}
    try:
        for place, scene in enumerate(scenes):
            key = _key(scene, times, method, limits)
            if key in known:
                yield place, Trajectory.from_record(scene.name, known[key])
                continue
            pending[executor.submit(simulate, scene, method, times, limits)] = place, key
            while len(pending) >= AHEAD:
                yield from _ended(pending, path)
        while pending:
            yield from _ended(pending, path)
    finally:
        for future in pending:
            future.cancel()


def processes(workers: int | None = None) -> ProcessPoolExecutor:
    """A pool of so many processes, by default one a core; an interrupt is heard by their parent alone."""
    quiet = (signal.SIGINT, signal.SIG_IGN)
    return ProcessPoolExecutor(
        workers or os.cpu_count(), get_context("spawn"), initializer=signal.signal, initargs=quiet
    )


def _ended(
    pending: dict[Future[Trajectory], tuple[int, str]], path: str | Path | None
) -> Iterator[tuple[int, Trajectory]]:
    """The results there are, at least one, stored and taken off the pending ones."""
    ended = []
    for future in wait(pending, return_when=FIRST_COMPLETED).done:
        place, key = pending.pop(future)
        ended.append((place, future.result()))
        records.append(path, {"key": key, **ended[-1][1].to_record()})
    yield from ended


def _key(scene: Scene, times: np.ndarray, method: str, limits: Limits) -> str:
    """Hash of all that determines a result."""
    identity = [scene.to_dict(), times.tolist(), str(method), asdict(limits), __version__]
    return hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()
