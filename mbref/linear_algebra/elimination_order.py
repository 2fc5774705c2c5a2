"""The order in which a sparse matrix is eliminated, and the pattern of its LU factors in this order."""

from __future__ import annotations

import numpy as np

from mbref.linear_algebra.ordered_lu import LuPattern


def elimination_order(matrix: np.ndarray, pattern: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the orders (r,) of rows and of columns in which a matrix (r, r) is eliminated, with few new
    entries and large pivots; ``pattern`` (r, r) is true at its possible entries."""
    if not matrix.size:
        return np.zeros(0, dtype=int), np.zeros(0, dtype=int)
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import splu

    column, row = np.nonzero(pattern.T)
    start = np.concatenate([[0], np.cumsum(pattern.sum(axis=0))])
    factors = splu(csc_array((matrix[row, column], row, start), shape=matrix.shape))
    return np.argsort(factors.perm_r), np.argsort(factors.perm_c)


def lu_pattern(pattern: np.ndarray) -> LuPattern:
    """Return the pattern of the factors of matrices whose possible entries are true in ``pattern`` (r, r)."""
    filled = pattern | np.eye(len(pattern), dtype=bool)
    for k in range(len(filled)):
        below = k + 1 + np.flatnonzero(filled[k + 1 :, k])
        filled[below, k + 1 :] |= filled[k, k + 1 :]
    row, column = np.nonzero(filled)
    start = np.concatenate([[0], np.cumsum(filled.sum(axis=1))])
    return LuPattern(start.astype(np.int64), column.astype(np.int64), np.flatnonzero(row == column))


def places_in_factors(pattern: LuPattern, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return the places among the factors of entries in rows and columns (e,)."""
    size = len(pattern.diagonal)
    keys = np.repeat(np.arange(size), np.diff(pattern.start)) * size + pattern.column
    return np.searchsorted(keys, rows * size + columns)
