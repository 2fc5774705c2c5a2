"""Taylor series that pass singular positions: they record each one, and take the branch that is asked for."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from typing import Any

import numpy as np

from mbref.equations.branches import SMOOTH, Passed, SingularPosition, singular_position
from mbref.equations.initial_state import Start
from mbref.equations.model import Model, displaced, displacement
from mbref.equations.reduction import Reduction
from mbref.kernels.compilation import Entry
from mbref.kernels.layout import OK
from mbref.kernels.lent_memory import take_back
from mbref.kernels.machine_code import NoGeneratedCode
from mbref.method import Method
from mbref.simulation.limits import GENERATED, GENERIC
from mbref.simulation.ranks import Ranks
from mbref.simulation.run import Run
from mbref.simulation.singular_start import Leaving
from mbref.simulation.stepping import DONE, PAUSED, UNDECIDED
from mbref.taylor.layout import Polynomials
from mbref.taylor.passing import (
    advance_over,
    begin_here,
    cross,
    give_back,
    keep_second_crossing,
    look_along,
    pass_on,
    take_over,
)
from mbref.taylor.polynomials import Geometry
from mbref.taylor.series_run import EXACT, SeriesRun
from mbref.taylor.start import OFF

SERIES = "taylor[order=16]"  # lower orders magnify rounding less
BEHIND = 3e-3  # lengths or rad behind a crossing where another branch is entered
CORRECTIONS = 6  # of the state there
COUNTED = 0.02  # of its distance from the crossing: a lesser pivot is of rows that depend on others


class PassingRun(SeriesRun):
    """The series of passages of a run, made for the first one; ``crossings`` are those of the last one."""

    def __init__(self, run: Run):
        self._run = run
        limits = replace(run.limits, rtol=EXACT, atol=EXACT, code=GENERIC)
        super().__init__(run.scene, Method.parse(SERIES), run.times, limits)
        self.taylor.progress.passing = True
        if run.limits.code == GENERATED:
            with contextlib.suppress(NoGeneratedCode):  # then the series are by the kernels
                self._put_code()

    def _posed(self) -> tuple[Model, Start, Reduction | None]:
        """Those of the run, all but its memory."""
        return self._run.model, self._run.start, self._run.reduction

    def _ranks_at_start(self) -> Ranks:
        """Those of the run."""
        return self._run.ranks

    def _equations(self) -> tuple[Geometry, Polynomials]:
        """Those of a run that is in series itself."""
        run = self._run
        return (run.geometry, run.polynomials) if isinstance(run, SeriesRun) else super()._equations()

    def advance_over(self, status: int, run: Run) -> int:
        """Advance a run in steps that is PAUSED, or has a singular position ahead, by brief passages, which
        are recorded: as the steps alone do, and SINGULAR_AHEAD only where a passage cannot be brief."""
        return int(advance_over(status, run.packed.argument, self._packed_taylor.argument))

    def take_over(self, run: Run) -> None:
        """Go on from the state and time of a run of the same scene, as a passage begins."""
        self.crossings = []
        take_over(run.packed.argument, self._packed_taylor.argument)

    def give_back(self) -> None:
        """Leave the memory to the next run; the model is the run's."""
        take_back(self._lent_series)
        take_back(self._lent)

    def hand_over(self, status: int, run: Run) -> int:
        """Have the run go on where the passage ended with a status: PAUSED, DONE, or why that cannot be."""
        return int(give_back(status, run.packed.argument, self._packed_taylor.argument))

    def cross(self) -> int:
        """Pass a singular position from the state and time in memory: PAUSED, DONE or why that cannot be."""
        return self._go_on(self._recorded(cross))

    def _go_on(self, status: int) -> int:
        """Pass further singular positions where the passage is PAUSED and not clear of them."""
        while status == PAUSED and not self.taylor.progress.is_clear:
            status = self._recorded(pass_on)
        return status

    def _recorded(self, passing: Entry) -> int:
        """The status of steps that may pass singular positions, which are recorded."""
        counts: Any = self.memory.equations.system.counts
        passed = int(counts.crossings)
        status = int(passing(self._packed_taylor.argument))
        if status not in (PAUSED, DONE):
            return status
        for number in range(passed + 1, int(counts.crossings) + 1):
            if number == passed + 2:
                keep_second_crossing(self._packed_taylor.argument)
            taken, found = dict(self.limits.branches).get(number, SMOOTH), self.taylor.crossing
            q, v = found.coordinates.copy(), found.velocities.copy()
            crossing = Passed(float(found.instant.time), q, v, taken)
            self.crossings.append(crossing)
            if taken != SMOOTH:
                counts.crossings = number
                return self._take_branch(singular_position(self.model, crossing))
        return status

    def leave_along_branch(self, crossing: Passed) -> int:
        """Go on from a singular position just passed along another branch than the smooth one: PAUSED, DONE
        or why that cannot be."""
        status = self._take_branch(singular_position(self.model, crossing))
        self.taylor.progress.entered = self.least_pivot()
        return self._go_on(status)

    def _take_branch(self, crossing: SingularPosition) -> int:
        """Go on along another branch than the smooth one: PAUSED, or why that cannot be.

        A state a little behind the crossing is corrected until the series about it comes from the crossing
        with the velocities of the branch.
        """
        velocities = crossing.velocities[crossing.taken - 1]
        self.memory.loop.clock.sample = int(np.searchsorted(self.times, crossing.time, side="right"))
        following = self.times[self.memory.loop.clock.sample :]
        ahead = self._time_in_which(velocities)
        ahead = min(ahead, 0.5 * float(following[0] - crossing.time) if following.size else np.inf)
        moved = displaced(crossing.coordinates, ahead * velocities), velocities
        return self._come_from(crossing, velocities, ahead, moved)

    def leave(self, way: Leaving) -> int:
        """Go on from a singular position at t = 0: PAUSED, DONE or why that cannot be."""
        q, v, acceleration = way
        moves = np.any(v)
        ahead = self._time_in_which(v) if moves else self._time_in_which(0.5 * acceleration) ** 0.5
        ahead = min(ahead, 0.5 * float(self.times[-1]))
        moved = displaced(q, ahead * v + 0.5 * ahead**2 * acceleration), v + ahead * acceleration
        status = self._come_from(Passed(0.0, q, v, SMOOTH), v, ahead, moved)
        if status == PAUSED and moves and self._misses(q, v, ahead):
            return UNDECIDED
        if status == PAUSED:
            self._put_samples_before(ahead, way)
        self.taylor.progress.entered = self.least_pivot()
        return self._go_on(status)

    def _misses(self, q: np.ndarray, v: np.ndarray, ahead: float) -> bool:
        """Whether the series, a time ahead (s) of its beginning, misses coordinates and velocities."""
        there = self._state_at(-ahead)
        moved, changed = displacement(q, there[0]), there[1] - v
        is_far = np.abs(moved).max() > self.taylor.progress.farthest
        return bool(is_far or np.abs(changed).max() > OFF * np.abs(v).max())

    def _put_samples_before(self, ahead: float, way: Leaving) -> None:
        """The samples from a singular position at t = 0 until a time (s) about which the series begins."""
        clock = self.memory.loop.clock
        for k in range(int(np.searchsorted(self.times, ahead))):
            t = float(self.times[k])
            q, v = self._state_at(t - ahead)
            acceleration = self.memory.equations.system.acceleration.copy()
            if t == 0.0:
                q, v = way.coordinates, way.velocities
                acceleration = acceleration if np.any(v) else way.acceleration
            self._put_sample(k, q, v, acceleration)
            clock.sample = k + 1
        self._state_at(0.0)
        begin_here(self._packed_taylor.argument)

    def _put_sample(self, k: int, q: np.ndarray, v: np.ndarray, acceleration: np.ndarray) -> None:
        """Sample k; multipliers balance the forces as well as they can, at rest along the branch alone."""
        samples, terms = self.memory.loop.samples, self.model.terms(float(self.times[k]), q, v)
        samples.coordinates[k], samples.velocities[k], samples.accelerations[k] = q, v, acceleration
        across = terms.force - terms.mass * acceleration
        samples.multipliers[k] = np.linalg.lstsq(terms.jacobian.T, across, rcond=None)[0]

    def _come_from(
        self,
        start: Passed | SingularPosition,
        velocities: np.ndarray,
        ahead: float,
        moved: tuple[np.ndarray, np.ndarray],
    ) -> int:
        """Go on a time ahead (s) of a singular position that is left with velocities (n,), from a state near
        that of the motion, which is corrected: PAUSED, or why that cannot be."""
        (q, v), self.memory.loop.clock.time = moved, start.time + ahead
        settings = self.memory.equations.system.settings
        usual, settings.rank_tolerance = settings.rank_tolerance, self._least_pivot_at(q, start.coordinates)
        status = self._corrected(start, velocities, ahead, (q, v))
        settings.rank_tolerance = usual
        if status != OK:
            return status
        progress = self.taylor.progress
        progress["past_pivot"], progress["clearance"], progress.is_clear = 0.0, 0.0, 0
        begin_here(self._packed_taylor.argument)
        return PAUSED

    def _corrected(
        self,
        start: Passed | SingularPosition,
        velocities: np.ndarray,
        ahead: float,
        moved: tuple[np.ndarray, np.ndarray],
    ) -> int:
        """Have the series come from a singular position with velocities (n,): OK, or why it cannot."""
        q, v = moved
        for _ in range(CORRECTIONS):
            self.memory.state.coordinates[:], self.memory.state.velocities[:] = q, v
            if (status := self.expand()) != OK:
                return status
            there, here = self._state_at(-ahead), self._state_at(0.0)
            q = displaced(here[0], displacement(there[0], start.coordinates))
            v = here[1] + velocities - there[1]
        return OK

    def _least_pivot_at(self, q: np.ndarray, crossing: np.ndarray) -> float:
        """The least pivot that counts at coordinates near a singular position, before they are corrected.

        Rows of spherical loops depend on others where the constraints hold: a state that violates them by the
        square of its distance has pivots of that size, and those that the distance leaves are as large as it.
        """
        moved = displacement(q, crossing).reshape(-1, 6)
        places = np.abs(moved[:, :3] / self.model.data.lengths[:, None]).max()
        distance = float(max(places, np.abs(moved[:, 3:]).max()))
        return max(self.memory.equations.system.settings.rank_tolerance, COUNTED * distance)

    def _time_in_which(self, velocities: np.ndarray) -> float:
        """Time (s) in which the fastest body moves by BEHIND."""
        rates = velocities.reshape(-1, 6)
        places = np.abs(rates[:, :3] / self.model.data.lengths[:, None]).max()
        return BEHIND / float(max(places, np.abs(rates[:, 3:]).max()))

    def _state_at(self, ahead: float) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates and velocities at a distance (s) from where the series begins."""
        look_along(ahead, self._packed_taylor.argument)
        return self.memory.state.coordinates.copy(), self.memory.state.velocities.copy()
