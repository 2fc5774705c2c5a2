"""A run by Taylor series in Python: its memory, and the loop over calls of the kernels that take steps, cross
singular positions and complete samples."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from mbref.equations.packing import Packs
from mbref.kernels.layout import OK, SINGULAR_AHEAD
from mbref.kernels.machine_code import NoGeneratedCode
from mbref.kernels.memory_pool import release, write_record
from mbref.stepping.limits import AUTO, GENERATED
from mbref.stepping.loop import DONE, PAUSED, UNDECIDED
from mbref.stepping.pace import Pace
from mbref.stepping.run import Run
from mbref.taylor.batch_equations import equations_of_all
from mbref.taylor.crossing.branches import BranchFollower
from mbref.taylor.crossing.thresholds import START_ERROR
from mbref.taylor.driven import follow_drivers
from mbref.taylor.geometry import equations_of
from mbref.taylor.mode import REGULAR
from mbref.taylor.sample_completion import complete_samples
from mbref.taylor.series_memory import acquire_memory, put_equations
from mbref.taylor.series_options import rest_speed, series_options
from mbref.taylor.stepping import advance_series, enter_series

# expected steps above which generated code saves more time than its generation takes
STEPS_WORTH_CODE = 20_000
AT_END = 1e-6  # distance of a singular position from the end of a run / end, below which it is at the end
PAST_END = 0.05  # share of the time by which such a run goes beyond its end


class SeriesStepper:
    """The steps of one run in Taylor series, across singular positions."""

    def __init__(self, run: Run):
        self.run = run
        self._pace = Pace(run)
        self._decide_rank()
        self._options = series_options(run)
        self._take = follow_drivers if self._options.follows_drivers else advance_series
        self._take.prepare()  # before the clock of the run
        parts = self._moving.tobytes(), bool(self._options.follows_drivers)
        self.geometry, self.polynomials = run.model.once(equations_of, *parts)
        self._pooled = acquire_memory(run, self.geometry, self.polynomials, self._options.accurate_order)
        self.taylor, self.argument = self._pooled.values, self._pooled.packed.argument
        self._calls, self._sampling = 0, 0.0  # calls that advance the run; s of CPU time for samples
        self.ahead = 0.0
        self._put_options()
        self._branches = BranchFollower(run, self.taylor, self.argument, self.expand)
        self._wants_code = run.limits.code == AUTO
        if run.limits.code == GENERATED:
            self._put_code()

    def _decide_rank(self) -> None:
        """Set the rank tolerance so that elimination and singular values at the start count equal ranks."""
        settings, (_, least, rounding) = self.run.memory.equations.system.settings, self.run.ranks
        if settings.nearly_dependent:
            settings.rank_tolerance = (least * max(rounding, np.finfo(float).eps)) ** 0.5

    @property
    def _moving(self) -> np.ndarray:
        """Return which velocities (n,) can be other than zero."""
        moving = np.zeros(self.run.model.n, dtype=bool)
        moving[self.run.memory.active.velocities] = True
        return moving

    def release(self) -> None:
        """Release the memory for another run; results of this run must not be read afterwards."""
        release(self._pooled)

    def _put_options(self) -> None:
        """Put the options of the series into memory."""
        write_record(self.taylor.options, self._options)
        self.taylor.progress.end = self.run.times[-1]
        mode, options = self.taylor.mode, self._options
        mode.kind, mode.tolerance, mode.order = REGULAR, options.regular_tolerance, options.regular_order
        # the signs of its quaternions are continued
        self.run.memory.previous.coordinates[:] = self.run.start.q

    @property
    def was_short(self) -> bool:
        """Return whether one call of kernels completed the run."""
        return self._calls == 1

    def begin_again(self) -> None:
        """Reset the memory of the stepper to the start of the run."""
        self._pooled.restore()
        put_equations(self.taylor, self.geometry, self.polynomials)
        self._put_options()
        self._decide_rank()

    def parameters(
        self, packs: Packs, q: np.ndarray, places: Sequence[int]
    ) -> tuple[list[tuple[Any, ...]], list[int]]:
        """Return (target array, values for each scene) for numbers that differ between the scenes, and the
        indices of scenes whose equations have the structure of the equations in memory."""
        follows_drivers = bool(self._options.follows_drivers)
        varied, alike = equations_of_all(packs, q, places, self._moving, follows_drivers, self.taylor)
        distances = START_ERROR * np.maximum(1.0, packs.length)
        own = [(distances, "start_distance")]
        if self._options.rest_speed > 0.0:
            until, pairs = self.run.times[-1], zip(packs.scenes, packs.length, strict=True)
            own.append((np.array([rest_speed(*pair, until) for pair in pairs]), "rest_speed"))
        return [*((self.taylor.options, *entry) for entry in own), *varied], alike

    def advance_once(self) -> tuple[int, float]:
        """Advance by one call of kernels; return the status, and the process CPU time of the stepping alone
        (s)."""
        began = time.process_time()
        status = self.take_steps()
        seconds = time.process_time() - began
        self._branches.record()
        return self._status_with_samples(status, go_on=False), seconds

    def advance(self, progress: Callable[[float], None] | None) -> tuple[int, float]:
        """Run to the end; return the final status and the process CPU time of the stepping alone (s)."""
        status, seconds = self._advance(progress)
        if status == UNDECIDED and self._ends_at_position:
            status, more = self._cross_at_end(progress)
            seconds += more
        return status, seconds

    @property
    def _ends_at_position(self) -> bool:
        """Return whether the run ends at the singular position ahead, or shortly before it."""
        clock, end = self.run.memory.loop.clock, self.run.times[-1]
        return bool(self.ahead and abs(clock.time + self.ahead - end) <= AT_END * end)

    def _cross_at_end(self, progress: Callable[[float], None] | None) -> tuple[int, float]:
        """Run again to an end beyond the singular position at the end; return status and time as ``advance``.

        No step is short enough to end next to a singular position, but a step across it has the samples
        before it.
        """
        run, clock, end = self.run, self.run.memory.loop.clock, float(self.run.times[-1])
        run.begin_again()
        self.begin_again()
        run.crossings, self.taylor.progress.end = [], (1 + PAST_END) * end
        status, seconds = self._advance(progress)
        if clock.sample < len(run.times):
            return status, seconds
        run.crossings = [passed for passed in run.crossings if passed.time <= end]
        run.memory.equations.system.counts.crossings, clock.time = len(run.crossings), end
        return DONE, seconds

    def _advance(self, progress: Callable[[float], None] | None) -> tuple[int, float]:
        """Run to the end of the memory once, as ``advance``."""
        making, began = self.run.making, time.process_time()
        status = self._branches.leave_start()
        if self._branches.begins_at_branches:
            status = self._begin_again(status)
        while status == PAUSED:
            status = self.take_steps()
            if status == DONE:
                break
            self._branches.record()
            if status == SINGULAR_AHEAD:
                status = self._begin_again(self._branches.cross())
            elif self._branches.leaves_branch:
                status = self._begin_again(self._branches.take_branch())
            else:
                status = self._complete_samples(status, go_on=status == PAUSED)
            status = self._pace.judge(status)
            if status == PAUSED:
                self._generate_where_it_pays()
            if progress is not None:
                progress(float(self.run.memory.loop.clock.time))
        seconds = time.process_time() - began - self._sampling - (self.run.making - making)
        self._branches.record()
        if progress is not None and status == DONE:
            progress(float(self.run.memory.loop.clock.time))
        return self._complete_samples(status, go_on=False), seconds

    def take_steps(self) -> int:
        """Take the steps of one call; return PAUSED, DONE at the end, or the failure status."""
        self._calls += 1
        status = int(self._take(self.argument))
        self.ahead = float(self.taylor.distance.time_to_crossing) if status == UNDECIDED else 0.0
        return status

    def expand(self) -> int:
        """Expand at the present time and state, for steps until the end; return OK or the failure status."""
        return int(enter_series(self.argument))

    def _begin_again(self, status: int) -> int:
        """Complete the samples of a crossing and begin a series after it; return the status."""
        self._calls += 1
        status = self._complete_samples(status, go_on=False)
        return UNDECIDED if status == PAUSED and self.expand() != OK else status

    def _complete_samples(self, status: int, go_on: bool) -> int:
        """Complete the samples of steps; return the status of the steps, or of a failed completion."""
        began = time.process_time()
        status = self._status_with_samples(status, go_on)
        self._sampling += time.process_time() - began
        return status

    def _status_with_samples(self, status: int, go_on: bool) -> int:
        """Complete the samples of steps, without measuring the time."""
        completed = int(complete_samples(int(go_on), self.argument))
        return status if completed == OK or status == UNDECIDED else completed

    def _generate_where_it_pays(self) -> None:
        """Continue with generated code if many steps are ahead."""
        if self._wants_code and self._steps_ahead() >= STEPS_WORTH_CODE:
            self._wants_code = False
            with contextlib.suppress(NoGeneratedCode):  # continue with the generic kernels
                self._put_code()

    def _steps_ahead(self) -> float:
        """Return the number of steps to the end at the mean length so far, or to the limit of steps."""
        run = self.run
        taken, reached = run.memory.equations.system.counts.steps, run.memory.loop.clock.time
        return min(taken * (run.times[-1] / reached - 1.0), run.limits.most_steps - taken)

    def _put_code(self) -> None:
        """Expand the series by generated code from now on; raises NoGeneratedCode if it is not available."""
        began = time.process_time()
        try:
            from mbref.taylor.generated.build import put_code  # optional, and not needed by most runs
        except ModuleNotFoundError:
            raise NoGeneratedCode("the subpackage mbref.taylor.generated is not installed") from None
        self._code = put_code(self.taylor)
        self.run.making += time.process_time() - began
