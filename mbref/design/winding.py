"""Poses at which torsion springs with natural angles of many turns are relaxed."""

from __future__ import annotations

import numpy as np

from mbref.design.balance import ONE_POSE, STRIDE
from mbref.design.joint_angles import sprung
from mbref.design.linearisation import Tangent
from mbref.equations.joint_angles import angles_at
from mbref.equations.model import displaced

STRIDES = 2000  # largest number of strides towards the natural angles, about 100 turns
NUDGE = 1e-4  # rad or lengths; displacement that shows how a coordinate turns the springs
FAR = np.pi  # rad; twist of a spring from which its natural angle is sought


def wound(first: Tangent) -> Tangent:
    """Return the pose along the constraints at which torsion springs are nearest to their natural angles.

    The first pose is returned if no spring is twisted by more than half a turn.
    """
    loads, acting = first.model.data.loads, sprung(first.model)
    slots, natural = loads.angle[acting].astype(int), loads.natural[acting]
    here, twist = first, natural - first.angles[slots]
    if not np.abs(twist).max(initial=0.0) > FAR:
        return first
    for _ in range(STRIDES):
        step = np.linalg.lstsq(angle_derivatives(here, slots), twist, rcond=None)[0]
        size = float(np.linalg.norm(here.basis @ step)) or 1.0
        moved = here.moved(min(1.0, STRIDE / size) * step)
        if moved is None or moved.freedoms != first.freedoms:
            return here
        left = natural - moved.angles[slots]
        if not np.linalg.norm(left) < (1 - ONE_POSE) * np.linalg.norm(twist):
            return here
        here, twist = moved, left
    return here


def angle_derivatives(tangent: Tangent, slots: np.ndarray) -> np.ndarray:
    """Return the derivatives (k, f) of the springs' angles by the coordinates y."""
    model, found = tangent.model, []
    for direction in tangent.basis.T:
        q = displaced(tangent.q, NUDGE * model.units * direction)
        found.append((angles_at(model, q, tangent.angles) - tangent.angles)[slots] / NUDGE)
    return np.array(found).T
