"""A run by Taylor series in Python: its memory and options, and the loop over calls of the kernels that take
steps, cross singular positions and complete samples."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Sequence
from itertools import repeat
from typing import Any

import numpy as np

from mbref.equations.branches import SMOOTH, Passed
from mbref.equations.packing import Packs
from mbref.input_error import InputError
from mbref.kernels.layout import OK, SINGULAR_AHEAD
from mbref.kernels.machine_code import NoGeneratedCode
from mbref.kernels.memory_pool import release, write_record
from mbref.stepping.limits import AUTO, GENERATED, GENERIC
from mbref.stepping.loop import DONE, PAUSED, UNDECIDED
from mbref.stepping.pace import Pace
from mbref.stepping.run import Run
from mbref.stepping.singular_start import fits_no_branch, leaving
from mbref.taylor.advance import advance_series, enter_series
from mbref.taylor.batch_equations import equations_of_all
from mbref.taylor.crossing.departure import Departure
from mbref.taylor.crossing.long_crossing import (
    begin_crossing,
    continue_crossing,
    cross_position,
    end_crossing,
    put_state_along,
)
from mbref.taylor.crossing.thresholds import MIN_CHANGE, START_ERROR
from mbref.taylor.driven import (
    ACCURATE_TOLERANCE,
    LEAST_PREDICTOR_ORDER,
    PREDICTOR_ORDER,
    PREDICTOR_TOLERANCE,
    follow_drivers,
)
from mbref.taylor.geometry import geometry_of
from mbref.taylor.layout import SeriesOptions
from mbref.taylor.mode import REGULAR
from mbref.taylor.sample_completion import complete_samples
from mbref.taylor.series_memory import acquire_memory, put_equations

EXACT, EXACT_ORDER = 1e-13, 22  # tolerance and least order of high-accuracy steps
LAST_TERMS = 0.05  # tolerance of the last terms / (rtol + atol), far from singular positions
# expected steps above which generated code saves more time than its generation takes
STEPS_WORTH_CODE = 20_000
LEAST_ORDER, MOST_ORDER = 4, 30  # order of a series; rounding dominates higher terms
# order of least cost at a tolerance of 1, and its increase for each digit
CHEAPEST = {GENERIC: (6.0, 1.2), GENERATED: (7.0, 1.6)}


def order_of(tolerance: float, wanted: float, code: str) -> int:
    """Return the order of the series: the requested order, or for 0 the cheapest order; raises InputError
    outside 4 to 30."""
    if wanted == 0:
        first, per_digit = CHEAPEST[code]
        best = 2 * round((first - per_digit * np.log10(tolerance)) / 2)
        return int(min(max(best, LEAST_ORDER), MOST_ORDER))
    if wanted not in range(LEAST_ORDER, MOST_ORDER + 1):
        raise InputError(f"taylor: order must be {LEAST_ORDER} to {MOST_ORDER}, got {wanted:g}")
    return int(wanted)


class SeriesStepper:
    """The steps of one run in Taylor series, across singular positions.

    ``follows_drivers`` says whether steps are predictor steps (``mbref.taylor.driven``).
    """

    def __init__(self, run: Run):
        self.run = run
        self._pace = Pace(run)
        self._decide_rank()
        columns = run.memory.active.velocities.size
        self.is_driven = run.ranks.rank == columns and not run.model.has_angles
        self.follows_drivers, tolerance, order = self._kind_of_steps()
        self.geometry = geometry_of(run.model, run.start, self._moving, self.follows_drivers)
        self.polynomials = self.geometry.polynomials(run.model)
        exact_order = max(order, EXACT_ORDER) if run.model.closed_loops else order
        self._pooled = acquire_memory(run, self.geometry, self.polynomials, exact_order)
        self.taylor, self.argument = self._pooled.values, self._pooled.packed.argument
        self._calls, self._sampling = 0, 0.0  # calls of kernels that take steps; s of CPU time for samples
        self._options = SeriesOptions(
            regular_tolerance=tolerance,
            regular_order=order,
            accurate_tolerance=ACCURATE_TOLERANCE if self.follows_drivers else LAST_TERMS * (EXACT + EXACT),
            accurate_order=exact_order,
            velocity_change=max(run.memory.control.rtol, MIN_CHANGE),
            start_distance=START_ERROR * max(1.0, run.model.length),
            start_freedoms=columns - run.ranks.rank,
            follows_drivers=self.follows_drivers,
        )
        self._put_options()
        self._departure = Departure(run, self.taylor, self.expand, self._state_at)
        self._way = leaving(run) if run.times[-1] > 0.0 else None
        self._fits_no_branch = self._way is None and fits_no_branch(run)
        self._wants_code = run.limits.code == AUTO
        if run.limits.code == GENERATED:
            self._put_code()

    def _kind_of_steps(self) -> tuple[bool, float, int]:
        """Return whether steps are predictor steps, and the tolerance and the order of their series."""
        run, code = self.run, self.run.limits.code
        wanted = run.method.options_of(run.method.integrator)["order"]
        if self.is_driven and not run.limits.branches and (wanted == 0 or wanted >= LEAST_PREDICTOR_ORDER):
            return (
                True,
                PREDICTOR_TOLERANCE,
                order_of(PREDICTOR_TOLERANCE, wanted or PREDICTOR_ORDER, GENERIC),
            )
        tolerance = LAST_TERMS * (run.memory.control.rtol + run.memory.control.atol)
        return False, tolerance, order_of(tolerance, wanted, GENERATED if code == GENERATED else GENERIC)

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
        """Put the numbers of the method into memory."""
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
        varied, alike = equations_of_all(packs, q, places, self._moving, self.follows_drivers, self.taylor)
        distances = START_ERROR * np.maximum(1.0, packs.length)
        return [(self.taylor.options, distances, "start_distance"), *varied], alike

    def advance_once(self) -> tuple[int, float]:
        """Advance by one call of kernels; return the status, and the process CPU time of the stepping alone
        (s)."""
        began = time.process_time()
        status = self.take_steps()
        seconds = time.process_time() - began
        self.run.crossings += self.recorded()
        return self._status_with_samples(status, go_on=False), seconds

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

    def advance(self, progress: Callable[[float], None] | None) -> tuple[int, float]:
        """Run to the end; return the final status and the process CPU time of the stepping alone (s)."""
        making, began = self.run.making, time.process_time()
        status = self._leave_start()
        while status == PAUSED:
            status = self.take_steps()
            if status == DONE:
                break
            self.run.crossings += self.recorded()
            if status == SINGULAR_AHEAD or self._leaves_branch():
                status = self._begin_again(self._cross() if status == SINGULAR_AHEAD else self._take_branch())
            else:
                status = self._complete_samples(status, go_on=status == PAUSED)
            status = self._pace.judge(status)
            if status == PAUSED:
                self._generate_where_it_pays()
            if progress is not None:
                progress(float(self.run.memory.loop.clock.time))
        seconds = time.process_time() - began - self._sampling - (self.run.making - making)
        self.run.crossings += self.recorded()
        if progress is not None and status == DONE:
            progress(float(self.run.memory.loop.clock.time))
        return self._complete_samples(status, go_on=False), seconds

    def take_steps(self) -> int:
        """Take the steps of one call; return PAUSED, DONE at the end, or the failure status."""
        self._calls += 1
        return int((follow_drivers if self.follows_drivers else advance_series)(self.argument))

    def expand(self) -> int:
        """Expand at the present time and state, for steps until the end; return OK or the failure status."""
        self.taylor.progress.end = self.run.times[-1]
        return int(enter_series(self.argument))

    def _begin_again(self, status: int) -> int:
        """Complete the samples of a crossing and begin a series after it; return the status."""
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

    def recorded(self) -> list[Passed]:
        """Return the singular positions crossed since the last request, along smooth branches."""
        progress = self.taylor.progress
        count, progress.recorded = int(progress.recorded), 0
        if not count:
            return []
        times, coordinates, velocities = (found[:count].copy() for found in self.taylor.crossings)
        return list(map(Passed, times.tolist(), coordinates, velocities, repeat(SMOOTH)))

    def _asked(self, number: int) -> int:
        """Return the requested branch at a singular position, both counted from 1."""
        return dict(self.run.limits.branches).get(number, SMOOTH)

    def _leaves_branch(self) -> bool:
        """Return whether the last singular position must be left along another branch, which is not yet
        taken."""
        crossings = self.run.crossings
        return bool(crossings) and crossings[-1].taken != self._asked(len(crossings))

    def _cross(self) -> int:
        """Cross the singular position ahead; return PAUSED when the distance is large enough, DONE at the
        end, or the failure status."""
        self._calls += 1
        return self._until_clear(int(cross_position(self.argument)), [])

    def _take_branch(self) -> int:
        """Continue along the requested branch at the last singular position; return the status as
        ``_cross``."""
        crossings = self.run.crossings
        begin_crossing(self.argument)
        taken = [crossings.pop()._replace(taken=self._asked(len(crossings) + 1))]
        return self._until_clear(self._departure.along_branch(taken[0]), taken)

    def _leave_start(self) -> int:
        """Leave a singular position at t = 0, if any; return PAUSED, DONE, or the failure status."""
        if self._way is None:
            return UNDECIDED if self._fits_no_branch else PAUSED
        self._calls += 1
        begin_crossing(self.argument)
        return self._begin_again(self._until_clear(self._departure.from_start(self._way), []))

    def _until_clear(self, status: int, crossed: list[Passed]) -> int:
        """Take high-accuracy steps until no singular position is near, after crossings ``crossed``."""
        counts: Any = self.run.memory.equations.system.counts
        while status in (PAUSED, DONE):
            branch = self._record(crossed)
            if branch is not None:
                counts.crossings = len(self.run.crossings) + len(crossed)
                status = self._departure.along_branch(branch)
            elif status == DONE or self.taylor.progress.is_clear:
                break
            else:
                status = int(continue_crossing(self.argument))
        status = int(end_crossing(status, self.argument))
        if status in (PAUSED, DONE):
            self.run.crossings += crossed
        return status

    def _record(self, crossed: list[Passed]) -> Passed | None:
        """Add the crossings of the last step up to a requested branch; return the latter crossing or None."""
        for passed in self.recorded():
            taken = self._asked(len(self.run.crossings) + len(crossed) + 1)
            crossed.append(passed._replace(taken=taken))
            if taken != SMOOTH:
                return crossed[-1]
        return None

    def _state_at(self, ahead: float) -> tuple[np.ndarray, np.ndarray]:
        """Return coordinates and velocities at a distance (s) from the start of the series."""
        put_state_along(ahead, self.argument)
        state = self.run.memory.state
        return state.coordinates.copy(), state.velocities.copy()
