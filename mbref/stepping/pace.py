"""Check of the mean step length: a run whose steps are too short to reach the end is stopped."""

from __future__ import annotations

from mbref.stepping.loop import CREEPING, PAUSED
from mbref.stepping.run import Run

# number of step limits to the end above which a run is stopped, and steps between two checks
OUT_OF_REACH, PACE_STEPS = 100.0, 20_000


class Pace:
    """Mean step length of a run, checked between calls of kernels."""

    def __init__(self, run: Run):
        self._run, self._judged = run, (0.0, 0)  # time (s) and steps at the last check

    def judge(self, status: int) -> int:
        """Return CREEPING instead of PAUSED if the end cannot be reached at the latest mean step length."""
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
