"""Bound on the error of a reference, from the difference of independently computed motions.

The bound is SAFETY times the largest difference so far, and never less than LEAST.  In test scenes with
truths of forty digits, let d be the difference of the two formulations: the error of A was at most 1.5 d, of
B at most 2.5 d. A second run of A can by chance be nearer to the first run than to the true motion; SAFETY
allows a factor of ten for that.
"""

from __future__ import annotations

import numpy as np

from crosscheck.judge.arithmetic import doubles
from crosscheck.judge.constraints import scene_length
from crosscheck.judge.reference.motion import Motion
from mbref.scene import Scene

SAFETY = 10.0
LEAST = 1e-14
"""Errors that the doubles of a scene and of the samples leave open: positions are rounded to 1e-16
of themselves, and rows of loops that are redundant contradict each other by as much."""
USEFUL = 1e-6
"""A larger bound is no reference: the motions took different ways, as at a singular position."""


def differences(scene: Scene, one: Motion, other: Motion) -> np.ndarray:
    """Return the difference (k,) of two motions at the samples that both reached: the larger of
    distance, over the scene's length, and angle (rad)."""
    k = min(len(one.times), len(other.times))
    apart = doubles(one.position[:k] - other.position[:k])
    distance = np.linalg.norm(apart, axis=-1).max(axis=1, initial=0.0) / scene_length(scene)
    return np.maximum(distance, _angles(one.orientation[:k], other.orientation[:k]).max(axis=-1, initial=0.0))


def bounds(apart: np.ndarray) -> np.ndarray:
    """Return bounds (k,) on the error at each sample, from the differences (k,) of the motions."""
    return np.maximum(SAFETY * np.maximum.accumulate(apart), LEAST)


def rounding(scene: Scene, motion: Motion) -> np.ndarray:
    """Return the rounding error (k,) of a motion's positions in double precision, over the scene's length.

    Far from the origin it exceeds LEAST.
    """
    farthest = np.linalg.norm(doubles(motion.position), axis=-1).max(axis=1, initial=0.0)
    return np.finfo(float).eps * farthest / scene_length(scene)


def _angles(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the angles (k, nb) between orientations (k, nb, 4), exact to the rounding of the arithmetic."""
    pw, qw, pv, qv = p[..., :1], q[..., :1], p[..., 1:], q[..., 1:]
    across = np.stack(
        [pv[..., i - 2] * qv[..., i - 1] - pv[..., i - 1] * qv[..., i - 2] for i in range(3)], -1
    )
    relative = doubles(pw * qv - qw * pv - across)
    along = doubles((p * q).sum(axis=-1))
    return 2 * np.arctan2(np.linalg.norm(relative, axis=-1), np.abs(along))
