"""Angles of joints of a model, and the loads that need them."""

from __future__ import annotations

import numpy as np

from mbref.equations.model import Model


def slots(model: Model) -> int:
    """Return the number of counted angles."""
    return int(model.memory.values.angles.size)


def sprung(model: Model) -> np.ndarray:
    """Return the loads (k,) that are torsion springs, by their place among the loads of the equations."""
    loads = model.data.loads
    return np.flatnonzero((loads.angle >= 0) & (loads.stiffness > 0.0))
