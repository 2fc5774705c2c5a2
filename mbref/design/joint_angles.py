"""Angles of torsion springs and couplings at a pose, counted over full turns from pose to pose."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import numpy as np

from mbref import rotations
from mbref.equations.model import Model


def angles_at(model: Model, q: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Return the angles (k,), rad, of loads about axes and of couplings at q (7 nb,), each nearest to its
    value ``before``."""
    loads, primitives = model.data.loads, model.data.primitives
    found = before.copy()
    for part, x, y, u in (
        (loads, loads.x_first, loads.y_first, loads.x_second),
        (primitives, primitives.direction_first, primitives.turning_first, primitives.direction_second),
    ):
        for k in np.flatnonzero(part.angle >= 0):
            first, second = int(part.first[k]), int(part.second[k])
            along, across = _in_world(model, q, first, x[k]), _in_world(model, q, first, y[k])
            turned = _in_world(model, q, second, u[k])
            angle, slot = np.arctan2(turned @ across, turned @ along), part.angle[k]
            found[slot] = angle + 2 * np.pi * np.round((before[slot] - angle) / (2 * np.pi))
    return found


def _in_world(model: Model, q: np.ndarray, body: int, vector: np.ndarray) -> np.ndarray:
    return vector if body == model.nb else rotations.rotate(q.reshape(model.nb, 7)[body, 3:], vector)


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


def spring_angles(model: Model, angles: np.ndarray) -> dict[int, float]:
    """Return the angle (rad) of each load about an axis, by its number in the scene."""
    of = model.data.loads.angle
    return {k: float(angles[of[k]]) for k in range(len(of)) if of[k] >= 0}
