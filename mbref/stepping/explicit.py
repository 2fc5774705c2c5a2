"""The steps of a run by an explicit integrator, in the compiled loop."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from mbref.equations.packing import Packs
from mbref.kernels.layout import SINGULAR_AHEAD, Memory
from mbref.stepping.control import STEPS_PER_CALL
from mbref.stepping.loop import PAUSED, advance_to_end
from mbref.stepping.pace import Pace
from mbref.stepping.ranks import ranks_at
from mbref.stepping.run import NEARLY, Run
from mbref.stepping.singular_start import begins_on_singular_position


class ExplicitStepper:
    """The steps of one run by the kernels of its method."""

    def __init__(self, run: Run):
        self.run = run
        self._pace = Pace(run)
        self.enter()

    def enter(self) -> None:
        """Start from the time of the clock and the state in memory."""
        run = self.run
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

    @property
    def was_short(self) -> bool:
        """True if one call of kernels completed the run."""
        return bool(self.run.memory.equations.system.counts.steps <= STEPS_PER_CALL)

    @property
    def memory(self) -> Memory:
        """All memory that a run changes."""
        return self.run.memory

    def begin_again(self) -> None:
        """Do nothing: the stepper has no memory of its own."""

    def parameters(
        self, packs: Packs, q: np.ndarray, places: Sequence[int]
    ) -> tuple[list[tuple[Any, ...]], list[int]]:
        """Return no numbers, because the stepper has no memory of its own, and all scene indices."""
        return [], [*places]

    def advance_once(self) -> tuple[int, float]:
        """Advance by one call of kernels; return the status, and the process CPU time of the stepping alone
        (s)."""
        began = time.process_time()
        return int(advance_to_end(self.run.packed.argument)), time.process_time() - began

    def _look_at_rows_again(self) -> None:
        """Clear the mark of nearly dependent rows once the run has left the start and the rows are
        independent."""
        run, memory = self.run, self.run.memory
        settings = memory.equations.system.settings
        if run.method.stabilisation.projects and settings.nearly_dependent and memory.loop.clock.time > 0.0:
            ranks = ranks_at(run.model, memory.state.coordinates, memory.factor, run.limits.rank_tolerance)
            settings.nearly_dependent = ranks.rank != run.ranks.rank or ranks.least < NEARLY
