"""Runs without projection: completed only on the motion that a projected run follows from the same start.

Nothing but the accelerations holds such a run to its branch.  At a singular position they are ill-determined,
and a pseudo-inverse whose rank drops there lets the run go on along another branch with all constraints and
its energy intact.  Beside one, the same happens to a partition whose dependent coordinates jump.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from mbref import rotations
from mbref.equations.initial_state import scene_length
from mbref.method import DEFAULT, Method
from mbref.simulation.limits import GENERIC, Limits
from mbref.simulation.run import Run
from mbref.simulation.stepping import DONE, LEFT_MOTION, UNDECIDED
from mbref.taylor.run import CrossingRun

MOST_STEPS = 100_000
TOLERANCE = 1e-10  # of the projected run
OFF = (1e3, 1e-6)  # lengths or rad by which a run may be off: over its tolerance, and whatever that is
COARSE = 0.1  # the same of a run in fixed steps, whose error its tolerance does not limit


class CheckedRun(Run):
    """One simulation without projection, whose samples are compared with those of the default method."""

    def advance(self, progress: Callable[[float], None] | None) -> tuple[int, float]:
        """Run to the end; the final status and the process CPU time of the stepping alone (s)."""
        status, seconds = super().advance(progress)
        if self.memory.loop.clock.sample and self.model.closed_loops > 0 and self.limits.compared:
            began = time.process_time()
            status = self._checked(status)
            self.making += time.process_time() - began
        return status, seconds

    def _checked(self, ended: int) -> int:
        """The status of a run that ended with another one, compared up to there.

        LEFT_MOTION where it left the motion, whose samples end there; UNDECIDED, at the time of the clock,
        where the projected run does not tell a branch of a run that is DONE; else as it was.
        """
        limits = Limits(rtol=TOLERANCE, code=GENERIC, most_steps=MOST_STEPS)
        projected = CrossingRun(self.scene, Method.parse(DEFAULT), self.times, limits)
        status, _ = projected.advance(None)
        theirs, clock = projected.memory.loop.clock, self.memory.loop.clock
        off = self._distances(projected, min(int(theirs.sample), int(clock.sample)))
        if (off > self._allowed).any():
            clock.sample = np.argmax(off > self._allowed)
            clock.time = self.times[clock.sample]
            return LEFT_MOTION
        if ended != DONE or status != UNDECIDED:
            return ended
        clock.time = theirs.time
        return UNDECIDED

    @property
    def _allowed(self) -> float:
        rtol = float(self.memory.control.rtol)
        return max(OFF[0] * rtol, OFF[1]) if self.method.integrator.adaptive else COARSE

    def _distances(self, other: Run, samples: int) -> np.ndarray:
        """The largest distance (k,) of a body at each of the first samples: over the length, or rad."""
        mine, theirs = (run.memory.loop.samples.coordinates[:samples] for run in (self, other))
        mine, theirs = (q.reshape(samples, self.model.nb, 7) for q in (mine, theirs))
        places = np.linalg.norm(mine[..., :3] - theirs[..., :3], axis=-1) / scene_length(self.model)
        turns = rotations.angle_between(mine[..., 3:], theirs[..., 3:])
        return np.maximum(places, turns).max(axis=-1, initial=0.0)
