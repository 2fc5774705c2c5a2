"""Solutions of least norm, and the null space, of dense equations: by QR if the rank is certain.

Aᵀ P = Q R with column pivoting.  The rank is certain if the last nonzero pivot is at least NONZERO_PIVOT, for
rows of length one, and the remaining entries are rounding. If the rank is not certain, or equations
contradict each other, singular values decide; these take four times as long.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from mbref.kernels.compilation import FLOAT, INT, entry, kernel
from mbref.kernels.memory_pool import acquire, release
from mbref.kernels.named_memory import Indices, Matrix, Named, Vector, allocate
from mbref.linear_algebra.orthogonal_factorisations import apply_reflectors, minimum_norm, qr_pivoted

NONZERO_PIVOT, ZERO_PIVOT = 1e-3, 1e-11  # pivot / longest row: nonzero above, zero below
CONSISTENT = 1e-13  # residual of a consistent row / largest entry of the solution
UNCLEAR = -1


class Scratch(NamedTuple):
    """The factors of ``qr_pivoted``, the solution, and an orthonormal basis of the null space as rows."""

    transposed: Annotated[Matrix, "n", "m"]
    order: Annotated[Indices, "m"]
    tau: Annotated[Vector, "m"]
    work: Annotated[Vector, "m"]
    norms: Annotated[Matrix, 2, "m"]
    b: Annotated[Vector, "m"]
    x: Annotated[Vector, "n"]
    solution: Annotated[Vector, "n"]
    basis: Annotated[Matrix, "n", "n"]


@kernel
def largest_left(rank, transposed):
    """Return the largest remaining entry after the given number of pivots."""
    largest = 0.0
    for i in range(rank, transposed.shape[0]):
        for j in range(rank, transposed.shape[1]):
            largest = max(largest, abs(transposed[i, j]))
    return largest


@entry(INT(FLOAT, Named(Scratch)))
def solve_clearly(tolerance, scratch):
    """Compute the solution and, in the first rows, the basis of the null space; return the rank, or UNCLEAR
    without a result.

    A pivot is nonzero if it exceeds ``tolerance`` times the longest row.
    """
    rank, n = qr_pivoted(tolerance, scratch), scratch.x.shape[0]
    if rank > 0 and abs(scratch.transposed[rank - 1, rank - 1]) < NONZERO_PIVOT:
        return UNCLEAR
    if largest_left(rank, scratch.transposed) > ZERO_PIVOT:
        return UNCLEAR
    minimum_norm(rank, scratch)
    for i in range(n):
        scratch.solution[i] = scratch.x[i]
    for k in range(rank, n):
        scratch.x[:] = 0.0
        scratch.x[k] = 1.0
        apply_reflectors(rank, scratch)
        for i in range(n):
            scratch.basis[k - rank, i] = scratch.x[i]
    return rank


def least_norm(matrix: np.ndarray, rhs: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the solution x (n,) of A x = b, of least squares and least norm, and an orthonormal basis (n, k)
    of the null space.

    The rows of A (m, n) have at most length one; singular values below ``tolerance`` times the largest count
    as zero.
    """
    m, n = matrix.shape
    if not matrix.size:
        return np.zeros(n), np.eye(n)
    memory = acquire((Scratch, m, n), lambda: allocate(Scratch, {"m": m, "n": n}))
    scratch = memory.values
    scratch.transposed[:], scratch.b[:] = matrix.T, rhs
    rank = int(solve_clearly(tolerance, memory.packed.argument))
    x, basis = scratch.solution.copy(), scratch.basis[: n - rank].T.copy()
    release(memory)
    if rank == UNCLEAR or np.abs(matrix @ x - rhs).max() > CONSISTENT * max(1.0, np.abs(x).max()):
        return _by_singular_values(matrix, rhs, tolerance)
    return x, basis


def _by_singular_values(
    matrix: np.ndarray, rhs: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    u, values, vt = np.linalg.svd(matrix)
    rank = int(np.sum(values > tolerance * values[0]))
    return vt[:rank].T @ ((u[:, :rank].T @ rhs) / values[:rank]), vt[rank:].T
