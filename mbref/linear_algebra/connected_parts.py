"""Connected parts of a graph."""

from __future__ import annotations

import numpy as np


def connected_parts(size: int, pairs: np.ndarray) -> np.ndarray:
    """Return for each of ``size`` nodes the number of the part to which pairs (p, 2) of nodes connect it."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    graph = csr_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(size, size))
    label: np.ndarray = connected_components(graph, directed=False)[1]
    return label
