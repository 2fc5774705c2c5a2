"""Dense factorisations by orthogonalisation, which decide rank: QR, Gram–Schmidt, singular values.

Only the singular value decomposition calls LAPACK.  All functions work in place on C-contiguous arrays of the
caller.
"""

from __future__ import annotations

import numpy as np
from numpy import isfinite, sqrt

from mbref.kernels.compilation import allocating, kernel
from mbref.linear_algebra.elimination import (
    back_substitute,
    exchange_columns,
    exchange_entries,
    exchange_rows,
)
from mbref.linear_algebra.vectors import copy


@kernel
def qr_pivoted(tolerance, scratch):
    """Factorise ``scratch.transposed`` (n, m) by Householder QR with column pivoting, in place; return the
    rank.

    Reflector k stands below the diagonal of column k with scale ``tau[k]``; ``order`` (m,) has the columns in
    the chosen order. A column counts as independent if its remaining norm exceeds ``tolerance`` times the
    largest column norm.  Scratch is ``work`` (m,) and ``norms`` (2, m). Golub & Van Loan, Matrix
    Computations, algorithm 5.4.1; norms are computed again after cancellation.
    """
    b, order, tau, norms, work = (
        scratch.transposed, scratch.order, scratch.tau, scratch.norms, scratch.work,
    )  # fmt: skip
    n, m = b.shape
    for j in range(m):
        order[j] = j
        norms[0, j] = 0.0
    for i in range(n):
        for j in range(m):
            norms[0, j] += b[i, j] * b[i, j]
    largest = norms[0, largest_from(norms[0], 0, m)] if m > 0 else 0.0
    copy(norms[0], norms[1])
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
    """Return the index of the largest entry in values[start:stop]."""
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
def minimum_norm(rank, scratch):
    """Compute ``scratch.x`` (n,) of least norm with D x = ``scratch.b`` in the independent rows of D, from
    ``qr_pivoted`` of Dᵀ.
    """
    b, order, rhs, x = scratch.transposed, scratch.order, scratch.b, scratch.x
    x[:] = 0.0
    for k in range(rank):
        value = rhs[order[k]]
        for i in range(k):
            value -= b[i, k] * x[i]
        x[k] = value / b[k, k]
    for k in range(rank - 1, -1, -1):  # x := Q x
        value = x[k]
        for i in range(k + 1, x.shape[0]):
            value += b[i, k] * x[i]
        value *= scratch.tau[k]
        x[k] -= value
        for i in range(k + 1, x.shape[0]):
            x[i] -= value * b[i, k]


@kernel
def equilibrate(jacobian, inverse_root, d, row_scale):
    """Compute D = R Φ_q M^(-1/2) (m, n) with unit rows, and R in ``row_scale`` (m,), so that ranks do not
    depend on units."""
    m, n = jacobian.shape
    for i in range(m):
        row_scale[i] = 0.0
    for j in range(n):
        for i in range(m):
            value = jacobian[i, j] * inverse_root[j]
            row_scale[i] += value * value
    for i in range(m):
        row_scale[i] = 1.0 / sqrt(row_scale[i]) if row_scale[i] > 0.0 else 1.0
        for j in range(n):
            d[i, j] = jacobian[i, j] * inverse_root[j] * row_scale[i]


@kernel
def row_multipliers(rank, scratch):
    """Compute ``scratch.dual`` (m,) with Dᵀ dual = x of ``minimum_norm``; zero on dependent rows."""
    b, order, values, z, dual = (
        scratch.transposed, scratch.order, scratch.b, scratch.work, scratch.dual,
    )  # fmt: skip
    dual[:] = 0.0
    for k in range(rank):
        z[k] = values[order[k]]
        for i in range(k):
            z[k] -= b[i, k] * z[i]
        z[k] /= b[k, k]
    back_substitute(b, rank, z)
    for k in range(rank):
        dual[order[k]] = z[k]


@kernel
def gram_schmidt(a, r, tolerance):
    """Orthonormalise the rows of a (count, length) in their order, in place: row j = Σ_k r[k, j] q_k.

    Modified Gram–Schmidt with one reorthogonalisation.  Return False if a row keeps no more than
    ``tolerance`` of its length: the rows are dependent.
    """
    count, length = a.shape
    for k in range(count):
        before = row_norm(a, k)
        for _ in range(2):
            for i in range(k):
                subtract_projection(a, i, k, r)
        norm = row_norm(a, k)
        if not norm > tolerance * before:
            return False
        r[k, k] = norm
        for l in range(length):
            a[k, l] /= norm
        for j in range(k + 1, count):
            r[k, j] = 0.0
    return True


