"""Richardson's extrapolation of Exudyn's runs to h = 0, restarted after singular positions.

The trapezoidal rule with index-2 constraints has an error that is even in the step h, as long as steps end
at regular positions; a step that ends beside a singular one fails.  Where a run fails, all runs are taken up
to a window about the failure, which is crossed by extrapolation of the states, and start again behind it.
All numbers of steps are even: the multipliers have an error that changes its sign from step to step.
The functions take the exudyn module and do not import it.
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
from mbref.scene import Scene
from mbref.trajectory import Cost

RICHARDSON = {4: 64 / 45, 2: -20 / 45, 1: 1 / 45}  # divisor of the step: weight; cancels h² and h⁴
BEFORE, BEHIND = 2.0, 2.0  # steps from the failure to the ends of the window that is crossed
NODES = 12  # states that the extrapolation across the window takes
BESIDE = 0.05  # fraction of the node spacing: a node nearer to a sample is moved to it
APART = 6.0  # steps between them, where the last crossing does not end nearer


def extrapolate(exu: Any, scene: Scene, times: np.ndarray, step: float, configure: Configure) -> Motion:
    """Runs with h, h/2, h/4, h at most ``step`` (s), extrapolated to h = 0 at ``times`` (k,).

    Positions, Euler parameters (normalised when they are read), their rates and the joint sensors' outputs
    are extrapolated.
    """
    return _ExtrapolatedRuns(exu, scene, step, configure).through(np.asarray(times, dtype=float))


class _ExtrapolatedRuns:
    """Three solvers, finest first as it is the first to fail; all start from the same, extrapolated
    ``state``."""

    def __init__(self, exu: Any, scene: Scene, step: float, configure: Configure):
        self.scene, self.step, self.configure = scene, step, configure
        self.solvers = [Solver(exu, scene) for _ in RICHARDSON]
        self.state = self.solvers[0].state()
        self.pieces: list[Samples] = []

    def through(self, times: np.ndarray) -> Motion:
        """The motion at ``times``, or as far as it got."""
        ending = None
        while times.size and (ending := self.advance(times, times)[1]):
            if (nodes := self.approach(times, ending)) is None:
                break
            self.cross(times, nodes, nodes[0][-1] + (BEFORE + BEHIND) * self.step)
            ending, times = None, times[times > self.state.t]
        return self.motion(ending)

    def approach(self, times: np.ndarray, ending: Ending) -> Samples | None:
        """Takes the samples up to the window about the first failure, and returns the nodes before it; None
        where there is no room for them: then the failure is no passing one."""
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
        """Samples at ``to``, of which those at ``times`` are kept; where a run fails nothing has changed, and
        the samples belong to the run that failed."""
        runs = []
        for solver, divisor in zip(self.solvers, RICHARDSON, strict=True):
            solver.put(self.state)
            run, ending = solver.run(to, partial(_even_steps, self.step, divisor), self.configure)
            if ending:
                self.pieces.append(_at(run, times[:0]))  # shows the sizes
                return run, ending
            runs.append(run)
        found = (to, _limit([run[1] for run in runs]), _limit([run[2] for run in runs]))
        self.pieces.append(_at(found, times))
        self.arrive(found)
        return found, None

    def cross(self, times: np.ndarray, nodes: Samples, end: float) -> None:
        """Crosses the window to ``end`` (s), with the samples on the way."""
        within = times[(times > self.state.t) & (times < end)]
        landed = extrapolated_states(self.scene, nodes, np.append(within, end))
        self.pieces.append(_at(landed, times))
        self.arrive(landed)

    def arrive(self, samples: Samples) -> None:
        """Makes the last of the samples the present state."""
        times, values, _ = samples
        data = self.solvers[-1].state().data  # the data variables only count turns
        self.state = State(float(times[-1]), values[0, -1].ravel(), values[1, -1].ravel(), data)

    def motion(self, ending: Ending | None) -> Motion:
        """The samples so far, with the outcome of the run that ended early."""
        costs = [solver.cost() for solver in self.solvers]
        cost = Cost(*(sum(getattr(c, item.name) for c in costs) for item in fields(Cost)))
        times, coordinates, forces = (
            np.concatenate(parts, axis)
            for axis, parts in zip((0, 1, 0), zip(*self.pieces, strict=True), strict=True)
        )
        ended = (ending.outcome, ending.message) if ending else ()
        return finite(Motion(times, coordinates, forces, cost, self.state.t, *ended))


def _even_steps(step: float, divisor: int, interval: float) -> int:
    """An even number of steps, none longer than ``step`` (s) over the divisor, that fill an interval (s)."""
    return 2 * divisor * step_count(interval, 2 * step)


def _limit(results: Sequence[np.ndarray]) -> np.ndarray:
    """Richardson's limit h → 0 of an array's values by the runs with the divisors of RICHARDSON."""
    weighted = [weight * result for weight, result in zip(RICHARDSON.values(), results, strict=True)]
    return np.sum(weighted, axis=0)


def _onto(times: np.ndarray, nodes: np.ndarray, spacing: float) -> np.ndarray:
    """The nodes, where one is next to a sample time that very time."""
    nearest = times[np.abs(times[:, None] - nodes).argmin(axis=0)]
    return np.where(np.abs(nearest - nodes) < BESIDE * spacing, nearest, nodes)


def _at(samples: Samples, times: np.ndarray) -> Samples:
    """Return the samples that are at one of ``times``."""
    kept = np.isin(samples[0], times)
    return samples[0][kept], samples[1][:, kept], samples[2][kept]
