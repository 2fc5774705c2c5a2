"""Mechanisms that cannot move: their constraint rows leave no degree of freedom, and no driver moves them."""

from __future__ import annotations

import numpy as np

from crosscheck.judge import constraints
from crosscheck.judge.tolerances import TRUTH_DRIVEN
from crosscheck.judge.truth.one_dof import freedoms_at, trajectory
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene


class Locked:
    """Truth of a scene that does not move."""

    name = "locked"
    accuracy = TRUTH_DRIVEN

    def __init__(self, scene: Scene):
        self._scene = scene

    def poses(self, times: np.ndarray) -> Trajectory:
        """Return the trajectory at times (k,) ≥ 0."""
        times = np.asarray(times, dtype=float)
        position, orientation = constraints.initial_poses(self._scene)
        k, rest = len(times), np.zeros((len(times), *position.shape))
        rotation = np.broadcast_to(rotations.to_matrix(orientation), (k, len(position), 3, 3))
        placed = np.broadcast_to(position, rest.shape)
        return trajectory(self._scene, self.name, times, placed, rotation, (rest, rest), (rest, rest))


def locked(scene: Scene) -> Locked | None:
    """Return the truth of a scene whose rows have full column rank at the start, or None."""
    rows = sum(len(lengths) for lengths in constraints.length_rows(scene).values())
    if scene.driver or rows < 6 * len(scene.body):
        return None
    return None if freedoms_at(scene, *constraints.initial_poses(scene)) else Locked(scene)
