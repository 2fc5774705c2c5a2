"""Places of bodies and joints in the world, from the frames in which libraries give them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from crosscheck.engines.loaders.machine import Body, Vector, matrix, vector
from mbref import rotations


class Place(NamedTuple):
    """Position (3,) and rotation matrix (3, 3) of a frame."""

    position: np.ndarray
    turn: np.ndarray

    def then(self, inner: Place) -> Place:
        """Return the place of a frame that is given in this frame."""
        return Place(self.position + self.turn @ inner.position, self.turn @ inner.turn)

    def inverse(self) -> Place:
        """Return the place of the outer frame in this frame."""
        return Place(-self.turn.T @ self.position, self.turn.T)

    def point(self, local: Any) -> Vector:
        """Return the world coordinates of a point of this frame."""
        return vector(self.position + self.turn @ np.asarray(local, float))

    def direction(self, local: Any) -> Vector:
        """Return the world components of a vector of this frame."""
        return vector(self.turn @ np.asarray(local, float))

    def body(self, name: str, mass: Any, centre: Any, inertia: Any) -> Body:
        """Return a body whose centre and inertia about it (3, 3) are given in this frame."""
        turned = self.turn @ np.asarray(inertia, float).reshape(3, 3) @ self.turn.T
        return Body(name, float(mass), self.point(centre), matrix(turned))


ORIGIN = Place(np.zeros(3), np.eye(3))


def of_matrix(transform: Any) -> Place:
    """Return the place of a homogeneous matrix (4, 4)."""
    found = np.asarray(transform, float)
    return Place(found[:3, 3], found[:3, :3])


def of_xyzw(position: Any, quaternion: Any) -> Place:
    """Return the place of a position and a quaternion (x, y, z, w)."""
    x, y, z, w = quaternion
    return Place(np.asarray(position, float), rotations.to_matrix(np.array([w, x, y, z], float)))


def of_rpy(position: Any, angles: Any) -> Place:
    """Return the place of a position and angles about the fixed axes x, y and z, in this order."""
    vectors = np.diag(np.asarray(angles, float))
    roll, pitch, yaw = (rotations.to_matrix(rotations.from_vector(v)) for v in vectors)
    return Place(np.asarray(position, float), yaw @ pitch @ roll)


def vector_of(turn: np.ndarray) -> np.ndarray:
    """Return the rotation vector (3,) of a rotation matrix, rad."""
    return np.asarray(rotations.to_vector(rotations.from_matrix(turn)[None])[0])


def turned(anchor: Any, axis: Any, angle: float) -> Place:
    """Return the displacement of the world by a rotation of axis · angle about a point."""
    turn = rotations.to_matrix(rotations.from_vector(np.asarray(axis, float) * angle))
    at = np.asarray(anchor, float)
    return Place(at - turn @ at, turn)
