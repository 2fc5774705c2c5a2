"""Departure of a series from a singular position, along a requested branch or at the start of a run.

A state slightly behind the singular position is corrected until the series about it, evaluated backwards,
gives the singular position with the velocities of the branch.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from mbref.equations.branches import SMOOTH, Passed, branches_passed
from mbref.equations.joint_angles import angles_of_pose
from mbref.equations.model import displaced, displacement
from mbref.kernels.layout import OK
from mbref.stepping.loop import PAUSED, UNDECIDED
from mbref.stepping.run import Run
from mbref.stepping.singular_start import Leaving
from mbref.taylor.crossing.thresholds import (
    DEPARTURE,
    DEPARTURE_CORRECTIONS,
    DEPARTURE_PIVOT,
    START_ERROR,
)

Moved = tuple[np.ndarray, np.ndarray]  # coordinates (7 nb,) and velocities (n,)


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
