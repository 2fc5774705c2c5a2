"""Singular positions of a run by Taylor series: their crossing along the requested branches.

A run departs from a singular position along another branch than the smooth one, and at its start, from a
state slightly behind the position. This state is corrected until the series about it, evaluated backwards,
gives the singular position with the velocities of the branch.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import repeat
from typing import Any

import numpy as np

from mbref.equations.branches import SMOOTH, Passed, branches_passed
from mbref.equations.joint_angles import angles_of_pose
from mbref.equations.model import displaced, displacement
from mbref.kernels.layout import OK
from mbref.stepping.leaving import Leaving, fits_no_branch, leaving
from mbref.stepping.loop import DONE, PAUSED, UNDECIDED
from mbref.stepping.run import Run
from mbref.taylor.crossing.steps_across import (
    begin_crossing,
    continue_crossing,
    cross_position,
    end_crossing,
    put_state_along,
)
from mbref.taylor.crossing.thresholds import (
    DEPARTURE,
    DEPARTURE_CORRECTIONS,
    DEPARTURE_PIVOT,
    START_ERROR,
)

Moved = tuple[np.ndarray, np.ndarray]  # coordinates (7 nb,) and velocities (n,)


class BranchFollower:
    """The crossings of one run, along the branches that its limits request.

    ``taylor`` is the memory of the series, ``argument`` its pointer for kernels, and ``expand`` begins a
    series at the present state.
    """

    def __init__(self, run: Run, taylor: Any, argument: Any, expand: Callable[[], int]):
        self._run, self._taylor, self._argument = run, taylor, argument
        self._departure = Departure(run, taylor, expand, self._state_at)
        self._way = leaving(run) if run.times[-1] > 0.0 else None
        self._fits_no_branch = self._way is None and fits_no_branch(run)

    @property
    def begins_at_branches(self) -> bool:
        """Return whether the run starts at a singular position that it can leave."""
        return self._way is not None

    def leave_start(self) -> int:
        """Leave a singular position at t = 0, if any; return PAUSED, DONE, or the failure status."""
        if self._way is None:
            return UNDECIDED if self._fits_no_branch else PAUSED
        begin_crossing(self._argument)
        return self._until_clear(self._departure.from_start(self._way), [])

    def cross(self) -> int:
        """Cross the singular position ahead; return PAUSED when the distance is large enough, DONE at the
        end, or the failure status."""
        return self._until_clear(int(cross_position(self._argument)), [])

    @property
    def leaves_branch(self) -> bool:
        """Return whether the last singular position must be left along another branch, which is not yet
        taken."""
        crossings = self._run.crossings
        return bool(crossings) and crossings[-1].taken != self._asked(len(crossings))

    def take_branch(self) -> int:
        """Continue along the requested branch at the last singular position; return the status as
        ``cross``."""
        crossings = self._run.crossings
        begin_crossing(self._argument)
        taken = [crossings.pop()._replace(taken=self._asked(len(crossings) + 1))]
        return self._until_clear(self._departure.along_branch(taken[0]), taken)

    def record(self) -> None:
        """Add the singular positions crossed since the last request to the crossings of the run."""
        self._run.crossings += self._recorded()

    def _recorded(self) -> list[Passed]:
        """Return the singular positions crossed since the last request, along smooth branches."""
        progress = self._taylor.progress
        count, progress.recorded = int(progress.recorded), 0
        if not count:
            return []
        times, coordinates, velocities = (found[:count].copy() for found in self._taylor.crossings)
        return list(map(Passed, times.tolist(), coordinates, velocities, repeat(SMOOTH)))

    def _asked(self, number: int) -> int:
        """Return the requested branch at a singular position, both counted from 1."""
        return dict(self._run.limits.branches).get(number, SMOOTH)

    def _until_clear(self, status: int, crossed: list[Passed]) -> int:
        """Take high-accuracy steps until no singular position is near, after crossings ``crossed``."""
        counts: Any = self._run.memory.equations.system.counts
        while status in (PAUSED, DONE):
            branch = self._to_branch(crossed)
            if branch is not None:
                counts.crossings = len(self._run.crossings) + len(crossed)
                status = self._departure.along_branch(branch)
            elif status == DONE or self._taylor.distance.is_clear:
                break
            else:
                status = int(continue_crossing(self._argument))
        status = int(end_crossing(status, self._argument))
        if status in (PAUSED, DONE):
            self._run.crossings += crossed
        return status

    def _to_branch(self, crossed: list[Passed]) -> Passed | None:
        """Add the crossings of the last step up to a requested branch; return the latter crossing or None."""
        for passed in self._recorded():
            taken = self._asked(len(self._run.crossings) + len(crossed) + 1)
            crossed.append(passed._replace(taken=taken))
            if taken != SMOOTH:
                return crossed[-1]
        return None

    def _state_at(self, ahead: float) -> tuple[np.ndarray, np.ndarray]:
        """Return coordinates and velocities at a distance (s) from the start of the series."""
        put_state_along(ahead, self._argument)
        state = self._run.memory.state
        return state.coordinates.copy(), state.velocities.copy()


class Departure:
    """Departures of a run that uses high-accuracy steps.

    ``expand`` begins a series at the present state, ``state_at`` evaluates it at a distance (s).
    """

    def __init__(self, run: Run, taylor: Any, expand: Callable[[], int], state_at: Callable[[float], Moved]):
        self._run, self._taylor, self._expand, self._state_at = run, taylor, expand, state_at

    def along_branch(self, passed: Passed) -> int:
        """Continue along another branch than the smooth branch from a singular position that was just passed;
        return PAUSED or the failure status."""
        run, clock = self._run, self._run.memory.loop.clock
        velocities = branches_passed(run.model, passed).velocities[passed.taken - 1]
        clock.sample = int(np.searchsorted(run.times, passed.time, side="right"))
        self._taylor.progress.completed = min(int(self._taylor.progress.completed), int(clock.sample))
        following = run.times[int(clock.sample) :]
        ahead = self._time_in_which(velocities)
        ahead = min(ahead, 0.5 * float(following[0] - passed.time) if following.size else np.inf)
        moved = displaced(passed.coordinates, ahead * velocities), velocities
        return self._come_from(passed, velocities, ahead, moved)

    def from_start(self, way: Leaving) -> int:
        """Continue from a singular position at t = 0; return PAUSED or the failure status, with time 0."""
        q, v, acceleration = way
        moves = np.any(v)
        ahead = min(self._time_along(v, acceleration), 0.5 * float(self._run.times[-1]))
        moved = displaced(q, ahead * v + 0.5 * ahead**2 * acceleration), v + ahead * acceleration
        status = self._come_from(Passed(0.0, q, v, SMOOTH), v, ahead, moved)
        if status == PAUSED and moves and self._misses(q, v, ahead):
            status = UNDECIDED
        if status == PAUSED:
            self._put_samples_before(ahead, way)
        else:
            self._run.memory.loop.clock.time = 0.0
        return status

    def _misses(self, q: np.ndarray, v: np.ndarray, ahead: float) -> bool:
        """Return whether the series, evaluated a time ``ahead`` (s) before its beginning, differs from
        coordinates and velocities. The difference is relative to the larger of both speeds."""
        there = self._state_at(-ahead)
        moved, changed = displacement(q, there[0]), there[1] - v
        speed = max(np.abs(v).max(), np.abs(self._state_at(0.0)[1]).max())
        is_far = np.abs(moved).max() > self._taylor.options.start_distance
        return bool(is_far or np.abs(changed).max() > START_ERROR * speed)

    def _put_samples_before(self, ahead: float, way: Leaving) -> None:
        """Put the samples from a singular position at t = 0 until the time (s) about which the series
        begins."""
        run, clock = self._run, self._run.memory.loop.clock
        for k in range(int(np.searchsorted(run.times, ahead))):
            t = float(run.times[k])
            q, v = self._state_at(t - ahead)
            acceleration = run.memory.equations.system.acceleration.copy()
            if t == 0.0:
                q, v = way.coordinates, way.velocities
                acceleration = acceleration if np.any(v) else way.acceleration
            self._put_sample(k, q, v, acceleration)
            clock.sample = self._taylor.progress.completed = k + 1
        self._state_at(0.0)

    def _put_sample(self, k: int, q: np.ndarray, v: np.ndarray, acceleration: np.ndarray) -> None:
        """Record sample k; multipliers balance the forces by least squares; at rest, only along the
        branch."""
        run = self._run
        samples, terms = run.memory.loop.samples, run.model.terms(float(run.times[k]), q, v)
        samples.coordinates[k], samples.velocities[k], samples.accelerations[k] = q, v, acceleration
        across = terms.force - terms.mass * acceleration
        samples.multipliers[k] = np.linalg.lstsq(terms.jacobian.T, across, rcond=None)[0]
        samples.angles[k] = angles_of_pose(run.model, q)

    def _come_from(self, start: Passed, velocities: np.ndarray, ahead: float, moved: Moved) -> int:
        """Continue at a time ``ahead`` (s) after a singular position that is left with velocities (n,).

        ``moved`` is a state near the motion, which is corrected. Return PAUSED or the failure status.
        """
        memory, distance = self._run.memory, self._taylor.distance
        memory.loop.clock.time = start.time + ahead
        settings: Any = memory.equations.system.settings
        usual, settings.rank_tolerance = (
            settings.rank_tolerance,
            self._least_pivot_at(moved[0], start.coordinates),
        )
        status = self._corrected(start, velocities, ahead, moved)
        settings.rank_tolerance = usual
        if status != OK:
            return status
        distance.start_pivot, distance.clearance, distance.is_clear = 0.0, 0.0, 0
        solver, rank = self._taylor.solver, int(self._taylor.partition.rank)
        pivots = solver.unit[solver.pivot_columns[:rank]] * np.abs(solver.last[:rank])
        distance.entry_pivot = pivots.min(initial=1.0)
        self._keep_beginning()
        return PAUSED

    def _keep_beginning(self) -> None:
        """Save the present state as the start of a perturbed run of the crossing."""
        memory, began = self._run.memory, self._taylor.crossing_start
        began.instant.time, began.instant.sample = memory.loop.clock.time, memory.loop.clock.sample
        began.instant.crossings = memory.equations.system.counts.crossings
        began.coordinates[:], began.velocities[:] = memory.state.coordinates, memory.state.velocities
        began.angles[:] = memory.equations.angles

    def _corrected(self, start: Passed, velocities: np.ndarray, ahead: float, moved: Moved) -> int:
        """Correct the state until its series, evaluated backwards, gives the singular position with
        velocities (n,); return the status."""
        (q, v), state = moved, self._run.memory.state
        for _ in range(DEPARTURE_CORRECTIONS):
            state.coordinates[:], state.velocities[:] = q, v
            if (status := self._expand()) != OK:
                return status
            there, here = self._state_at(-ahead), self._state_at(0.0)
            q = displaced(here[0], displacement(there[0], start.coordinates))
            v = here[1] + velocities - there[1]
        return OK

    def _least_pivot_at(self, q: np.ndarray, crossing: np.ndarray) -> float:
        """Return the least pivot of independent rows at uncorrected coordinates near a singular position.

        Rows of spherical loops depend on each other if the constraints are satisfied. A state that violates
        them by the square of its distance gives them pivots of that size, and these are ignored.
        """
        moved = displacement(q, crossing).reshape(-1, 6)
        places = np.abs(moved[:, :3] / self._run.model.data.lengths[:, None]).max()
        distance = float(max(places, np.abs(moved[:, 3:]).max()))
        return max(self._run.memory.equations.system.settings.rank_tolerance, DEPARTURE_PIVOT * distance)

    def _time_in_which(self, velocities: np.ndarray) -> float:
        """Return the time (s) in which the fastest body moves by DEPARTURE."""
        return self._time_along(velocities, np.zeros_like(velocities))

    def _time_along(self, velocities: np.ndarray, acceleration: np.ndarray) -> float:
        """Return the time (s) t of r t + s t² / 2 = DEPARTURE, with the largest rate r of a body and its
        largest change s."""
        rate, change = self._largest_rate(velocities), self._largest_rate(acceleration)
        return float(2.0 * DEPARTURE / (rate + np.sqrt(rate**2 + 2.0 * change * DEPARTURE)))

    def _largest_rate(self, velocities: np.ndarray) -> float:
        """Return the largest of the bodies' velocities over their lengths (1/s) and angular velocities."""
        rates = velocities.reshape(-1, 6)
        places = np.abs(rates[:, :3] / self._run.model.data.lengths[:, None]).max()
        return float(max(places, np.abs(rates[:, 3:]).max()))
