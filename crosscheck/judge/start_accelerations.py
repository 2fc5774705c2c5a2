"""Accelerations at the start in two runs of a scene: difference, and errors by Gauss's principle."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from crosscheck.judge.constraints import scene_length
from crosscheck.judge.gauss_principle import gauss
from crosscheck.judge.metrics import in_scene_order
from crosscheck.judge.model_identity import acceleration_scale
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

REST = 1e-6  # of the accelerations that the scene can have: smaller ones are rounding


class Starts(NamedTuple):
    """Largest difference of two runs' accelerations at the first sample, and their errors, relative to the
    largest acceleration. Errors are NaN for scenes without masses."""

    apart: float
    errors: tuple[float, float]


def starts(scene: Scene, first: Trajectory, second: Trajectory) -> Starts | None:
    """Return the difference of two runs that begin at t = 0; None if one of them has no accelerations, or if
    nothing accelerates the scene."""
    found = [_of_run(scene, in_scene_order(scene, run)) for run in (first, second)]
    if found[0] is None or found[1] is None:
        return None
    least, apart = REST * acceleration_scale(scene), _size(found[1] - found[0])
    if not least:
        return None
    if not scene.has_mass():
        return Starts(apart / max(*map(_size, found), least), (math.nan, math.nan))
    exact = gauss(scene)
    errors = [_size(one - exact) / max(_size(exact), least) for one in found]
    return Starts(apart / max(*map(_size, found), least), (errors[0], errors[1]))


def _of_run(scene: Scene, run: Trajectory) -> np.ndarray | None:
    """Return accelerations (2 nb, 3) at the first sample, m/s²; angular ones times the scene's length."""
    if run.acceleration is None or run.angular_acceleration is None or not len(run.times):
        return None
    return np.vstack([run.acceleration[0], scene_length(scene) * run.angular_acceleration[0]])


def _size(vectors: np.ndarray | None) -> float:
    return 0.0 if vectors is None else float(np.linalg.norm(vectors, axis=-1).max())
