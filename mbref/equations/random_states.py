"""Random states at which the structure of equations is read.

An expression that is not zero everywhere does not vanish there.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np


class RandomState(NamedTuple):
    """A time as a part of the duration, a displacement (n,) of the coordinates, and velocities (n,)."""

    part: float
    displacement: np.ndarray
    velocity: np.ndarray


@lru_cache(maxsize=64)
def random_states(seed: int, count: int, n: int) -> tuple[RandomState, ...]:
    """So many states, the same for the same arguments."""
    rng = np.random.default_rng(seed)
    return tuple(
        RandomState(rng.uniform(0.1, 1.0), rng.normal(size=n), rng.normal(size=n)) for _ in range(count)
    )
