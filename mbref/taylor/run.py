"""Runs whose singular positions are passed by Taylor series: of a method in steps, or in series itself.

Unless drivers prescribe the whole motion, the series are followed twice (``mbref.taylor.twin``): where both
end apart, the motion is not determined.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from mbref.equations.branches import SMOOTH
from mbref.kernels.layout import NOT_CONVERGED, OK
from mbref.method import Method
from mbref.scene import Scene
from mbref.simulation.limits import GENERIC, Limits
from mbref.simulation.ranks import ranks_at
from mbref.simulation.run import NEARLY, Run
from mbref.simulation.singular_start import fits_no_branch, leaving
from mbref.simulation.stepping import DONE, PAUSED, SINGULAR_AHEAD, UNDECIDED
from mbref.taylor.driven import LEAST_ORDER, LOOSE, ORDER, follow_drivers
from mbref.taylor.passing_run import PassingRun
from mbref.taylor.samples import complete_samples
from mbref.taylor.series_run import SeriesRun, order_of


class CrossingRun(Run):
    """One simulation in steps whose passages of singular positions are Taylor series."""

    def __init__(self, scene: Scene, method: Method, times: np.ndarray, limits: Limits):
        super().__init__(scene, method, times, limits)
        self._passage = Passage(self)

    def give_back(self) -> None:
        """Leave the memory to the next run, that of the passages too."""
        self._passage.give_back()
        super().give_back()

    def advance(self, progress: Callable[[float], None] | None) -> tuple[int, float]:
        """Run to the end; the final status and the process CPU time of the stepping alone (s)."""
        status = self._passage.leave_start()
        if status == PAUSED and self.memory.loop.clock.time > 0.0:
            self.enter_state()
        status, seconds = super().advance(progress) if status == PAUSED else (status, 0.0)
        self._passage.collect()
        return status, seconds

    @property
    def passes_briefly(self) -> bool:
        """Whether all passages so far were brief."""
        return self._passage.is_brief

    def take_steps(self) -> int:
        """As those of every run, brief passages among them once there are series for them."""
        self._look_at_rows_again()
        return self._passage.advance_over(PAUSED) if self._passage.is_made else super().take_steps()

    def pass_singular_position(self, status: int) -> int:
        """PAUSED behind it, DONE at the end, else why the motion cannot be followed.

        Rows that are all but dependent at the start, for which an iteration does not converge, are solved by
        the elimination of the series.
        """
        why, memory = status, self.memory
        if status == SINGULAR_AHEAD and not self._passage.is_made:
            status = self._passage.advance_over(status)
            if status != SINGULAR_AHEAD:
                return status
        y, (coordinates, velocities) = memory.loop.y, memory.active
        memory.state.coordinates[coordinates] = y[: coordinates.size]
        memory.state.velocities[velocities] = y[coordinates.size : memory.loop.clock.y_size]
        status = self._passage()
        if status == PAUSED:
            self.enter_state()
        return why if status == UNDECIDED and why == NOT_CONVERGED else status

    def _look_at_rows_again(self) -> None:
        """Rows that were nearly dependent at the start for a singular position are not, away from that."""
        settings = self.memory.equations.system.settings
        if settings.nearly_dependent and self.memory.loop.clock.time > 0.0:
            ranks = ranks_at(
                self.model, self.memory.state.coordinates, self.memory.factor, self.limits.rank_tolerance
            )
            settings.nearly_dependent = ranks.rank != self.ranks.rank or ranks.least < NEARLY


class TaylorRun(SeriesRun):
    """One simulation by Taylor series, which near singular positions give way to exact ones."""

    most_waiting = 1024

    def __init__(self, scene: Scene, method: Method, times: np.ndarray, limits: Limits):
        super().__init__(scene, method, times, limits)
        self._passage = Passage(self)

    def _tolerance_and_order(self, limits: Limits) -> tuple[float, int]:
        """Of the steps of the series: of strides where drivers alone are followed over singular positions."""
        wanted = self.method.options_of(self.method.integrator)["order"]
        self.strides = self.is_driven and not limits.branches and (wanted == 0 or wanted >= LEAST_ORDER)
        if not self.strides:
            return super()._tolerance_and_order(limits)
        return LOOSE, order_of(LOOSE, wanted or ORDER, GENERIC)

    def step_on(self) -> int:
        """As many steps as are taken at a time: PAUSED after them, DONE at the end, or why there are none."""
        if not self.strides:
            return super().step_on()
        return int(follow_drivers(self._packed_taylor.argument))

    def give_back(self) -> None:
        """Leave the memory to the next run, that of the passages too."""
        self._passage.give_back()
        super().give_back()

    def advance(self, progress: Callable[[float], None] | None) -> tuple[int, float]:
        """Run to the end; the final status and the process CPU time of the stepping alone (s)."""
        before, began, seconds = self.making, time.process_time(), 0.0
        status = self._passage.leave_start()
        while status == PAUSED:
            status = self.step_on()
            seconds += time.process_time() - began
            if (completed := int(complete_samples(self._packed_taylor.argument))) != OK:
                status = UNDECIDED if status == UNDECIDED else completed
            began = time.process_time()
            if status != DONE:
                status = self._over(status)
                self.generate_where_it_pays(status)
            if progress is not None:
                progress(float(self.memory.loop.clock.time))
        seconds += time.process_time() - began - (self.making - before)
        self.crossings += self.recorded()
        return status, seconds

    def _over(self, status: int) -> int:
        """A status, or that behind the singular position ahead, or along another branch at the last one."""
        self.crossings += self.recorded()
        if status != SINGULAR_AHEAD and not self._parts():
            return status
        status = self._passage() if status == SINGULAR_AHEAD else self._passage.take_branch()
        return UNDECIDED if status == PAUSED and self.expand() != OK else status

    def _parts(self) -> bool:
        """Whether the last singular position passed is to be left along another branch, not yet taken."""
        asked = dict(self.limits.branches).get(len(self.crossings), SMOOTH)
        return bool(self.crossings) and self.crossings[-1].taken != asked


class Passage:
    """The way of a run over singular positions, by series that are made at the first.

    ``is_brief`` says whether all passages so far were brief ones.
    """

    def __init__(self, run: Run):
        self._run = run
        self._made: PassingRun | None = None
        self.is_brief = True
        self._way = leaving(run) if run.times[-1] > 0.0 else None
        self._fits_no_branch = self._way is None and fits_no_branch(run)

    def __call__(self) -> int:
        """Take the run's state and time over one, and its samples: PAUSED, DONE or why that cannot be."""
        series = self._series()
        series.take_over(self._run)
        return self._given_back(series.cross(), series)

    @property
    def is_made(self) -> bool:
        """Whether there are series."""
        return self._made is not None

    def advance_over(self, status: int) -> int:
        """Advance the run in steps that has a status, by brief passages too."""
        status = self._series().advance_over(status, self._run)
        if status != DONE:
            self.collect()
        return status

    def collect(self) -> None:
        """Have the run know the singular positions that brief passages have recorded."""
        if self._made is not None:
            self._run.crossings += self._made.recorded()

    def take_branch(self) -> int:
        """Take the run along the branch asked for at the last singular position that it has passed."""
        run, series = self._run, self._series()
        crossing = run.crossings[-1]._replace(taken=dict(run.limits.branches)[len(run.crossings)])
        run.crossings[-1] = crossing
        run.memory.loop.clock.sample = int(np.searchsorted(run.times, crossing.time, side="right"))
        series.take_over(run)
        return self._given_back(series.leave_along_branch(crossing), series)

    def leave_start(self) -> int:
        """Leave a singular position at t = 0: PAUSED, also where there is none, DONE at the end, else why the
        motion cannot be followed."""
        if self._way is None:
            return UNDECIDED if self._fits_no_branch else PAUSED
        series = self._series()
        series.take_over(self._run)
        return self._given_back(series.leave(self._way), series)

    def _given_back(self, status: int, series: PassingRun) -> int:
        """PAUSED or DONE where the run goes on behind a passage that ended with a status, else why not."""
        self.is_brief = False
        status = series.hand_over(status, self._run)
        if status in (PAUSED, DONE):
            self._run.crossings += series.crossings
        return status

    def give_back(self) -> None:
        """Leave the memory of the series, if any were made, to the next run."""
        if self._made is not None:
            self._made.give_back()

    def _series(self) -> PassingRun:
        if self._made is None:
            began, run = time.process_time(), self._run
            self._made = PassingRun(run)
            run.making += time.process_time() - began
        return self._made
