"""Runs of Exudyn's implicit solvers from sample to sample.

The functions take the exudyn module and do not import it.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from crosscheck.engines.exudyn.model import System, build
from mbref.motions.trajectory import Cost, Outcome
from mbref.scene import Scene

SAME = 1e-12  # fraction of the end time: sample times nearer to each other count as equal

Configure = Callable[[Any, Any, bool], Any]  # (exudyn, simulation settings, singular) -> solver type


Samples = tuple[np.ndarray, np.ndarray, np.ndarray]  # times (k,), coordinates (3, k, nb, 7), forces (k, ·)


class State(NamedTuple):
    """State of a system at time t (s): node coordinates (nb * 7,), their rates, and data coordinates."""

    t: float
    coordinates: np.ndarray
    rates: np.ndarray
    data: np.ndarray


class Ending(NamedTuple):
    """End of a solver's run: the time t (s), the outcome, and a sentence."""

    t: float
    outcome: Outcome
    message: str


@dataclass(frozen=True)
class Motion:
    """Node coordinates (3, k, nb, 7) at times (k,): values, rates, second rates; and how the run ended.

    ``forces`` (k, ·) are the outputs of the joints' sensors, None if the system has no such sensors.
    """

    times: np.ndarray
    coordinates: np.ndarray
    forces: np.ndarray | None
    cost: Cost
    t_end: float  # last time that the solver accepted
    outcome: Outcome = Outcome.COMPLETED
    message: str = ""


class Solver:
    """An Exudyn system and its implicit solvers; ``now`` (s) is the time of the present state."""

    def __init__(self, exu: Any, scene: Scene):
        clock = time.process_time()
        self.exu = exu
        self.system: System = build(exu, scene, forces=True)
        self.singular = bool(self.system.redundant or scene.driver)
        self.built, self.seconds, self.counts = time.process_time() - clock, 0.0, np.zeros(3, dtype=int)
        self.now = self.reached = 0.0

    def run(
        self, times: np.ndarray, steps: Callable[[float], int], configure: Configure
    ) -> tuple[Samples, Ending | None]:
        """Return samples at increasing ``times`` (k,) s, none before ``now``; fewer samples and the reason if
        the solver stops.

        Sample intervals are filled with ``steps(interval)`` equal steps; ``configure`` chooses the solver.
        """
        pieces, ending = [], None
        for start, end, intervals in stretches(times, self.now):
            settings = self.exu.SimulationSettings()
            kind = configure(self.exu, settings, self.singular)
            _cover(settings, start, end, intervals, steps((end - start) / intervals))
            clock = time.process_time()
            try:
                self.system.mbs.SolveDynamic(settings, solverType=kind, updateInitialValues=True)
            except (self.exu.SolverError, self.exu.InternalError) as failure:
                ending = _failure(self.system, failure)
            self.seconds += time.process_time() - clock
            self.counts += _counts(self.system)
            pieces.append(self.system.samples())
            self.reached = _accepted(self.system)
            if ending:
                break
            self.now = end
        return _join(times, pieces, complete=ending is None), ending

    def cost(self) -> Cost:
        """Return the cost of building the system and of all runs so far."""
        steps, factorisations, newton = map(int, self.counts)
        return Cost(self.seconds, self.built, steps=steps, factorisations=factorisations, newton=newton)

    def state(self) -> State:
        """Return the present state."""
        data, initial = self.system.mbs.systemData, self.exu.ConfigurationType.Initial
        reads = (data.GetODE2Coordinates, data.GetODE2Coordinates_t, data.GetDataCoordinates)
        return State(self.now, *(np.array(read(configuration=initial)) for read in reads))

    def put(self, state: State) -> None:
        """Set the present state."""
        data, initial = self.system.mbs.systemData, self.exu.ConfigurationType.Initial
        data.SetODE2Coordinates(state.coordinates, configuration=initial)
        data.SetODE2Coordinates_t(state.rates, configuration=initial)
        if state.data.size:
            data.SetDataCoordinates(state.data, configuration=initial)
        self.now = state.t


def integrate(exu: Any, scene: Scene, times: np.ndarray, step: float, configure: Configure) -> Motion:
    """Return one run with equal time steps of at most ``step`` (s) that fill the sample intervals."""
    solver = Solver(exu, scene)
    samples, ending = solver.run(times, lambda interval: step_count(interval, step), configure)
    ended = (ending.outcome, ending.message) if ending else ()
    return finite(Motion(*samples, solver.cost(), solver.reached, *ended))


