"""The pace of a run: whether its steps are so short that the end is out of reach."""

from __future__ import annotations

from mbref.stepping.loop import CREEPING, PAUSED
from mbref.stepping.run import Run

OUT_OF_REACH, PACE_STEPS = 100.0, 20_000  # limits of steps that the end is away, at the pace of so many


class Pace:
    """The pace of a run, judged between calls of kernels."""

    def __init__(self, run: Run):
        self._run, self._judged = run, (0.0, 0)  # time (s) and steps when the pace was last judged

    def judge(self, status: int) -> int:
        """Return CREEPING instead of PAUSED where at the last pace the end is out of all reach."""
        if status != PAUSED:
            return status
        memory, limits = self._run.memory, self._run.limits
        now, steps = float(memory.loop.clock.time), int(memory.equations.system.counts.steps)
        before, taken = self._judged[0], steps - self._judged[1]
        if taken < PACE_STEPS:
            return status
        self._judged = now, steps
        creeps = taken * (self._run.times[-1] - now) > OUT_OF_REACH * limits.most_steps * (now - before)
        return CREEPING if creeps else status
