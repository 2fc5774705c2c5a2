"""Residuals of a wheel that rolls without slip, from the relative motion of its frame and its plane's frame.

The first frame is in the plane, its third axis is the normal, and its first axis is along the line if the
wheel rolls along one.  The second frame is at the wheel's centre, its third axis d is the wheel's axis.
Vectors here are resolved in the first frame, (…, 3).  With the unit vector e in the wheel's plane that points
up most steeply, the lowest point is R e below the centre; the velocity of the wheel there has the residuals.
"""

from __future__ import annotations

import numpy as np

from mbref.rotations import cross

UPWARDS = np.array([0.0, 0.0, 1.0])


def height(axis: np.ndarray, centre: np.ndarray, radius: float) -> np.ndarray:
    """Return the height (…,) of the lowest point over the plane, m."""
    return np.asarray(centre[..., 2] - radius * np.hypot(axis[..., 0], axis[..., 1]))


def slip(axis: np.ndarray, radius: float, velocity: np.ndarray, spin: np.ndarray) -> np.ndarray:
    """Return the velocity (…, 3) of the wheel at its lowest point: along the normal first."""
    up, _ = _upwards(axis, np.zeros_like(axis))
    return _normal_first(velocity - radius * cross(spin, up))


def slip_rate(
    axis: np.ndarray,
    radius: float,
    twist: tuple[np.ndarray, np.ndarray],
    rate: tuple[np.ndarray, np.ndarray],
) -> np.ndarray:
    """Return the time derivative (…, 3) of ``slip``, from the twist (velocity and spin) and its rate."""
    (_, spin), (acceleration, bend) = twist, rate
    up, turning = _upwards(axis, cross(spin, axis))
    return _normal_first(acceleration - radius * (cross(bend, up) + cross(spin, turning)))


def _upwards(axis: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return e (…, 3), and its time derivative for the rate of the axis."""
    across = cross(axis, np.broadcast_to(UPWARDS, axis.shape))  # horizontal, in the wheel's plane
    size = np.linalg.norm(across, axis=-1, keepdims=True)
    level = across / size
    turning = cross(rate, np.broadcast_to(UPWARDS, axis.shape)) / size
    turning = turning - level * np.sum(level * turning, axis=-1, keepdims=True)
    return cross(level, axis), cross(turning, axis) + cross(level, rate)


def _normal_first(vector: np.ndarray) -> np.ndarray:
    return np.asarray(vector[..., [2, 0, 1]])
