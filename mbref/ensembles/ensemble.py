"""Ensembles: many scenes simulated by one method in several processes. Each result is yielded when its run
ends, and can be stored; a stored ensemble can be resumed.

A process receives several runs in one call, because scenes of equal structure are prepared in one batch
(``batch.py``).
"""

from __future__ import annotations

import contextlib
import hashlib
import itertools
import json
import os
import time
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future
from dataclasses import asdict
from pathlib import Path
from queue import SimpleQueue
from typing import Any, NamedTuple

import numpy as np

from mbref import records
from mbref.ensembles.processes import processes
from mbref.ensembles.simulate_all import Ended, run_all
from mbref.method import Method, crossing_method
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import Scene
from mbref.scenes import find_scene
from mbref.simulation import VERSION
from mbref.simulation.simulate import Limits, checked_times, prepare

AHEAD = (
    64  # runs submitted to the executor before the first result is needed; at least twice the number of cores
)
# most runs that a process receives at once, and the CPU time (s) that they may take: to prepare a batch takes
# some 20 ms, and an executor of many machines needs milliseconds to pass on a call
MOST_AT_ONCE, SECONDS = 512, 0.25


def ensemble(
    scenes: Iterable[Scene | str | Path],
    times: Sequence[float] | np.ndarray,
    method: str | None = None,
    limits: Limits | None = None,
    executor: Executor | None = None,
    path: str | Path | None = None,
) -> Iterator[tuple[int, Trajectory]]:
    """Simulate many scenes by one method, in batches of equal structure and in several processes.

    A run whose process is killed has the outcome CRASHED. Such a run is not stored, so that the next call
    repeats it.

    Parameters
    ----------
    scenes : iterable of Scene, str or path
        Scenes, names of built-in ones, or .toml files. A generator is read a few scenes ahead of the results.
    times : sequence of float or ndarray, shape (k,)
        Increasing sample times, s, as for ``simulate``.
    method : str, optional
        Name of the method of all runs. Default: the default method of the first scene.
    limits : Limits, optional
        Tolerances and steps of every run.
    executor : concurrent.futures.Executor, optional
        Where the runs happen. Default: one process for each core, for which a script needs the usual
        ``if __name__ == "__main__"``.
    path : str or path, optional
        JSON lines file. Each result is appended before it is yielded. A run of an equal scene with equal
        times, method and limits in the file is not repeated.

    Yields
    ------
    tuple of (int, Trajectory)
        Index of the scene in ``scenes``, and its motion, as each run ends.

    Raises
    ------
    SceneError, MethodError, InputError
        As ``simulate``, for the first scene that cannot be simulated, with its index as a note.
    RecordsError
        If the file contains something else than records.
    OSError
        If the file cannot be read or written.
    """
    limits, times = limits or Limits(), checked_times(times)
    found: Iterator[Scene] = map(find_scene, scenes)
    if method is None:
        first = next(found, None)
        if first is None:
            return
        method, found = crossing_method(first), itertools.chain([first], found)
    if executor is None:
        with processes() as pool:
            yield from ensemble(found, times, method, limits, pool, path)
        return
    known = records.opened(path)  # raises for a faulty file before anything is compiled or run
    prepare(Method.parse(method))  # once, not in every process at the same time
    work = Work(executor, method, times, limits)
    try:
        for place, scene in enumerate(found):
            key = _key(scene, times, method, limits) if path else ""
            if key in known:
                yield place, _stored(path, scene, times, known[key])
                continue
            work.add(Job(place, key, scene.reaching(times[-1])))
            while work.is_full() or work.has_ended():
                yield from _handed_out(work, path)
        work.hand_over()
        while work.pending:
            yield from _handed_out(work, path)
    finally:
        work.cancel()


def _stored(path: str | Path | None, scene: Scene, times: np.ndarray, record: dict[str, Any]) -> Trajectory:
    """Return the motion of a record, its bodies in the scene's order; raises RecordsError if it is
    damaged."""
    found = None
    with contextlib.suppress(*records.BROKEN):
        bodies = {body.name: record["bodies"][body.name] for body in scene.body}
        found = Trajectory.from_record(scene.name, {**record, "bodies": bodies})
    if found is None or not _is_result(found, times):
        key = record["key"][:12]
        raise records.RecordsError(
            f"{path}: record {key!r}: is no result of a run; remove this line, or the file"
        )
    return found


