"""Principal frames of bodies: moments of inertia, and rotations from the frames to the bodies' own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mbref import rotations
from mbref.scene import Body


def quaternions(axes: Sequence[np.ndarray | None]) -> np.ndarray:
    """Return quaternions (k, 4) of rotation matrices, where None means no rotation."""
    if all(each is None for each in axes):
        unturned = np.zeros((len(axes), 4))
        unturned[:, 0] = 1.0
        return unturned
    return rotations.from_matrix(np.array([np.eye(3) if each is None else each for each in axes]))


def numbers_of_body(body: Body) -> tuple[tuple[float, ...], np.ndarray | None]:
    """Return position, orientation, mass and principal moments of a body, and the rotation from the principal
    frame to its own frame (None if both frames are equal)."""
    mass = 1.0 if body.mass is None else body.mass
    moments, axes = _principal_axes(body.inertia)
    return (*body.position, *body.orientation, mass, *moments), axes


def _principal_axes(inertia: Any) -> tuple[Sequence[float], np.ndarray | None]:
    """Return principal moments and the rotation from the principal frame to the body's frame; None if both
    frames are equal."""
    if inertia is None:
        return (1.0, 1.0, 1.0), None
    if not isinstance(inertia[0], tuple):
        return inertia, None
    moments, axes = np.linalg.eigh(np.array(inertia))
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    return np.maximum(moments, 0.0), axes
