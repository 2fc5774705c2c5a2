"""Residuals of a goal, and their Jacobian, as functions of free numbers of a scene."""

from __future__ import annotations

import numpy as np

from mbref.design.derivatives.free_numbers import FreeNumbers
from mbref.design.derivatives.given_values import nearest_signs
from mbref.design.derivatives.numbers_of_scene import AccurateStencils
from mbref.design.derivatives.sensitivities import motion_and_derivatives
from mbref.design.synthesis.goals import Goal
from mbref.design.synthesis.point_times import nearest_in_order
from mbref.input_error import InputError
from mbref.motions.motion import Motion
from mbref.scene import Scene, SceneError
from mbref.simulation.simulate import simulate
from mbref.stepping.limits import Limits

SEARCHED = 721  # samples among which the first times of points are found


class SynthesisProblem:
    """Residuals (r,) of a goal as functions of z: p numbers over their sizes, and for points without times
    the time of each point over the scene's duration.

    ``refused`` counts the trials without a motion to the last sample; ``last_reason`` is a sentence on the
    last one. ``has_derivatives`` is true after the first Jacobian. A residual of a mean square is over the
    root of the count of all.
    """

    def __init__(self, numbers: FreeNumbers, goal: Goal, limits: Limits, peak: bool):
        self.numbers, self.goal, self.limits, self.peak = numbers, goal, limits, peak
        self.given = np.isfinite(goal.wanted)
        shape = goal.wanted.shape
        self.scales = np.broadcast_to(goal.units * (1.0 if peak else np.sqrt(self.given.sum())), shape)
        self.duration = numbers.scene.duration
        self.refused, self.last_reason, self.has_derivatives = 0, "", False
        self._accurate: AccurateStencils = {}

    @property
    def names(self) -> list[str]:
        """Names of the variables z."""
        free = range(1, len(self.goal.wanted) + 1) if self.goal.times is None else ()
        return [*self.numbers.labels, *(f"time of point {k}" for k in free)]

    def scene_at(self, z: np.ndarray) -> Scene:
        """Return the scene with numbers z."""
        return self.numbers.scene_at(z[: len(self.numbers.labels)])

    def times_at(self, z: np.ndarray) -> np.ndarray:
        """Return the times (k,) of the goal, s."""
        if self.goal.times is not None:
            return self.goal.times
        return np.asarray(z[len(self.numbers.labels) :] * self.duration)

    def values_at(self, z: np.ndarray) -> np.ndarray | None:
        """Return the goal's columns (k, c), or None where the motion does not reach its last sample smoothly,
        which is counted."""
        try:
            times, inverse = np.unique(self.times_at(z), return_inverse=True)
            motion = simulate(self.scene_at(z), times=times, limits=self.limits)
        except (InputError, SceneError) as fault:
            return self._refuse(str(fault))
        if motion.times.size < times.size:
            return self._refuse(motion.message)
        passed = [crossing.time for crossing in motion.crossings or () if crossing.time <= times[-1]]
        if passed:
            return self._refuse(f"the motion passes a singular position at t = {passed[0]:.6g} s")
        return _table(motion, self.goal.columns)[inverse]

    def _refuse(self, reason: str) -> np.ndarray | None:
        """Count a trial without a motion; return None."""
        self.refused, self.last_reason = self.refused + 1, reason
        return None

    def residuals(self, z: np.ndarray) -> np.ndarray:
        """Return the residuals (r,), NaN where the motion ends early."""
        found = self.values_at(z)
        if found is None:
            return np.full(self.given.sum(), np.nan)
        return np.asarray((self.off(found) / self.scales)[self.given])

    def off(self, found: np.ndarray) -> np.ndarray:
        """Return the differences (k, c) of values (k, c) from the goal; a quaternion and its opposite are one
        orientation."""
        goal = self.goal
        return np.asarray(found - nearest_signs(goal.columns, goal.wanted, found) * goal.wanted)

    def jacobian(self, z: np.ndarray) -> np.ndarray:
        """Return the derivatives (r, variables) of the residuals; raises InputError where they do not
        exist."""
        times, inverse = np.unique(self.times_at(z), return_inverse=True)
        labels, goal = self.numbers.labels, self.goal
        motion, names, found = motion_and_derivatives(
            self.scene_at(z), goal.columns, labels, times, self.limits, self._accurate
        )
        if len(found) < times.size:
            raise InputError(motion.message or "the motion has no derivatives to its last sample")
        self.has_derivatives = True
        order = [names.index(name) for name in goal.columns]
        by_number = found[inverse][:, order] * self.numbers.sizes
        if goal.times is None:
            rates = _table(motion, goal.rates)[inverse] * self.duration
            by_time = rates[:, :, None] * np.eye(len(rates))[:, None]
            by_number = np.concatenate([by_number, by_time], axis=2)
        return np.asarray((by_number / self.scales[..., None])[self.given])

    def with_times(self, z: np.ndarray) -> np.ndarray | None:
        """Return numbers z (p,) with the times at which the motion is nearest to the points in their
        order; None if there is no motion."""
        if self.goal.times is not None:
            return z
        times = np.linspace(0.0, self.duration, SEARCHED)
        try:
            motion = simulate(self.scene_at(z), times=times, limits=self.limits)
        except (InputError, SceneError) as fault:
            return self._refuse(str(fault))
        if motion.times.size <= len(self.goal.wanted):
            return self._refuse(motion.message)
        table = _table(motion, self.goal.columns)
        off = np.nan_to_num((table - self.goal.wanted[:, None]) / self.goal.units)
        nearest = times[nearest_in_order((off**2).sum(axis=2))]
        return np.concatenate([z, nearest / self.duration])

    def bounds(self, lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the bounds of z by bounds of the numbers (p,), over their sizes."""
        free = len(self.goal.wanted) if self.goal.times is None else 0
        return np.append(lower, np.zeros(free)), np.append(upper, np.ones(free))


def _table(motion: Motion, columns: tuple[str, ...]) -> np.ndarray:
    table = motion.columns(*columns)
    return np.array([table[name] for name in columns]).T
