"""Errors of motions against exact states: positions by the mechanism's length, rotations in rad."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from mbref.motions.trajectory import Trajectory


def turned_between(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the angles (…,), rad, of the relative rotations of two orientations (…, 4)."""
    w = np.einsum("...i,...i->...", first, second)
    v = first[..., :1] * second[..., 1:] - second[..., :1] * first[..., 1:]
    v = v - np.cross(first[..., 1:], second[..., 1:])
    return 2 * np.arctan2(np.linalg.norm(v, axis=-1), np.abs(w))


def pose_error(found: Trajectory, exact: Mapping[str, Any]) -> float:
    """Return the largest error of a position, relative to the largest distance, or of a rotation, rad."""
    position = np.array(exact["position"])
    length = max(1e-300, np.abs(position).max())
    off = np.linalg.norm(found.position - position, axis=-1).max(initial=0.0) / length
    return float(max(off, turned_between(found.orientation, np.array(exact["orientation"])).max(initial=0.0)))


def rate_error(found: Trajectory, exact: Mapping[str, Any]) -> float:
    """Return the largest error of a velocity or angular velocity, relative to the largest rate."""
    velocity, spin = np.array(exact["velocity"]), np.array(exact["angular_velocity"])
    length = np.abs(np.array(exact["position"])).max()
    fastest = max(np.abs(velocity).max(), length * np.abs(spin).max())
    off = np.abs(found.velocity - velocity).max(), length * np.abs(found.angular_velocity - spin).max()
    return float(max(off) / fastest)
