"""The steps of a run by an explicit integrator, in the compiled loop."""

from __future__ import annotations

import time
from collections.abc import Callable

from mbref.kernels.layout import SINGULAR_AHEAD
from mbref.stepping.leaving import begins_on_singular_position
from mbref.stepping.loop import PAUSED, advance_to_end
from mbref.stepping.pace import Pace
from mbref.stepping.ranks import ranks_at
from mbref.stepping.run import NEARLY, Run


class ExplicitStepper:
    """The steps of one run by the kernels of its method."""

    ahead = 0.0  # unknown: explicit steps do not look ahead

    def __init__(self, run: Run):
        self.run = run
        self._pace = Pace(run)
        clock, enter = run.memory.loop.clock, run.method.stabilisation.enter.callable
        clock.y_size = enter(clock.time, run.memory.loop.y, run.packed.argument)
        clock.restart = run.memory.equations.system.counts.steps

    def advance(self, progress: Callable[[float], None] | None) -> tuple[int, float]:
        """Run to the end; return the final status and the process CPU time of the stepping alone (s)."""
        began, status = time.process_time(), PAUSED
        if self.run.times[-1] > 0.0 and begins_on_singular_position(self.run):
            status = SINGULAR_AHEAD
        while status == PAUSED:
            status = self._pace.judge(int(advance_to_end(self.run.packed.argument)))
            self._look_at_rows_again()
            if progress is not None:
                progress(float(self.run.memory.loop.clock.time))
        return status, time.process_time() - began

    def release(self) -> None:
        """Release no memory: the stepper has none of its own."""

    def _look_at_rows_again(self) -> None:
        """Clear the mark of nearly dependent rows once the run has left the start and the rows are
        independent."""
        run, memory = self.run, self.run.memory
        settings = memory.equations.system.settings
        if run.method.stabilisation.projects and settings.nearly_dependent and memory.loop.clock.time > 0.0:
            ranks = ranks_at(
                run.model, memory.state.coordinates, memory.factor.symbolic, run.limits.rank_tolerance
            )
            settings.nearly_dependent = ranks.rank != run.ranks.rank or ranks.least < NEARLY
