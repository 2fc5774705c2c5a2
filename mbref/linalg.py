"""Dense factorisations that decide rank: LU with partial and full pivoting, pivoted QR, pseudo-inverse.

Small matrices by hand, because a call of LAPACK costs more than the work; the singular value
decomposition by LAPACK.  All work in place on C-contiguous arrays given by the caller.
"""

from __future__ import annotations

import numpy as np
from numpy import isfinite, sqrt

from mbref.compiled import kernel


@kernel
def lu_factor(a, n, pivots, tolerance):
    """LU with partial pivoting of a[:n, :n], in place; False where a pivot is ≤ tolerance.

    ``pivots`` (n,) receives the row exchanged with each row.
    """
    for k in range(n):
        best, size = k, abs(a[k, k])
        for i in range(k + 1, n):
            if abs(a[i, k]) > size:
                best, size = i, abs(a[i, k])
        pivots[k] = best
        if not size > tolerance:
            return False
        if best != k:
            for j in range(n):
                a[k, j], a[best, j] = a[best, j], a[k, j]
        inverse = 1.0 / a[k, k]
        for i in range(k + 1, n):
            factor = a[i, k] * inverse
            a[i, k] = factor
            if factor != 0.0:
                for j in range(k + 1, n):
                    a[i, j] -= factor * a[k, j]
    return True


@kernel
def lu_solve(a, n, pivots, b):
    """Solve with the factors of ``lu_factor``; b (n,) becomes the solution."""
    for k in range(n):
        p = pivots[k]
        if p != k:
            b[k], b[p] = b[p], b[k]
        for j in range(k):
            b[k] -= a[k, j] * b[j]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            b[k] -= a[k, j] * b[j]
        b[k] /= a[k, k]


@kernel
def full_pivot(a, m, n, rows, columns, tolerance):
    """Gaussian elimination with full pivoting of a[:m, :n], in place; returns the rank (Eq. 10).

    ``rows`` (m,) and ``columns`` (n,) receive the order of elimination: the first ``rank`` columns are
    the dependent coordinates, the rest independent; the last rows are redundant.  A pivot counts when
    it exceeds ``tolerance`` times the first.
    """
    for i in range(m):
        rows[i] = i
    for j in range(n):
        columns[j] = j
    first = 0.0
    for k in range(min(m, n)):
        best_row, best_column, size = k, k, 0.0
        for i in range(k, m):
            for j in range(k, n):
                if abs(a[i, j]) > size:
                    best_row, best_column, size = i, j, abs(a[i, j])
        if k == 0:
            first = size
        if not size > tolerance * first:
            return k
        exchange_rows(a, n, k, best_row, rows)
        exchange_columns(a, m, k, best_column, columns)
        inverse = 1.0 / a[k, k]
        for i in range(k + 1, m):
            factor = a[i, k] * inverse
            a[i, k] = factor
            if factor != 0.0:
                for j in range(k + 1, n):
                    a[i, j] -= factor * a[k, j]
    return min(m, n)


@kernel
def exchange_rows(a, n, k, other, rows):
    """Exchange rows k and other of a[:, :n] and of the record of their order."""
    if other != k:
        rows[k], rows[other] = rows[other], rows[k]
        for j in range(n):
            a[k, j], a[other, j] = a[other, j], a[k, j]


@kernel
def exchange_columns(a, m, k, other, columns):
    """Exchange columns k and other of a[:m] and of the record of their order."""
    if other != k:
        columns[k], columns[other] = columns[other], columns[k]
        for i in range(m):
            a[i, k], a[i, other] = a[i, other], a[i, k]


@kernel
def qr_pivoted(b, n, m, order, tau, norms, work, tolerance):
    """Householder QR with column pivoting of b[:n, :m], in place; returns the rank.

    Reflector k stands below the diagonal of column k with scale ``tau[k]``.  A column counts when its
    remaining norm exceeds ``tolerance`` times the largest column norm.  ``norms`` (2, m), ``work`` (m,).
    Golub & Van Loan, Matrix Computations, algorithm 5.4.1; norms recomputed when they have cancelled.
    """
    for j in range(m):
        order[j] = j
        norms[0, j] = 0.0
    for i in range(n):
        for j in range(m):
            norms[0, j] += b[i, j] * b[i, j]
    norms[1] = norms[0]
    largest = norms[0, largest_from(norms[0], 0, m)]
    for k in range(min(m, n)):
        best = largest_from(norms[0], k, m)
        if best != k:
            exchange_columns(b, n, k, best, order)
            norms[0, best], norms[1, best] = norms[0, k], norms[1, k]
        square = 0.0
        for i in range(k, n):
            square += b[i, k] * b[i, k]
        if not square > tolerance * tolerance * largest:
            return k
        reflect(b, n, m, k, sqrt(square), tau, work)
        for j in range(k + 1, m):
            norms[0, j] -= b[k, j] * b[k, j]
            if norms[0, j] < 1e-4 * norms[1, j]:
                norms[0, j] = 0.0
                for i in range(k + 1, n):
                    norms[0, j] += b[i, j] * b[i, j]
                norms[1, j] = norms[0, j]
    return min(m, n)


