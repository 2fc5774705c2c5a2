"""Vectors and frames for the adapters: joint frames, and world vectors at t = 0 in the axes of a body."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mbref import rotations
from mbref.rotations import unit
from mbref.scene import GROUND, Scene


def cross_matrix(v: np.ndarray) -> np.ndarray:
    """Return the matrix (3, 3) of the vector product v × ·."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def joint_frame(axis: np.ndarray | Sequence[float]) -> np.ndarray:
    """Return a rotation matrix (3, 3) whose last column is along ``axis`` (3,)."""
    z = unit(axis)
    x = unit(np.cross(np.eye(3)[np.argmin(np.abs(z))], z))
    return np.column_stack([x, np.cross(z, x), z])


def in_body(scene: Scene, name: str, vectors: np.ndarray) -> np.ndarray:
    """Return world vectors at t = 0 (…, 3) in the axes of a body."""
    if name == GROUND:
        return np.array(vectors, dtype=float)
    return vectors @ rotations.to_matrix(np.array(scene.body[scene.body_index(name)].orientation))


def point_in_body(scene: Scene, name: str, point: np.ndarray | Sequence[float]) -> np.ndarray:
    """Return a world point at t = 0 (3,) in the frame of a body."""
    start = np.zeros(3) if name == GROUND else np.array(scene.body[scene.body_index(name)].position)
    return in_body(scene, name, np.array(point) - start)
