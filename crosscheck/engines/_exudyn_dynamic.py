"""Exudyn's implicit solvers over the sample times: single runs and their extrapolation to h = 0.

The functions take the exudyn module and do not import it.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from crosscheck.engines._exudyn_model import System, build
from mbref.scene import Scene
from mbref.trajectory import Cost, Outcome

RICHARDSON = {1: 1 / 45, 2: -20 / 45, 4: 64 / 45}  # divisor of the step: weight; cancels h² and h⁴
SAME = 1e-12  # relative to the end time: sample times nearer than this are the same

Configure = Callable[[Any, Any, bool], Any]  # (exudyn, simulation settings, singular) -> solver type


@dataclass(frozen=True)
class Motion:
    """Node coordinates (3, k, nb, 7) at times (k,): values, rates, second rates; and how it ended.

    ``forces`` (k, ·) are the outputs of the joints' sensors, None where there are none.
    """

    times: np.ndarray
    coordinates: np.ndarray
    forces: np.ndarray | None
    cost: Cost
    t_end: float  # the last time the solver accepted
    outcome: Outcome = Outcome.COMPLETED
    message: str = ""


def integrate(
    exu: Any, scene: Scene, times: np.ndarray, step: float, configure: Configure, divisor: int = 1
) -> Motion:
    """One run whose time steps are the ``divisor``-th part of steps of at most ``step`` (s) that fill the
    sample intervals; ``configure`` chooses the solver and its settings."""
    clock = time.process_time()
    system = build(exu, scene, forces=True)
    built = time.process_time() - clock
    pieces, ended, seconds, counts = [], (Outcome.COMPLETED, ""), 0.0, np.zeros(3, dtype=int)
    for start, end, intervals in stretches(times):
        settings = exu.SimulationSettings()
        kind = configure(exu, settings, bool(system.redundant or scene.driver))
        _cover(settings, start, end, intervals, divisor * step_count((end - start) / intervals, step))
        clock = time.process_time()
        try:
            system.mbs.SolveDynamic(settings, solverType=kind, updateInitialValues=True)
        except (exu.SolverError, exu.InternalError) as failure:
            ended = _failure(system, failure)
        seconds += time.process_time() - clock
        counts += _counts(system)
        pieces.append(system.samples())
        if ended[0] is not Outcome.COMPLETED:
            break
    samples = _join(times, pieces, complete=ended[0] is Outcome.COMPLETED)
    steps, factorisations, newton = map(int, counts)
    cost = Cost(seconds, built, steps=steps, factorisations=factorisations, newton=newton)
    return finite(Motion(*samples, cost, _accepted(system), *ended))


def extrapolate(exu: Any, scene: Scene, times: np.ndarray, step: float, configure: Configure) -> Motion:
    """Richardson extrapolation of runs with h, h/2, h/4 for a method whose error is even in h.

    Positions, Euler parameters (normalised when they are read), their rates and the joint sensors'
    outputs are extrapolated; the samples are those that all three runs reached.
    """
    runs = [integrate(exu, scene, times, step, configure, divisor) for divisor in RICHARDSON]
    k = min(len(run.times) for run in runs)
    weighted = list(zip(RICHARDSON.values(), runs, strict=True))
    failed = next((run for run in runs if run.outcome is not Outcome.COMPLETED), runs[-1])
    return replace(
        failed,
        times=times[:k],
        coordinates=sum(weight * run.coordinates[:, :k] for weight, run in weighted),
        forces=sum(weight * run.forces[:k] for weight, run in weighted),
        cost=Cost(*(sum(getattr(run.cost, item.name) for run in runs) for item in fields(Cost))),
    )


def finite(motion: Motion) -> Motion:
    """The motion, up to the first sample that is not finite."""
    good = np.isfinite(motion.coordinates).all(axis=(0, 2, 3))
    if good.all():
        return motion
    k = int(np.argmin(good))
    message = f"the state at t = {motion.times[k]:g} s is not finite"
    return replace(
        motion, times=motion.times[:k], coordinates=motion.coordinates[:, :k],
        forces=None if motion.forces is None else motion.forces[:k],
        t_end=float(motion.times[k - 1]) if k else 0.0, outcome=Outcome.NOT_FINITE, message=message,
    )  # fmt: skip


def said(failure: Exception) -> str:
    """What an Exudyn exception says, on one line."""
    return " ".join(re.sub(r"\[Python file .*?\]", "", str(failure)).split())


def stretches(times: np.ndarray) -> Iterator[tuple[float, float, int]]:
    """(start, end, intervals) of the stretches of equally spaced samples, from t = 0 to the last time."""
    points = np.concatenate([[0.0], times[times > 0]])
    tolerance = SAME * points[-1]
    first = 0
    while first < len(points) - 1:
        spacing = points[first + 1] - points[first]
        expected = points[first] + spacing * np.arange(len(points) - first)
        apart = np.flatnonzero(abs(points[first:] - expected) > tolerance)
        last = first + int(apart[0]) - 1 if apart.size else len(points) - 1
        yield float(points[first]), float(points[last]), last - first
        first = last


def step_count(interval: float, step: float) -> int:
    """Equal steps of at most ``step`` that fill an interval."""
    return max(1, math.ceil(interval / step * (1 - 1e-9)))


def _cover(settings: Any, start: float, end: float, intervals: int, steps: int) -> None:
    """Equal intervals between samples, each of so many steps."""
    settings.timeIntegration.startTime = start
    settings.timeIntegration.endTime = end
    settings.timeIntegration.numberOfSteps = intervals * steps
    settings.solution.sensors.writePeriod = (end - start) / intervals
    settings.solution.file.write = False


def _accepted(system: System) -> float:
    """The time (s) of the last step that the solver accepted."""
    it = system.mbs.sys["dynamicSolver"].it
    done = system.mbs.sys["dynamicSolver"].output.finishedSuccessfully
    return float(it.currentTime if done else it.currentTime - it.currentStepSize)


def _failure(system: System, failure: Exception) -> tuple[Outcome, str]:
    """The outcome of a failed solve and a sentence, from the solver's own flags."""
    solver = system.mbs.sys["dynamicSolver"]
    flags, where = solver.conv, f"at t = {solver.it.currentTime:g} s"
    if "not factorized" in str(failure) or flags.linearSolverFailed or flags.massMatrixNotInvertible:
        return Outcome.SINGULAR_MATRIX, f"singular system matrix {where}: {said(failure)}"
    if not flags.newtonConverged:
        return Outcome.NOT_CONVERGED, f"Newton's method stopped {where} with residual {flags.residual:.3g}"
    return Outcome.STEP_FAILED, f"{solver.GetErrorString()} {where}"


