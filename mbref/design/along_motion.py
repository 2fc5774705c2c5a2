"""Redundancy and singular positions along a motion."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mbref.design.start import diagnosed_start
from mbref.equations.branches import MOST_BRANCHED_ROWS as MOST_BRANCHED
from mbref.equations.branches import second_order
from mbref.equations.counts import RANK_TOLERANCE, scaled_jacobian
from mbref.equations.gaps import is_closed
from mbref.equations.initial_state import solve_positions
from mbref.equations.model import Model, displaced, poses
from mbref.equations.offsets import assembled
from mbref.linear_algebra.least_norm import null_space
from mbref.motions.crossing import Crossing
from mbref.motions.motion import Motion
from mbref.motions.trajectory import Outcome
from mbref.scene import Scene, SceneError
from mbref.scenes import find_scene
from mbref.simulation.simulate import Limits, simulate
from mbref.stepping.run import NEARLY

POSES_ALONG = 61  # poses of a motion at which ranks are computed
MOST_ROWS_ALONG = 300  # constraint rows; for more, singular values at every pose take too long
SAME_POSE = 1e-9  # relative difference below which two poses count as equal
POSES = 5  # poses at which degrees of freedom are tested to second order
MOST_STEPS_ALONG = 20_000  # steps of the diagnosis; of a longer motion only the first part is diagnosed


@dataclass(frozen=True)
class AlongMotion:
    """Ranks and singular values of Φ_q, rows of unit length, at the poses of a motion from t = 0.

    Attributes
    ----------
    end : float
        Time of the last pose, s.
    moves : bool
        Whether the poses differ.
    rank : int
        Rank at most poses.
    redundant : int
        Number of rows minus the rank.
    by_rounding : tuple of float
        Singular values that are small at every pose but not zero: rows that are redundant up to rounding in
        the scene's numbers.
    nearest : float
        Least ratio of the smallest to the largest singular value of a pose: 0 in a singular position.
    nearest_time : float
        Time of this pose, s.
    crossings : tuple of Crossing
        Singular positions that the motion passes.
    shaky : bool
        Whether at every pose the equations of second order forbid velocities that the equations of first
        order allow (A. Müller, Mech. Mach. Theory 2016).
    stopped : str
        Why the motion ended before the scene's duration; empty for a complete motion.
    """

    end: float
    moves: bool
    rank: int
    redundant: int
    by_rounding: tuple[float, ...]
    nearest: float
    nearest_time: float
    crossings: tuple[Crossing, ...]
    shaky: bool
    stopped: str


def along_motion(scene: Scene | str | Path) -> AlongMotion:
    """Return ranks and singular positions along the motion by the default method over the scene's duration.

    Parameters
    ----------
    scene : Scene, str or path
        The mechanism, the name of a built-in one, or a .toml file.

    Raises
    ------
    SceneError
        If the scene cannot be simulated, or has more than 300 rows.
    """
    scene = find_scene(scene)
    model = Model(assembled(scene))
    if model.m > MOST_ROWS_ALONG:
        raise SceneError([f"scene: {model.m} constraint rows are too many for singular values at every pose"])
    times = np.linspace(0.0, scene.duration, POSES_ALONG)
    motion = simulate(scene, None, times, Limits(most_steps=MOST_STEPS_ALONG))
    if not motion.times.size:  # rounding of joint axes may be the cause
        limits = Limits(most_steps=MOST_STEPS_ALONG, rank_tolerance=NEARLY)
        motion = simulate(scene, None, times, limits)
    if not motion.times.size:
        raise SceneError([f"scene: the motion could not begin: {motion.message}"])
    values = _singular_values(model, motion.times, motion.position, motion.orientation)
    return _summary(model, motion, values)


def _singular_values(
    model: Model, times: np.ndarray, position: np.ndarray, orientation: np.ndarray
) -> np.ndarray:
    """Return relative singular values (k, min(m, n)), largest first, at poses of the scene's bodies."""
    found = []
    for t, q in zip(times, poses(model, position, orientation), strict=True):
        s = np.linalg.svd(scaled_jacobian(model, float(t), q), compute_uv=False)
        found.append(s / s[0] if s.size else s)
    return np.array(found)


def _is_rigid_to_second_order(model: Model, motion: Motion) -> bool:
    """Return whether equations of second order forbid all velocities at every tested pose."""
    if model.m > MOST_BRANCHED or model.closed_loops == 0:
        return False
    chosen = np.linspace(0, len(motion.times) - 1, POSES).round().astype(int)
    places = poses(model, motion.position[chosen], motion.orientation[chosen])
    at_rest = np.zeros(model.n)
    orders = (
        second_order(model, float(t), q, at_rest) for t, q in zip(motion.times[chosen], places, strict=True)
    )
    return all(len(order.forms) for order in orders)


def _summary(model: Model, motion: Motion, values: np.ndarray) -> AlongMotion:
    times = motion.times
    ranks = np.sum(values > NEARLY, axis=1)
    rank = int(ranks.max(initial=0))
    small = values[:, rank:].max(axis=0, initial=0.0)
    nearest = values[:, rank - 1] if rank else np.zeros(len(times))
    at = int(np.argmax(nearest <= nearest.min() * (1 + SAME_POSE)))
    moved = np.ptp(motion.position, axis=0).max() / model.length, np.ptp(motion.orientation, axis=0).max()
    return AlongMotion(
        end=float(times[-1]),
        moves=bool(max(moved) > SAME_POSE),
        rank=rank,
        redundant=model.m - rank,
        by_rounding=tuple(small[small > RANK_TOLERANCE].tolist()),
        nearest=float(nearest[at]),
        nearest_time=float(times[at]),
        crossings=tuple(motion.crossings or ()),
        shaky=_is_rigid_to_second_order(model, motion),
        stopped="" if motion.outcome is Outcome.COMPLETED else motion.message,
    )


def general_pose(model: Model, seed: int = 1) -> np.ndarray:
    """Return coordinates (7 nb,) of a random pose near the start that satisfies the joints."""
    q, random = diagnosed_start(model).q, np.random.default_rng(seed)
    if model.m > MOST_ROWS_ALONG:
        return q
    for _ in range(5):
        free = null_space(scaled_jacobian(model, 0.0, q), NEARLY)
        if not free.size:
            return q
        step = free @ random.normal(size=free.shape[1])
        change = 0.1 * model.units * step / np.abs(step).max()
        moved, _ = solve_positions(model, 0.0, displaced(q, change))
        if not is_closed(model, model.terms(0.0, moved)):
            return q
        q = moved
    return q
