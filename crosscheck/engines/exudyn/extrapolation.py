"""Richardson's extrapolation of Exudyn's runs to h = 0, restarted after singular positions.

The trapezoidal rule with index-2 constraints has an error that is even in the step h, as long as steps end at
regular positions; a step that ends near a singular position fails. If a run fails, all runs stop before a
window around the failure. The states are extrapolated across the window, and the runs restart after it. All
numbers of steps are even: the multipliers have an error that changes its sign from step to step. The
functions take the exudyn module and do not import it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from functools import partial
from typing import Any

import numpy as np

from crosscheck.engines.exudyn.dynamic import (
    Configure,
    Ending,
    Motion,
    Samples,
    Solver,
    State,
    finite,
    step_count,
)
from crosscheck.engines.exudyn.singular_crossing import extrapolated_states
from mbref.motions.trajectory import Cost
from mbref.scene import Scene

RICHARDSON = {4: 64 / 45, 2: -20 / 45, 1: 1 / 45}  # divisor of the step: weight; cancels h² and h⁴
BEFORE, BEHIND = 2.0, 2.0  # distances of the ends of the window from the failure, in steps
NODES = 12  # states before the singular position from which the states after it are extrapolated
BESIDE = 0.05  # fraction of the node spacing: a node nearer to a sample is moved to it
APART = 6.0  # distance between two states, in steps, unless the window of the last crossing ends nearer


def extrapolate(exu: Any, scene: Scene, times: np.ndarray, step: float, configure: Configure) -> Motion:
    """Return the motion at ``times`` (k,), extrapolated to h = 0 from runs with steps h, h/2 and h/4; h is at
    most ``step`` (s).

    Positions, Euler parameters (normalised when they are read), their rates and the joint sensors' outputs
    are extrapolated.
    """
    return _ExtrapolatedRuns(exu, scene, step, configure).through(np.asarray(times, dtype=float))


class _ExtrapolatedRuns:
    """Three runs, finest first since it is the first to fail; all runs start from the extrapolated
    ``state``."""

    def __init__(self, exu: Any, scene: Scene, step: float, configure: Configure):
        self.scene, self.step, self.configure = scene, step, configure
        self.solvers = [Solver(exu, scene) for _ in RICHARDSON]
        self.state = self.solvers[0].state()
        self.pieces: list[Samples] = []

    def through(self, times: np.ndarray) -> Motion:
        """Return the motion at ``times``, or at the times that the runs reached."""
        ending = None
        while times.size and (ending := self.advance(times, times)[1]):
            if (nodes := self.approach(times, ending)) is None:
                break
            self.cross(times, nodes, nodes[0][-1] + (BEFORE + BEHIND) * self.step)
            ending, times = None, times[times > self.state.t]
        return self.motion(ending)

    def approach(self, times: np.ndarray, ending: Ending) -> Samples | None:
        """Take the samples up to the window around the first failure; returns the nodes before it.

        The result is None if fewer samples than nodes of interpolation lie before the window: such an early
        failure is not taken for a singular position.
        """
        while True:
            start = ending.t - BEFORE * self.step
            spacing = min(APART * self.step, (start - self.state.t) / NODES)
            if spacing < self.step:
                return None
            nodes = _onto(times, start - spacing * np.arange(NODES)[::-1], spacing)
            found, earlier = self.advance(np.union1d(times[times < start], nodes), times)
            if earlier is None:
                return _at(found, nodes)
            ending = earlier

    def advance(self, to: np.ndarray, times: np.ndarray) -> tuple[Samples, Ending | None]:
        """Take samples at ``to``, and keep those at ``times``.

        If a run fails, nothing changes and the samples of the failed run are returned.
        """
        runs = []
        for solver, divisor in zip(self.solvers, RICHARDSON, strict=True):
            solver.put(self.state)
            run, ending = solver.run(to, partial(_even_steps, self.step, divisor), self.configure)
            if ending:
                self.pieces.append(_at(run, times[:0]))  # defines the sizes of the arrays
                return run, ending
            runs.append(run)
        found = (to, _limit([run[1] for run in runs]), _limit([run[2] for run in runs]))
        self.pieces.append(_at(found, times))
        self.arrive(found)
        return found, None

    def cross(self, times: np.ndarray, nodes: Samples, end: float) -> None:
        """Cross the window to ``end`` (s), and take the samples inside it."""
        within = times[(times > self.state.t) & (times < end)]
        landed = extrapolated_states(self.scene, nodes, np.append(within, end))
        self.pieces.append(_at(landed, times))
        self.arrive(landed)

    def arrive(self, samples: Samples) -> None:
        """Make the last sample the present state of all runs."""
        times, values, _ = samples
        data = self.solvers[-1].state().data  # the data variables count turns only
        self.state = State(float(times[-1]), values[0, -1].ravel(), values[1, -1].ravel(), data)

    def motion(self, ending: Ending | None) -> Motion:
        """Return all samples, with the outcome of the run that ended early."""
        costs = [solver.cost() for solver in self.solvers]
        cost = Cost(*(sum(getattr(c, item.name) for c in costs) for item in fields(Cost)))
        times, coordinates, forces = (
            np.concatenate(parts, axis)
            for axis, parts in zip((0, 1, 0), zip(*self.pieces, strict=True), strict=True)
        )
        ended = (ending.outcome, ending.message) if ending else ()
        return finite(Motion(times, coordinates, forces, cost, self.state.t, *ended))


def _even_steps(step: float, divisor: int, interval: float) -> int:
    """Return an even number of steps that fill an interval (s), none longer than ``step`` (s) over the
    divisor."""
    return 2 * divisor * step_count(interval, 2 * step)


def _limit(results: Sequence[np.ndarray]) -> np.ndarray:
    """Return Richardson's limit h → 0 of arrays from the runs with the divisors of RICHARDSON."""
    weighted = [weight * result for weight, result in zip(RICHARDSON.values(), results, strict=True)]
    return np.sum(weighted, axis=0)


def _onto(times: np.ndarray, nodes: np.ndarray, spacing: float) -> np.ndarray:
    """Return the nodes; a node next to a sample time is moved to that time."""
    nearest = times[np.abs(times[:, None] - nodes).argmin(axis=0)]
    return np.where(np.abs(nearest - nodes) < BESIDE * spacing, nearest, nodes)


def _at(samples: Samples, times: np.ndarray) -> Samples:
    """Return the samples that are at one of ``times``."""
    kept = np.isin(samples[0], times)
    return samples[0][kept], samples[1][:, kept], samples[2][kept]