def _is_result(run: Trajectory, times: np.ndarray) -> bool:
    """Return whether a run has finite states at the first of the times, and at all if it completed."""
    states = (run.position, run.orientation, run.velocity, run.angular_velocity)
    is_whole = run.times.size == times.size or run.outcome is not Outcome.COMPLETED
    are_first = np.array_equal(run.times, times[: run.times.size])
    return is_whole and are_first and all(np.isfinite(state).all() for state in states)


class Job(NamedTuple):
    """A requested run."""

    place: int
    key: str
    scene: Scene


class Work:
    """Runs submitted to the executor, several at once; runs of a killed process are repeated one by one.

    ``error`` is the exception of the first scene that cannot be simulated.
    """

    def __init__(self, executor: Executor, method: str, times: np.ndarray, limits: Limits):
        self.pending: dict[Future[Ended], list[Job]] = {}
        self._executor, self._method, self._times, self._limits = executor, method, times, limits
        self._done: SimpleQueue[Future[Ended]] = SimpleQueue()
        self._waiting: list[Job] = []
        self._since = 0.0  # s; time at which the first waiting run was added
        self._at_once = 0  # runs that a worker receives at once; 0 until the first run was timed
        self._cores = os.cpu_count() or 1
        self.error: Exception | None = None

    def add(self, job: Job) -> None:
        """Submit runs when enough are waiting, or when they have waited too long while no process works."""
        now = time.monotonic()
        self._since = self._since if self._waiting else now
        self._waiting.append(job)
        is_idle = not self.pending and now - self._since >= SECONDS
        if len(self._waiting) >= self._at_once or is_idle:
            self.hand_over()

    def hand_over(self) -> None:
        """Submit the waiting runs."""
        if self._waiting:
            self._submit(self._waiting)
            self._waiting = []

    def _submit(self, jobs: list[Job]) -> None:
        scenes = [job.scene for job in jobs]
        arguments = self._method, self._times, self._limits
        future = self._executor.submit(run_all, scenes, *arguments)
        self.pending[future] = jobs
        future.add_done_callback(self._done.put)

    def has_ended(self) -> bool:
        """Return whether there are results."""
        return not self._done.empty()

    def is_full(self) -> bool:
        """Return whether a result must be awaited before more runs are submitted."""
        given = sum(map(len, self.pending.values()))
        if not self._at_once:
            return given >= self._cores
        return given >= max(AHEAD, 2 * self._cores * self._at_once)

    def ended(self) -> list[tuple[Job, Trajectory]]:
        """Yield the runs that end next, each with its trajectory."""
        future = self._done.get()
        jobs = self.pending.pop(future)
        try:
            found = future.result()
        except BrokenExecutor:
            return self._without_process(jobs)
        self._at_once = int(max(1, min(MOST_AT_ONCE, SECONDS * len(jobs) / max(found.seconds, 1e-9))))
        if found.errors:
            place, self.error = min(found.errors.items())
            self.error.add_note(f"This is scene {jobs[place].place} of the ensemble, counted from 0.")
        return [(jobs[place], run) for place, run in found.motions([job.scene for job in jobs])]

    def _without_process(self, jobs: list[Job]) -> list[tuple[Job, Trajectory]]:
        """Handle runs whose process was killed: a single run has crashed, several runs are submitted one by
        one."""
        crashed = []
        for job in jobs:
            try:
                if len(jobs) == 1:
                    raise BrokenExecutor
                self._submit([job])
            except BrokenExecutor:
                crashed.append((job, self._crashed(job)))
        return crashed

    def _crashed(self, job: Job) -> Trajectory:
        return Trajectory.failed(
            scene=job.scene.name, engine="mbref", version=VERSION, method=str(Method.parse(self._method)),
            settings=asdict(self._limits), bodies=tuple(body.name for body in job.scene.body),
            outcome=Outcome.CRASHED, message="its process was killed",
        )  # fmt: skip

    def cancel(self) -> None:
        """Cancel all runs that have not begun."""
        for future in self.pending:
            future.cancel()


def _handed_out(work: Work, path: str | Path | None) -> Iterator[tuple[int, Trajectory]]:
    """Yield the runs that end next by their indices.

    All results are stored first, except for runs whose process was killed.
    """
    found = work.ended()
    for job, run in found:
        if path and run.outcome is not Outcome.CRASHED:
            records.append(path, {"key": job.key, **run.to_record()})
    for job, run in found:
        yield job.place, run
    if work.error:
        raise work.error


def _key(scene: Scene, times: np.ndarray, method: str, limits: Limits) -> str:
    """Return the hash of everything that determines a result."""
    identity = [scene.to_dict(), times.tolist(), str(method), asdict(limits), VERSION]
    return hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()
