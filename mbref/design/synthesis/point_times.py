"""Times at which a motion comes nearest to points, in their order."""

from __future__ import annotations

import numpy as np


def nearest_in_order(distances: np.ndarray) -> np.ndarray:
    """Return increasing samples (k,) for k points with the least sum of distances (k, samples), by dynamic
    programming."""
    count, samples = distances.shape
    total, before = distances[0], np.zeros((count, samples), dtype=int)
    for i in range(1, count):
        least = np.minimum.accumulate(total)
        places = np.maximum.accumulate(np.where(total == least, np.arange(samples), 0))
        before[i, 1:] = places[:-1]
        total = distances[i] + np.append(np.inf, least[:-1])
    found = [int(np.argmin(total))]
    for i in range(count - 1, 0, -1):
        found.append(int(before[i, found[-1]]))
    return np.array(found[::-1])