def _counts(system: System) -> np.ndarray:
    """Steps, Jacobian factorisations and Newton iterations of the last run."""
    it = system.mbs.sys["dynamicSolver"].it
    return np.array([it.currentStepIndex - 1, it.newtonJacobiCount, it.newtonStepsCount])


Samples = tuple[np.ndarray, np.ndarray, np.ndarray]  # times (k,), coordinates (3, k, nb, 7), forces (k, ·)


def _join(times: np.ndarray, pieces: Sequence[Samples], complete: bool) -> Samples:
    """The wanted samples out of what the stretches recorded (each repeats its start)."""
    recorded, values, forces = (
        np.concatenate([part if n == 0 else np.delete(part, 0, axis) for n, part in enumerate(parts)], axis)
        for axis, parts in zip((0, 1, 0), zip(*pieces, strict=True), strict=True)
    )
    if times[0] > 0:
        recorded, values, forces = recorded[1:], values[:, 1:], forces[1:]
    wanted = times[: len(recorded)]
    shift = wanted - recorded
    spacing = np.diff(times).min(initial=math.inf)
    if abs(shift).max(initial=0.0) > spacing / 2 or (complete and len(wanted) < len(times)):
        raise RuntimeError(f"Exudyn recorded samples at {recorded}, not at {times}")
    return wanted, _moved(values, shift), forces


def _moved(values: np.ndarray, dt: np.ndarray) -> np.ndarray:
    """Samples taken to the wanted times with the recorded rates; halved steps may pass a sample time."""
    dt = dt[:, None, None]
    q, v, a = values
    return np.array([q + dt * v + dt**2 / 2 * a, v + dt * a, a])