@kernel
def largest_from(values, start, stop):
    """Index of the largest entry in values[start:stop]."""
    best = start
    for j in range(start + 1, stop):
        if values[j] > values[best]:
            best = j
    return best


@kernel
def reflect(b, n, m, k, norm, tau, work):
    """Annihilate column k below the diagonal and apply the reflector to the columns right of it."""
    head = b[k, k]
    beta = -norm if head > 0.0 else norm
    tau[k] = (beta - head) / beta
    inverse = 1.0 / (head - beta)
    for i in range(k + 1, n):
        b[i, k] *= inverse
    b[k, k] = beta
    for j in range(k + 1, m):
        work[j] = b[k, j]
    for i in range(k + 1, n):
        v = b[i, k]
        for j in range(k + 1, m):
            work[j] += v * b[i, j]
    for j in range(k + 1, m):
        work[j] *= tau[k]
        b[k, j] -= work[j]
    for i in range(k + 1, n):
        v = b[i, k]
        for j in range(k + 1, m):
            b[i, j] -= v * work[j]


@kernel
def minimum_norm(b, n, rank, order, tau, rhs, x):
    """x (n,) of least norm with D x = rhs in the independent rows of D, from ``qr_pivoted`` of Dᵀ."""
    for k in range(n):
        x[k] = 0.0
    for k in range(rank):
        value = rhs[order[k]]
        for i in range(k):
            value -= b[i, k] * x[i]
        x[k] = value / b[k, k]
    for k in range(rank - 1, -1, -1):
        value = x[k]
        for i in range(k + 1, n):
            value += b[i, k] * x[i]
        value *= tau[k]
        x[k] -= value
        for i in range(k + 1, n):
            x[i] -= value * b[i, k]


@kernel
def equilibrate(jacobian, inverse_root, d, row_scale):
    """D = R Φ_q M^(-1/2) (m, n) with unit rows; R into ``row_scale`` (m,), so that ranks ignore units."""
    m, n = jacobian.shape
    for i in range(m):
        square = 0.0
        for j in range(n):
            d[i, j] = jacobian[i, j] * inverse_root[j]
            square += d[i, j] * d[i, j]
        row_scale[i] = 1.0 / sqrt(square) if square > 0.0 else 1.0
        for j in range(n):
            d[i, j] *= row_scale[i]


@kernel
def svd_solve(d, rhs, tolerance, x, dual):
    """x = D⁺ rhs and dual = (Dᵀ)⁺ x by the singular value decomposition (Eqs. 27 and 28); the rank.

    One step of refinement, x += D⁺ (rhs - D x), takes out the rounding that the orthogonal factors
    spread over all of x: a planar motion stays planar.  ``rhs`` (m,) becomes the residual.
    -1 where an entry of D is not finite, which LAPACK would not survive.
    """
    x[:] = 0.0
    dual[:] = 0.0
    if d.size == 0:
        return 0
    if not isfinite(np.sum(d)):
        return -1
    u, s, vt = np.linalg.svd(d, full_matrices=False)
    m, n = d.shape
    rank = 0
    while rank < s.size and s[rank] > tolerance * s[0]:
        rank += 1
    add_pseudo_solution(u, s, vt, rank, rhs, x, dual)
    for i in range(m):
        for j in range(n):
            rhs[i] -= d[i, j] * x[j]
    add_pseudo_solution(u, s, vt, rank, rhs, x, dual)
    return rank


@kernel
def add_pseudo_solution(u, s, vt, rank, rhs, x, dual):
    """x += V S⁺ Uᵀ rhs and dual += U S⁺ S⁺ Uᵀ rhs, of the first ``rank`` singular values."""
    m, n = u.shape[0], vt.shape[1]
    for k in range(rank):
        value = 0.0
        for i in range(m):
            value += u[i, k] * rhs[i]
        value /= s[k]
        for j in range(n):
            x[j] += vt[k, j] * value
        for i in range(m):
            dual[i] += u[i, k] * (value / s[k])


def pinv_svd(d: np.ndarray, tolerance: float = 1e-10) -> tuple[np.ndarray, int]:
    """Moore–Penrose inverse (n, m) of d (m, n) and its rank, by the SVD (Eqs. 27 and 28).

    Singular values up to ``tolerance`` times the largest count as zero.
    """
    u, s, vt = np.linalg.svd(np.asarray(d, dtype=float), full_matrices=False)
    rank = int(np.sum(s > tolerance * s[0])) if s.size else 0
    return (vt[:rank].T / s[:rank]) @ u[:, :rank].T, rank
