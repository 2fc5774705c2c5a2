"""Angles of joints at a pose, counted over full turns from pose to pose."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import numpy as np

from mbref.equations.joint_angles import angles_of_pose
from mbref.equations.model import Model


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


def slots(model: Model) -> int:
    """Return the number of counted angles."""
    return int(model.memory.values.angles.size)


def sprung(model: Model) -> np.ndarray:
    """Return the loads (k,) that are torsion springs, by their place among the loads of the equations."""
    loads = model.data.loads
    return np.flatnonzero((loads.angle >= 0) & (loads.stiffness > 0.0))


def spring_angles(model: Model, angles: np.ndarray) -> dict[int, float]:
    """Return the angle (rad) of each load about an axis, by its number in the scene."""
    of = model.data.loads.angle
    return {k: float(angles[of[k]]) for k in range(len(of)) if of[k] >= 0}
