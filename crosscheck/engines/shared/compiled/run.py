"""A run whose stepping is a single call of compiled code, from the first sample to the last."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from crosscheck.engines.shared.compiled import dop853, newton
from crosscheck.engines.shared.sampling import Counts, Failed, Sample, run_through
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import Scene

MOST_STEPS = 10**6
ENDS = {  # status code → outcome and sentence
    dop853.NOT_FINITE: (Outcome.NOT_FINITE, "the motion is not finite after {t:.6g} s"),
    dop853.TOO_SMALL: (Outcome.STEP_FAILED, "no step after {t:.6g} s is short enough for the tolerance"),
    dop853.TOO_MANY: (Outcome.STEP_FAILED, "{steps} steps have only reached {t:.6g} s"),
    dop853.REFUSED: (Outcome.STEP_FAILED, "the engine gives no accelerations after {t:.6g} s"),
    newton.NOT_MET: (Outcome.NOT_CONVERGED, "the closures could not be met after {t:.6g} s"),
}

System = dop853.System | newton.System


def prepare() -> None:
    """Compile the integrators, or load them from their cache."""
    places = np.zeros(0, dtype=np.int64)
    for system in (dop853.System(0, 0, places, 1.0, 1.0, 1.0, 1.0, 0, 0), newton.System(0, 0, 1.0, 1.0)):
        _stepped(system, np.zeros(0), np.zeros((0, 2)), dop853.memory(np.zeros(2)))


def trajectory(
    scene: Scene,
    times: np.ndarray,
    system: System,
    y: np.ndarray,
    load: Callable[[float, np.ndarray], None],
    sample: Callable[[float], Sample],
    built: float,
    labels: dict[str, Any],
) -> Trajectory:
    """Return the trajectory from a state (n,); ``load`` puts a state at its time into the engine's data."""
    memory, samples = dop853.memory(y), np.zeros((len(times), len(y)))
    times = np.ascontiguousarray(times, dtype=float)
    start = time.process_time()
    status, reached = _stepped(system, times, samples, memory)
    seconds = time.process_time() - start
    counts = Counts(*(int(count) for count in memory.counts))
    places = {float(t): k for k, t in enumerate(times)}

    def advance(_: float, target: float) -> None:
        if places[target] >= reached:
            raise _failure(status, float(memory.clock[0]), counts)
        load(target, samples[places[target]])

    load(0.0, y)
    found = run_through(scene, times, advance, sample, counts, built, labels)
    return replace(found, cost=replace(found.cost, seconds=seconds))


def _stepped(system: System, times: np.ndarray, samples: np.ndarray, memory: dop853.Memory) -> Any:
    """Return the status of the stepping, and the number of samples reached."""
    stepper = dop853 if isinstance(system, dop853.System) else newton
    return stepper.integrate(system, times, samples, memory)


def _failure(status: int, t: float, counts: Counts) -> Failed:
    outcome, sentence = ENDS[status]
    return Failed(outcome, t, sentence.format(t=t, steps=counts.steps))
