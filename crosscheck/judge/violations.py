"""Violations of joints, drivers and couplings along a trajectory, at three levels."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, overload

import numpy as np

from crosscheck.judge import constraints
from crosscheck.judge.coupling_laws import unwound
from mbref.motions.trajectory import PER_BODY, Trajectory
from mbref.scene import Scene


@overload
def violation_series(scene: Scene, trajectory: Trajectory, level: Literal[0, 1] = 0) -> np.ndarray:
    """Return the residuals at position or velocity level, which every trajectory has."""


@overload
def violation_series(scene: Scene, trajectory: Trajectory, level: int) -> np.ndarray | None:
    """Return the residuals at any level."""


def violation_series(scene: Scene, trajectory: Trajectory, level: int = 0) -> np.ndarray | None:
    """Return the largest joint residual (k,) at position (0), velocity (1) or acceleration (2) level. Lengths
    are divided by the scene's length, so that the unit is rad, rad/s, rad/s². None if accelerations are
    missing.

    At position level the residual is NaN from the first sample on at which full turns of a coupled joint
    cannot be counted."""
    scenes = unwound(scene, trajectory) if level else [scene]
    if all(each is scene for each in scenes):
        return _violations(scene, trajectory, level)
    found = [_violations(each, _sample(trajectory, k), level) for k, each in enumerate(scenes)]
    return np.concatenate([each for each in found if each is not None]) if found[0] is not None else None


def most_violated(scene: Scene, trajectory: Trajectory) -> str:
    """Return the name of the joint or coupling whose residual at position level is largest; a driver counts
    to its joint."""
    found = _residuals(scene, trajectory, 0) or {}
    sizes = {name: np.abs(rows).max(initial=0.0) for name, rows in found.items()}
    return max(sizes, key=lambda name: sizes[name], default="")


def _violations(scene: Scene, trajectory: Trajectory, level: int) -> np.ndarray | None:
    """Return ``violation_series``; above position level with angles of polynomial couplings within half a
    turn."""
    if (found := _residuals(scene, trajectory, level)) is None:
        return None
    rows = [np.zeros_like(trajectory.times)[:, None], *map(np.abs, found.values())]
    return np.concatenate(rows, axis=1).max(axis=1)


def _residuals(scene: Scene, trajectory: Trajectory, level: int) -> dict[str, np.ndarray] | None:
    """Return residuals (k, rows) by joint and coupling at a level, lengths over the scene's length."""
    pose = (trajectory.times, trajectory.position, trajectory.orientation)
    rates = (trajectory.velocity, trajectory.angular_velocity)
    if level == 0:
        residuals = constraints.closure(scene, *pose)
        gaps = constraints.coupling_gaps(scene, *pose, trajectory.angular_velocity, trajectory.angles)
        residuals |= gaps
    elif level == 1:
        residuals = constraints.closure_rates(scene, *pose, *rates)
    elif trajectory.acceleration is None or trajectory.angular_acceleration is None:
        return None
    else:
        second = (trajectory.acceleration, trajectory.angular_acceleration)
        residuals = constraints.closure_accelerations(scene, *pose, *rates, *second)
    length = constraints.scene_length(scene)
    are_lengths = constraints.length_rows(scene)
    return {name: r / np.where(are_lengths[name], length, 1.0) for name, r in residuals.items()}


def _sample(trajectory: Trajectory, k: int) -> Trajectory:
    """Return one sample of a trajectory, without angles."""
    keys = [key for key in ("times", *PER_BODY) if getattr(trajectory, key) is not None]
    return replace(trajectory, **{key: getattr(trajectory, key)[k : k + 1] for key in keys}, angles=None)
