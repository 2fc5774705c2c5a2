"""The force of a spring, which adapters apply to engines without springs between points."""

from __future__ import annotations

import numpy as np

from mbref.scene import Spring


def spring_force(spring: Spring, apart: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Return the force (…, 3), N, on the first body of a spring, from the vector ``apart`` (…, 3), m, between
    its ends and its rate, m/s. Ends that meet part along the rate; the damping force acts along it."""
    line = np.where((apart == 0.0).all(axis=-1, keepdims=True), rate, apart)
    size = np.sqrt(np.sum(line**2, axis=-1, keepdims=True))
    along = line / np.where(size > 0.0, size, 1.0)
    longer = np.sum(apart * along, axis=-1, keepdims=True) - spring.natural_length
    faster = np.sum(rate * along, axis=-1, keepdims=True)
    return np.asarray((spring.stiffness * longer + spring.damping * faster) * along)