def finite(motion: Motion) -> Motion:
    """Return the motion up to the first sample that is not finite."""
    good = np.isfinite(motion.coordinates).all(axis=(0, 2, 3))
    if good.all():
        return motion
    k = int(np.argmin(good))
    message = f"the state at t = {motion.times[k]:g} s is not finite"
    return replace(
        motion,
        times=motion.times[:k],
        coordinates=motion.coordinates[:, :k],
        forces=None if motion.forces is None else motion.forces[:k],
        t_end=float(motion.times[k - 1]) if k else 0.0,
        outcome=Outcome.NOT_FINITE,
        message=message,
    )


def said(failure: Exception) -> str:
    """Return the text of an Exudyn exception on one line."""
    return " ".join(re.sub(r"\[Python file .*?\]", "", str(failure)).split())


def stretches(times: np.ndarray, begin: float = 0.0) -> Iterator[tuple[float, float, int]]:
    """Return (start, end, number of intervals) of the stretches of equally spaced samples, from ``begin`` (s)
    to the last."""
    points = np.concatenate([[begin], times[times > begin]])
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
    """Return the number of equal steps of at most ``step`` that fill an interval."""
    return max(1, math.ceil(interval / step * (1 - 1e-9)))


def _cover(settings: Any, start: float, end: float, intervals: int, steps: int) -> None:
    """Set equal intervals between samples, each with the given number of steps."""
    settings.timeIntegration.startTime = start
    settings.timeIntegration.endTime = end
    settings.timeIntegration.numberOfSteps = intervals * steps
    settings.solution.sensors.writePeriod = (end - start) / intervals
    settings.solution.file.write = False


def _accepted(system: System) -> float:
    """Return the time (s) of the last step that the solver accepted."""
    it = system.mbs.sys["dynamicSolver"].it
    done = system.mbs.sys["dynamicSolver"].output.finishedSuccessfully
    return float(it.currentTime if done else it.currentTime - it.currentStepSize)


def _failure(system: System, failure: Exception) -> Ending:
    """Return the outcome of a failed run, from the solver's own flags."""
    solver = system.mbs.sys["dynamicSolver"]
    t, flags = solver.it.currentTime, solver.conv
    if "not factorized" in str(failure) or flags.linearSolverFailed or flags.massMatrixNotInvertible:
        return Ending(t, Outcome.SINGULAR_MATRIX, f"singular system matrix at t = {t:g} s: {said(failure)}")
    if not flags.newtonConverged:
        message = f"Newton's method stopped at t = {t:g} s with residual {flags.residual:.3g}"
        return Ending(t, Outcome.NOT_CONVERGED, message)
    return Ending(t, Outcome.STEP_FAILED, f"{solver.GetErrorString()} at t = {t:g} s")


def _counts(system: System) -> np.ndarray:
    """Return steps, Jacobian factorisations and Newton iterations of the last run."""
    it = system.mbs.sys["dynamicSolver"].it
    return np.array([it.currentStepIndex - 1, it.newtonJacobiCount, it.newtonStepsCount])


def _join(times: np.ndarray, pieces: Sequence[Samples], complete: bool) -> Samples:
    """Return the wanted samples from the records of the stretches, each of which repeats its start."""
    recorded, values, forces = (
        np.concatenate([part if n == 0 else np.delete(part, 0, axis) for n, part in enumerate(parts)], axis)
        for axis, parts in zip((0, 1, 0), zip(*pieces, strict=True), strict=True)
    )
    if times[0] > recorded[0]:
        recorded, values, forces = recorded[1:], values[:, 1:], forces[1:]
    wanted = times[: len(recorded)]
    shift = wanted - recorded
    spacing = np.diff(times).min(initial=math.inf)
    if abs(shift).max(initial=0.0) > spacing / 2 or (complete and len(wanted) < len(times)):
        raise RuntimeError(f"Exudyn recorded samples at {recorded}, not at {times}")
    return wanted, _moved(values, shift), forces


def _moved(values: np.ndarray, dt: np.ndarray) -> np.ndarray:
    """Return samples moved to the wanted times with the recorded rates; halved steps may miss a sample
    time."""
    dt = dt[:, None, None]
    q, v, a = values
    return np.array([q + dt * v + dt**2 / 2 * a, v + dt * a, a])
