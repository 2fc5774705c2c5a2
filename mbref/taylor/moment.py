"""The state of a run at a moment, to be copied to another run of the same scene."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mbref.simulation.run import Run


class Moment(NamedTuple):
    """The state of a run at a time (s), and the samples taken and the singular positions passed so far."""

    time: float
    sample: int
    crossings: int
    coordinates: np.ndarray
    velocities: np.ndarray
    angles: np.ndarray


def moment_of(run: Run) -> Moment:
    """A copy of the present state of a run."""
    state, clock, equations = run.memory.state, run.memory.loop.clock, run.memory.equations
    arrays = (state.coordinates, state.velocities, equations.angles)
    crossings = int(equations.system.counts["crossings"])
    return Moment(float(clock["time"]), int(clock["sample"]), crossings, *(a.copy() for a in arrays))


def enter(moment: Moment, run: Run) -> None:
    """Bring a run of the same scene to a state."""
    state, clock, equations = run.memory.state, run.memory.loop.clock, run.memory.equations
    clock["time"], clock["sample"] = moment.time, moment.sample
    equations.system.counts["crossings"] = moment.crossings
    state.coordinates[:], state.velocities[:] = moment.coordinates, moment.velocities
    equations.angles[:] = moment.angles
