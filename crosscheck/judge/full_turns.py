"""Full turns of joints in exact motions, counted at times that are dense enough."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from crosscheck.judge.constraints import joint_coordinates
from crosscheck.judge.coupling_laws import bent_couplings
from crosscheck.judge.joint_loads import turning_loads
from crosscheck.judge.pieces import has_pieces
from crosscheck.judge.truth import Truth
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

DENSE = 400  # least number of further times at which the exact motion is computed
UNEVEN = 0.3  # largest fraction of a step by which a further time is moved: it shows amplitudes over 0.4 rad
GOLDEN = (np.sqrt(5.0) - 1) / 2  # its multiples are spread evenly over fractions of one
FINEST = 16  # multiple of DENSE at which the search for full turns between samples ends


def counted_poses(scene: Scene, truth: Truth, times: np.ndarray) -> Trajectory:
    """Return the poses of a truth at times (k,), with the angles (k,) on which loads and couplings depend:
    their full turns are the same whatever the times are. In a scene whose constraints come and go they are
    left out: each piece counts from its begin.

    Raises NoSolution if the motion is not known up to the last time.
    """
    found = truth.poses(times)
    names = {load.joint for load in turning_loads(scene)} | {c.joints[0] for c in bent_couplings(scene)}
    if not names or has_pieces(scene) or not found.times.size:
        return found
    dense, motion = DENSE // 4, found
    while True:
        angles = {name: each for name, each in _angles(scene, motion).items() if name in names}
        if dense >= FINEST * DENSE or all(np.isfinite(angle).all() for angle in angles.values()):
            break
        dense *= 4
        motion = truth.poses(with_dense(times, dense))
    chosen = np.searchsorted(motion.times, found.times)
    return replace(found, angles={name: angle[chosen] for name, angle in angles.items()})


def with_dense(times: np.ndarray, dense: int) -> np.ndarray:
    """Return times (k,) and further times from 0 to their end. A further time has at least a tenth of a step
    to a given time.

    Steps are uneven, so that no oscillation has one rate at all times and looks like a steady turning.
    """
    part = np.arange(dense + 1.0)
    part[1:-1] += UNEVEN * (2 * (GOLDEN * part[1:-1] % 1.0) - 1)
    more = times[-1] * part / dense
    after = np.minimum(np.searchsorted(times, more), len(times) - 1)
    nearest = np.minimum(np.abs(times[after] - more), np.abs(times[np.maximum(after - 1, 0)] - more))
    return np.union1d(times, more[nearest > 0.1 * times[-1] / dense])


def _angles(scene: Scene, motion: Trajectory) -> dict[str, np.ndarray]:
    """Return the angles (k,) of joints since t = 0."""
    found = joint_coordinates(
        scene, motion.times, motion.position, motion.orientation, motion.angular_velocity
    )
    return {name: each[:, 0] for name, each in found.items()}
