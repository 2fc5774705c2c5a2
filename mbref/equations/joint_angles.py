"""Angles of joints that turn about one axis, as columns by joint, and at one pose."""

from __future__ import annotations

import numpy as np

from mbref import rotations
from mbref.equations.model import Model
from mbref.equations.structure import Structure
from mbref.scene import Scene


def angles_by_joint(scene: Scene, structure: Structure, angles: np.ndarray) -> dict[str, np.ndarray]:
    """Return the angles (k, a) of turning joints in a run, rad, as columns (k,) by joint of the scene."""
    columns = {place.joint: angles[:, k] for k, place in enumerate(structure.places.turning)}
    return {j.name: columns[j.name] for j in scene.joint if j.name in columns}


def angles_of_pose(model: Model, q: np.ndarray) -> np.ndarray:
    """Return the angles (a,) of turning joints at coordinates q (7 nb,), rad, within half a turn."""
    turning = model.data.turning
    p = np.concatenate([q.reshape(-1, 7)[:, 3:], [[1.0, 0.0, 0.0, 0.0]]])
    x, y = (rotations.rotate(p[turning.first], each) for each in (turning.x_first, turning.y_first))
    u = rotations.rotate(p[turning.second], turning.x_second)
    return np.asarray(np.arctan2((u * y).sum(axis=1), (u * x).sum(axis=1)))
