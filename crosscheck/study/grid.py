"""Run a grid of scenes, engines and settings; each raw record is one JSON line, and an interrupted study
resumes."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
import os
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from crosscheck.engine import Setting, engine
from crosscheck.judge import metrics
from crosscheck.judge.reference.cache import mechanism
from crosscheck.judge.reference.reference import SECONDS
from crosscheck.judge.truth import Truth, truth_for
from crosscheck.processes import pool
from crosscheck.processes.child import ChildFailed
from crosscheck.processes.interrupts import calls_ended
from crosscheck.processes.pool import end_idle, run_estimated
from crosscheck.processes.serve import run_once
from crosscheck.study.provenance import made_by
from crosscheck.study.record_shape import checked
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.records import append, stored
from mbref.scene import Scene

SCHEMA = 1
TIME_LIMIT = 60.0  # s, of a default case
MOST_SECONDS = 1e7  # s, about four months: ten times as much is still a time that the system can wait
MEASURED = 2.0  # limit of the CPU time for the metrics, as a multiple of the time limit of the case

Record = dict[str, Any]
# function of (number of finished cases, number of cases, newest record)
Progress = Callable[[int, int, Record], None]


class Case(NamedTuple):
    """One run of a study.

    Attributes
    ----------
    scene : Scene
        The mechanism.
    times : ndarray, shape (k,)
        Sample times, s.
    engine : str
        Name of the engine.
    setting : Setting
        Family and options.
    time_limit : float
        CPU time (s) of the run, without imports and compilation.
    reference_time : float
        CPU time (s) of the reference solution where the scene has no closed form.
    """

    scene: Scene
    times: np.ndarray
    engine: str
    setting: Setting
    time_limit: float = TIME_LIMIT
    reference_time: float = SECONDS


def study(
    cases: Sequence[Case],
    executor: Executor | None = None,
    records_path: str | Path | None = None,
    progress: Progress | None = None,
    run: Callable[[Case], Any] | None = None,
) -> list[Record]:
    """Return the record of every case, in the order of the cases.

    Parameters
    ----------
    cases : sequence of Case
        The runs.
    executor : concurrent.futures.Executor, optional
        Where the runs happen. Default: threads, one for each core, which run engines in child processes.
        Workers of another executor need this package and the engines.
    records_path : path, optional
        JSON lines file. Each record is appended as its run ends. Stored records are not made again, unless
        they ran out of a time limit that is shorter than the limit of the case.
    progress : callable, optional
        Called with the number of cases done, the number of all cases, and the new record.
    run : callable, optional
        Makes the record of one case. Default: ``run_case``, in a child process; ``run_here`` in this process.

    Returns
    -------
    list of Record
        Results and errors, as ``crosscheck run --json`` prints them, in the order of the cases.
    """
    keys = [key(case) for case in cases]
    records = known(cases, records_path)
    left = {k: case for k, case in zip(keys, cases, strict=True) if k not in records}
    with contextlib.closing(_run_all(list(left.values()), executor, run or run_case)) as fresh:
        for record in fresh:
            records[record["key"]] = record
            append(records_path, record)
            if progress:
                progress(len(records), len(set(keys)), record)
    return [records[k] for k in keys]


def known(cases: Sequence[Case], records_path: str | Path | None) -> dict[str, Record]:
    """Return the stored records of the cases by key; ``study`` does not repeat these runs."""
    records = stored(records_path)
    limits = {key(case): case.time_limit for case in cases}
    checked(records_path, [records[k] for k in limits if k in records])
    return {k: records[k] for k in limits if k in records and not _worth_repeating(records[k], limits[k])}


def key(case: Case) -> str:
    """Hash of everything that determines a record: scene, times, engine, version and setting."""
    identity = [
        SCHEMA,
        case.scene.to_dict(),
        list(map(float, case.times)),
        case.engine,
        _version(case.engine),
        case.setting.family,
        dict(case.setting.options),
    ]
    return hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()


def run_case(case: Case) -> Record:
    """Return the raw record of one run, metrics included."""
    return record_of(case, run_estimated(case.engine, case.scene, case.times, case.setting, case.time_limit))


def run_in_turn(case: Case) -> Record:
    """Run a case in a child process that serves many short runs of an engine, also after a run that failed.

    Another child process computes the metrics, so that this process does not wait for a truth. Computing
    metrics ends after MEASURED times the case's limits; the record then has no error.
    """
    run = pool.run_in_turn(case.engine, case.scene, case.times, case.setting, case.time_limit)
    try:
        limit = MEASURED * (case.time_limit + case.reference_time)
        return pool.apart(record_of, (case, run), limit)
    except ChildFailed:
        return record_of(case._replace(reference_time=0.0), run)


def run_here(case: Case) -> Record:
    """Run a case in the calling process, without time limit, error estimate or protection from crashes."""
    return record_of(case, run_once(case.engine, case.scene, case.times, case.setting))


def record_of(case: Case, trajectory: Trajectory) -> Record:
    """Return the record of a case and its run: request, result, metrics, and versions and machine."""
    return {
        "schema": SCHEMA,
        "key": key(case),
        "scene": case.scene.name,
        "mechanism": mechanism(case.scene),
        **trajectory.to_record(),
        "engine": shown_name(case.engine),
        "family": case.setting.family,
        "asked": _asked(case),
        "time_limit": case.time_limit,
        "metrics": metrics.measure(case.scene, trajectory, _truth(case.scene, case.reference_time)),
        "seed": 0,
        **made_by(),
    }


def shown_name(engine_name: str) -> str:
    """Return the displayed name of an engine: for ``module:attribute`` the name of the object."""
    try:
        return engine(engine_name).name if ":" in engine_name else engine_name
    except Exception:  # the run itself reports the failed import as its outcome
        return engine_name


def _asked(case: Case) -> dict[str, Any]:
    """Return the request: engine, options, end time, and the number of equally spaced samples, or, for other
    times, all sample times."""
    end, times = case.scene.duration, np.asarray(case.times, dtype=float)
    even = len(times) > 1 and np.array_equal(times, np.linspace(0.0, end, len(times)))
    when = {"samples": len(times)} if even else {"times": times.tolist()}
    return {"engine": case.engine, "options": dict(case.setting.options), "end": end, **when}


def _run_all(
    cases: Sequence[Case], executor: Executor | None, run: Callable[[Case], Any]
) -> Generator[Record, None, None]:
    """Yield records as their runs end; a caller that stops early stops all runs."""
    if executor is None:
        with contextlib.ExitStack() as stack:
            stack.callback(end_idle)
            yield from _run_all(cases, stack.enter_context(ThreadPoolExecutor(os.cpu_count())), run)
        return
    futures = [executor.submit(run, case) for case in cases]
    with calls_ended(futures):
        for future in as_completed(futures):
            yield future.result()


def _worth_repeating(record: Record, time_limit: float) -> bool:
    return record["outcome"] == Outcome.TIMED_OUT.label and record["time_limit"] < time_limit


@functools.cache
def _version(engine_name: str) -> str:
    """Return the engine's version; empty if the engine gives none; the runs then fail."""
    try:
        return str(engine(engine_name).version())
    except Exception:
        return ""


@functools.lru_cache(maxsize=32)
def _truth(scene: Scene, reference_time: float) -> Truth | None:
    return truth_for(scene, reference_time)