@kernel
def row_norm(a, k):
    """Return the length of row k."""
    square = 0.0
    for l in range(a.shape[1]):
        square += a[k, l] * a[k, l]
    return sqrt(square)


@kernel
def subtract_projection(a, i, k, r):
    """Subtract from row k its projection on the unit row i, whose length is added to r[i, k]."""
    part = 0.0
    for l in range(a.shape[1]):
        part += a[i, l] * a[k, l]
    r[i, k] += part
    for l in range(a.shape[1]):
        a[k, l] -= part * a[i, l]


@kernel
def gram_schmidt_pivoted(a, count, order, r, tolerance):
    """Orthonormalise rows of a[:count], the largest remaining row first; return the rank.

    Rows are exchanged with the record of their ``order``; row j (after exchange) = Σ_k r[k, j] q_k. Modified
    Gram–Schmidt; the chosen row is orthogonalised twice ("twice is enough").
    """
    length, first = a.shape[1], 0.0
    for j in range(count):
        order[j] = j
        for k in range(count):
            r[k, j] = 0.0
    for k in range(min(count, length)):
        best, norm = k, row_norm(a, k)
        for j in range(k + 1, count):
            other = row_norm(a, j)
            if other > norm:
                best, norm = j, other
        exchange_rows(a, length, k, best, order)
        exchange_entries(r, k, k, best)
        for i in range(k):
            subtract_projection(a, i, k, r)
        norm = row_norm(a, k)
        first = max(first, norm)
        if not norm > tolerance * first:
            return k
        r[k, k] = norm
        for l in range(length):
            a[k, l] /= norm
        for j in range(k + 1, count):
            subtract_projection(a, k, j, r)
    return min(count, length)


@kernel
def gram_schmidt_solve(tolerance, scratch):
    """Compute x = D⁺ b and dual = (Dᵀ)⁺ x by two Gram–Schmidt orthogonalisations; return the rank.

    D P = Q R, with the columns of D as rows of ``scratch.columns`` (n, m), then R = L Zᵀ: D⁺ = P Z L⁻¹ Qᵀ.
    Scratch is ``r``, ``l`` (n, n), ``c`` (n,), ``order`` and ``order_rows`` (n,).
    """
    columns, r, l, b, c = scratch.columns, scratch.r, scratch.l, scratch.b, scratch.c
    order, order_rows, x, dual = scratch.order, scratch.order_rows, scratch.x, scratch.dual
    n, m = columns.shape
    rank = gram_schmidt_pivoted(columns, n, order, r, tolerance)
    gram_schmidt_pivoted(r, rank, order_rows, l, 0.0)
    for k in range(rank):  # c = L⁻¹ Qᵀ b
        c[k] = 0.0
        for i in range(m):
            c[k] += columns[order_rows[k], i] * b[i]
        for i in range(k):
            c[k] -= l[i, k] * c[i]
        c[k] /= l[k, k]
    for j in range(n):  # x = P Z c
        x[order[j]] = 0.0
        for k in range(rank):
            x[order[j]] += r[k, j] * c[k]
    back_substitute(l, rank, c)  # Q L⁻ᵀ Zᵀ Pᵀ x = Q L⁻ᵀ c
    dual[:] = 0.0
    for k in range(rank):
        for i in range(m):
            dual[i] += columns[order_rows[k], i] * c[k]
    return rank


@allocating
def svd_solve(d, rhs, tolerance, x, dual):
    """Compute x = D⁺ rhs and dual = (Dᵀ)⁺ x by the singular value decomposition (Eqs. 27 and 28); return the
    rank.

    One step of refinement, x += D⁺ (rhs - D x), removes the rounding that the orthogonal factors spread over
    all entries of x, so that a planar motion stays planar.  ``rhs`` (m,) becomes the residual. Return -1 if
    an entry of D is not finite, because LAPACK fails on such entries.
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
    for value in s:
        if not value > tolerance * s[0]:
            break
        rank += 1
    add_pseudo_solution(u, s, vt, rank, rhs, x, dual)
    for i in range(m):
        for j in range(n):
            rhs[i] -= d[i, j] * x[j]
    add_pseudo_solution(u, s, vt, rank, rhs, x, dual)
    return rank


@kernel
def add_pseudo_solution(u, s, vt, rank, rhs, x, dual):
    """Compute x += V S⁺ Uᵀ rhs and dual += U S⁺ S⁺ Uᵀ rhs, of the first ``rank`` singular values."""
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
