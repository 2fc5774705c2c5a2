"""Random states at which the structure of equations is read.

An expression that is not identically zero does not vanish at a random state.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from mbref.equations.model import all_displaced


class RandomStates(NamedTuple):
    """Random states: k times as fractions of the duration, displacements (k, n) of the coordinates, and
    velocities (k, n)."""

    part: np.ndarray
    displacement: np.ndarray
    velocity: np.ndarray

    def of(self, displacing: np.ndarray, moving: np.ndarray | None = None) -> RandomStates:
        """Return states in which only these coordinates (n,) are displaced and only these velocities (n,) are
        nonzero."""
        velocity = np.zeros_like(self.velocity) if moving is None else moving * self.velocity
        return RandomStates(self.part, displacing * self.displacement, velocity)

    def about(self, q: np.ndarray, duration: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return times (k,) in s, coordinates (k, 7 nb) displaced from q (7 nb,), and velocities (k, n)."""
        return self.part * duration, all_displaced(q, self.displacement), self.velocity


@lru_cache(maxsize=64)
def random_states(seed: int, count: int, n: int) -> RandomStates:
    """Return ``count`` random states, which depend on the arguments only."""
    rng = np.random.default_rng(seed)
    drawn = [(rng.uniform(0.1, 1.0), rng.normal(size=n), rng.normal(size=n)) for _ in range(count)]
    part, displacement, velocity = map(np.array, zip(*drawn, strict=True))
    return RandomStates(part, displacement, velocity)
