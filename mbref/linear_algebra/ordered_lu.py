"""Sparse LU factors of square matrices of one pattern, without exchange of rows.

The order of rows and columns is that of an elimination with pivots at one matrix, see ``elimination_order``.
Matrices near it are factorised in this order. Factors stand by rows, without the ones on the diagonal of L.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from mbref.kernels.compilation import kernel
from mbref.kernels.named_memory import Indices


class LuPattern(NamedTuple):
    """Columns of the entries of L and U by rows, and the places of the diagonal among them."""

    start: Annotated[Indices, "r + 1"]
    column: Annotated[Indices, "factors"]
    diagonal: Annotated[Indices, "r"]


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


@kernel
def factorise_in_order(values, work, pattern):
    """Replace a matrix, whose entries are at their places in ``values``, by its factors; a pivot of zero
    divides nothing. ``work`` (r,) is overwritten."""
    start, column, diagonal = pattern.start, pattern.column, pattern.diagonal
    for i in range(diagonal.shape[0]):
        for p in range(start[i], start[i + 1]):
            work[column[p]] = values[p]
        for p in range(start[i], diagonal[i]):
            j = column[p]
            pivot = values[diagonal[j]]
            factor = work[j] / pivot if pivot != 0.0 else 0.0
            work[j] = factor
            for q in range(diagonal[j] + 1, start[j + 1]):
                work[column[q]] -= factor * values[q]
        for p in range(start[i], start[i + 1]):
            values[p] = work[column[p]]


@kernel
def solve_in_order(values, x, pattern):
    """Solve with factors; x (r,) becomes the solution."""
    start, column, diagonal = pattern.start, pattern.column, pattern.diagonal
    for i in range(x.shape[0]):
        for p in range(start[i], diagonal[i]):
            x[i] -= values[p] * x[column[p]]
    for i in range(x.shape[0] - 1, -1, -1):
        for p in range(diagonal[i] + 1, start[i + 1]):
            x[i] -= values[p] * x[column[p]]
        x[i] /= values[diagonal[i]]


@kernel
def solve_transposed_in_order(values, x, pattern):
    """Solve with the transposed matrix of factors; x (r,) becomes the solution."""
    start, column, diagonal = pattern.start, pattern.column, pattern.diagonal
    for i in range(x.shape[0]):
        x[i] /= values[diagonal[i]]
        for p in range(diagonal[i] + 1, start[i + 1]):
            x[column[p]] -= values[p] * x[i]
    for i in range(x.shape[0] - 1, -1, -1):
        for p in range(start[i], diagonal[i]):
            x[column[p]] -= values[p] * x[i]
