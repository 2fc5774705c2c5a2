"""Angles of joints that turn about one axis: as columns by joint, at one pose, and counted from pose to
pose."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

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


def angles_at(model: Model, q: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Return the angles (k,), rad, of turning joints at q (7 nb,), each nearest to its value ``before``.

    The values ``before`` are returned if no spring and no coupling needs an angle.
    """
    if not model.has_angles:
        return before
    angles = angles_of_pose(model, q)
    return np.asarray(angles + 2 * np.pi * np.round((before - angles) / (2 * np.pi)))


@contextlib.contextmanager
def counted_from(model: Model, angles: np.ndarray) -> Iterator[None]:
    """Evaluate the model's terms with angles nearest to the given ones (k,)."""
    reference = model.memory.values.angles
    reference[:] = angles
    try:
        yield
    finally:
        reference[:] = 0.0
