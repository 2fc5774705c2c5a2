"""Sparse LU factors of square matrices of one pattern, without exchange of rows.

An elimination with pivots at one matrix gives the order of rows and columns, see ``elimination_order``.
Matrices near it are factorised in this order. Factors stand by rows, without the ones on the diagonal of L.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from mbref.kernels.compilation import kernel
from mbref.kernels.named_memory import Indices


class LuPattern(NamedTuple):
    """Columns of the entries of L and U by rows, and the places of the diagonal among them."""

    start: Annotated[Indices, "r + 1"]
    column: Annotated[Indices, "factors"]
    diagonal: Annotated[Indices, "r"]


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
