"""Measures of the error of published problems: energy, the place of a body, invariants of a linkage.

A measure is a function of the scene, a trajectory and the exact motion at equal times, or at the first of
these times. A measure returns None if it is not defined, for example without an exact motion.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from crosscheck.judge import constraints
from crosscheck.judge.energy import energy_drift
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

Measure = Callable[[Scene, Trajectory, Trajectory | None], float | None]
NEAR_ZERO = 1e-3  # smallest denominator of relative errors in problem A02, by its definition


def energy(scene: Scene, motion: Trajectory, exact: Trajectory | None) -> float | None:
    """Return the largest |E(t) - E(0)|, J."""
    drift = energy_drift(scene, motion)
    return None if drift is None or not drift.size else float(drift.max())


def relative_to_each(observe: Callable[[Trajectory], np.ndarray]) -> Measure:
    """Return the largest relative error of observed numbers (k, n); near zero the error is relative to
    NEAR_ZERO."""

    def measure(scene: Scene, motion: Trajectory, exact: Trajectory | None) -> float | None:
        if exact is None:
            return None
        got, true = observe(motion)[: len(exact.times)], observe(exact)
        return float((np.abs(got - true) / np.maximum(np.abs(true), NEAR_ZERO)).max(initial=0.0))

    return measure


def relative_at_the_end(
    observe: Callable[[Scene, Trajectory], Mapping[str, float]], names: Sequence[str]
) -> Measure:
    """Return the largest relative error of some observed numbers at the last sample; None if the run ends
    before."""

    def measure(scene: Scene, motion: Trajectory, exact: Trajectory | None) -> float | None:
        if exact is None or not len(exact.times) or len(exact.times) < len(motion.times):
            return None
        got, true = observe(scene, motion), observe(scene, exact)
        return max(abs(got[name] - true[name]) / abs(true[name]) for name in names)

    return measure


def distance(body: str) -> Measure:
    """Return the largest distance of a body's centre from its true position, m."""

    def measure(scene: Scene, motion: Trajectory, exact: Trajectory | None) -> float | None:
        return None if exact is None else float(_off(scene, body, motion, exact).max(initial=0.0))

    return measure


def relative_distance(body: str) -> Measure:
    """Return the largest distance of a body's centre from its true position, relative to the distance of that
    position from the origin."""

    def measure(scene: Scene, motion: Trajectory, exact: Trajectory | None) -> float | None:
        if exact is None:
            return None
        true = np.linalg.norm(exact.position[:, scene.body_index(body)], axis=-1)
        return float((_off(scene, body, motion, exact) / true).max(initial=0.0))

    return measure


def mean_square_distance(body: str) -> Measure:
    """Return the root mean square distance of a body's centre from its true position, m."""

    def measure(scene: Scene, motion: Trajectory, exact: Trajectory | None) -> float | None:
        if exact is None or not len(exact.times):
            return None
        return float(np.sqrt(np.mean(_off(scene, body, motion, exact) ** 2)))

    return measure


def opposite_hinges(pairs: Sequence[tuple[str, str]]) -> Measure:
    """Return the largest sum of the angles, counted from the start, of hinges that turn in opposite
    directions, rad."""

    def measure(scene: Scene, motion: Trajectory, exact: Trajectory | None) -> float | None:
        state = motion.position, motion.orientation, motion.angular_velocity
        turned = constraints.joint_coordinates(scene, motion.times, *state, motion.angles)
        sums = [np.abs(turned[a][:, 0] + turned[b][:, 0]) for a, b in pairs]
        return float(np.max(sums, initial=0.0))

    return measure


def guided(body: str) -> Measure:
    """Return the largest distance (m) of a body's centre from the vertical through its start, or its tilt
    (rad)."""

    def measure(scene: Scene, motion: Trajectory, exact: Trajectory | None) -> float | None:
        b = scene.body_index(body)
        place, turn = (a[b] for a in constraints.initial_poses(scene))
        aside = np.linalg.norm((motion.position[:, b] - place)[:, :2], axis=-1)
        tilt = rotations.angle_between(motion.orientation[:, b], np.broadcast_to(turn, (len(aside), 4)))
        return float(max(aside.max(initial=0.0), tilt.max(initial=0.0)))

    return measure


def _off(scene: Scene, body: str, motion: Trajectory, exact: Trajectory) -> np.ndarray:
    """Return the distances (k,) of a body's centre from its true position, m."""
    b, k = scene.body_index(body), len(exact.times)
    return np.asarray(np.linalg.norm(motion.position[:k, b] - exact.position[:, b], axis=-1))
