"""Runs whose motions a report animates: sampled at the times of the frames and rounded for the screen."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engine import Setting, engine
from crosscheck.processes.pool import run_estimated
from crosscheck.setting import BRANCHES
from crosscheck.study.grid import Case, Record, record_of, study
from crosscheck.study.record_view import error, is_completed
from crosscheck.study.search.execution import Chains
from mbref.motions.crossing import Crossing
from mbref.motions.trajectory import Trajectory

DIGITS = 6  # decimal digits kept of a position, relative to the size of the mechanism: finer than a pixel
FRAMES = 75  # frames of the motion on a branch
MOST = 2  # largest number of singular positions of a scene whose branches are shown
DROPPED = ("reactions", "open_reactions", "angles")  # fields of a record that no picture needs
POSES = ("position", "orientation")

Run = tuple[Case, Record]


def worst_runs(runs: Sequence[Run], truths: Sequence[Record], path: Path | None) -> list[Record]:
    """Return for each scene with a true motion its completed run of largest error, sampled at that
    motion's times."""
    cases = []
    for truth in truths:
        own = [run for run in runs if run[1]["scene"] == truth["scene"] and is_completed(run[1])]
        if truth["motion"] and own:
            worst, _ = max(own, key=lambda run: error(run[1]))
            cases.append(worst._replace(times=np.array(truth["motion"]["times"])))
    return _studied(cases, path)


def branches(runs: Sequence[Run], path: Path | None) -> list[Record]:
    """Return for each scene the runs along every branch of a few of its singular positions."""
    by_scene: dict[str, list[Run]] = {}
    for run in runs:
        if is_completed(run[1]) and run[1]["crossings"] and BRANCHES in engine(run[0].engine).options:
            by_scene.setdefault(run[1]["scene"], []).append(run)
    best = [min(own, key=lambda run: error(run[1])) for own in by_scene.values()]
    return _studied([case for run in best for case in _along_branches(*run)], path)


def shown(crossings: Sequence[Mapping[str, Any]]) -> list[int]:
    """Return the numbers, from 1, of the singular positions to be shown; positions with several branches come
    first."""
    several = [number for number, crossing in enumerate(crossings, 1) if len(crossing["velocity"]) > 1]
    return (several or [1])[:MOST]


def _along_branches(case: Case, record: Record) -> Iterator[Case]:
    for number in shown(record["crossings"]):
        crossing = Crossing.from_record(record["crossings"][number - 1])
        times = crossing.instants(case.scene.duration, FRAMES)
        for branch in range(1, len(crossing.velocity) + 1):
            options = {**case.setting.options, BRANCHES: [[number, branch]]}
            yield case._replace(times=times, setting=Setting(case.setting.family, options))


def _studied(cases: Sequence[Case], path: Path | None) -> list[Record]:
    """Return the records of runs; the children that have run the engines before are used again."""
    with Chains(_pictured) as threads:
        return study(cases, threads, path, run=_run)


def _run(case: Case) -> Trajectory:
    return run_estimated(case.engine, case.scene, case.times, case.setting, case.time_limit)


def _pictured(case: Case, trajectory: Trajectory) -> Record:
    """Return the record of a run without the fields that no picture needs."""
    record = {name: value for name, value in record_of(case, trajectory).items() if name not in DROPPED}
    return {**record, "bodies": shortened(record["bodies"])}


def shortened(bodies: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, list[list[float]]]]:
    """Return the bodies' poses, rounded to DIGITS digits relative to the largest position and orientation."""
    largest = {key: max(np.abs(body[key]).max(initial=0.0) for body in bodies.values()) for key in POSES}
    return {name: {key: _rounded(body[key], largest[key]) for key in POSES} for name, body in bodies.items()}


def _rounded(values: Any, largest: float) -> list[list[float]]:
    places = DIGITS - int(np.ceil(np.log10(largest))) if largest else DIGITS
    rounded: list[list[float]] = np.round(np.array(values, dtype=float), places).tolist()
    return rounded
