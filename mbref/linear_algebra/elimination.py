"""Dense factorisations by elimination: LU with partial and with full pivoting, Cholesky.

The functions serve small matrices, for which a call of LAPACK takes longer than the factorisation. All
functions work in place on C-contiguous arrays of the caller.
"""

from __future__ import annotations

from numpy import log

from mbref.kernels.compilation import inlined, kernel


@kernel
def lu_factor(a, n, pivots, tolerance):
    """Factorise a[:n, :n] by LU with partial pivoting, in place; return False if a pivot is ≤ tolerance.

    ``pivots`` (n,) receives the row exchanged with each row.
    """
    for k in range(n):
        pivots[k] = exchange_for_pivot(a, n, k)
        if not abs(a[k, k]) > tolerance:
            return False
        eliminate_column(a, n, n, k, 1.0 / a[k, k])
    return True


@inlined
def exchange_for_pivot(a, n, k):
    """Exchange row k of a[:n, :n] with the row below that has the largest entry in column k; return that
    row."""
    best = k
    for i in range(k + 1, n):
        if abs(a[i, k]) > abs(a[best, k]):
            best = i
    if best != k:
        for j in range(n):
            a[k, j], a[best, j] = a[best, j], a[k, j]
    return best


@inlined
def eliminate_column(a, m, n, k, inverse):
    """Subtract row k from the rows of a[:m, :n] below, whose entries in column k become the factors."""
    for i in range(k + 1, m):
        factor = a[i, k] * inverse
        a[i, k] = factor
        if factor != 0.0:
            for j in range(k + 1, n):
                a[i, j] -= factor * a[k, j]


@kernel
def lu_of_chosen(a, chosen, lu, exchanges, singular):
    """Compute LU factors of chosen rows and columns of a: their orders, and how many of each. Return the
    smallest pivot relative to the larger of 1 and the largest one; 0 if a pivot is at most ``singular``."""
    rows, columns, rank = chosen
    for i in range(rank):
        for j in range(rank):
            lu[i, j] = a[rows[i], columns[j]]
    if not lu_factor(lu, rank, exchanges, singular):
        return 0.0
    smallest, greatest = abs(lu[0, 0]), 1.0
    for i in range(rank):
        smallest, greatest = min(smallest, abs(lu[i, i])), max(greatest, abs(lu[i, i]))
    return smallest / greatest


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
        for j in range(n - 1, k, -1):  # the entry found last is used last
            b[k] -= a[k, j] * b[j]
        b[k] /= a[k, k]


@inlined
def multiplied(size, part, number):
    """Return the size of a product times a number, as a logarithm and a factor whose logarithm is not yet
    included.

    One logarithm is computed for as many numbers as the range of doubles allows.
    """
    part *= max(abs(number), 1e-150)
    if not 1e-150 < part < 1e150:
        return size + log(part), 1.0
    return size, part


@kernel
def determinant(a, n):
    """Return whether the determinant of a[:n, :n] is negative, and the logarithm of its size; LU factors
    replace a."""
    negative, size, part = False, 0.0, 1.0
    for k in range(n):
        exchanged = exchange_for_pivot(a, n, k) != k
        negative = negative != (exchanged != (a[k, k] < 0.0))
        size, part = multiplied(size, part, a[k, k])
        eliminate_column(a, n, n, k, 1.0 / a[k, k] if abs(a[k, k]) > 1e-150 else 0.0)
    return negative, size + log(part)


@kernel
def product_of_pivots(pivots, n):
    """Return whether the product of the first n pivots is negative, and the logarithm of its size."""
    negative, size, part = False, 0.0, 1.0
    for k in range(n):
        negative = negative != (pivots[k] < 0.0)
        size, part = multiplied(size, part, pivots[k])
    return negative, size + log(part)


@kernel
def size_of_determinant(lu, n):
    """Return the logarithm of the size of a determinant from its LU factors."""
    size, part = 0.0, 1.0
    for k in range(n):
        size, part = multiplied(size, part, lu[k, k])
    return size + log(part)


@kernel
def full_pivot(a, m, n, rows, columns, tolerance):
    """Eliminate a[:m, :n] with full pivoting (Gauss), in place; return the rank (Eq. 10).

    ``rows`` (m,) and ``columns`` (n,) receive the order of elimination: the first ``rank`` columns are the
    dependent coordinates, all other columns the independent coordinates; rows after the first ``rank`` are
    redundant.  A pivot counts as nonzero if it exceeds ``tolerance`` times the first pivot.
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
        eliminate_column(a, m, n, k, 1.0 / a[k, k])
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
        exchange_entries(a, m, k, other)


@kernel
def exchange_entries(a, m, k, other):
    """Exchange the first m entries of columns k and other."""
    for i in range(m):
        a[i, k], a[i, other] = a[i, other], a[i, k]


@kernel
def back_substitute(r, n, x):
    """Solve R x = x with the upper triangle of r[:n, :n], in place."""
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            x[k] -= r[k, j] * x[j]
        x[k] /= r[k, k]


@kernel
def gram(dt, s):
    """Compute the upper half of D Dᵀ from Dᵀ (n, m); zero entries of a column cost no operations."""
    n, m = dt.shape
    for i in range(m):
        for k in range(i, m):
            s[i, k] = 0.0
    for j in range(n):
        for i in range(m):
            value = dt[j, i]
            if value != 0.0:
                for k in range(i, m):
                    s[i, k] += value * dt[j, k]


@kernel
def cholesky_factor(a, n):
    """Factorise the upper half of a[:n, :n] as Uᵀ D U, in place; return False if an entry of D is ≤ 0. U has
    a unit diagonal, in whose place 1/D is stored: no roots are computed, and no divisions in solutions.
    """
    for k in range(n):
        if not a[k, k] > 0.0:
            return False
        inverse = 1.0 / a[k, k]
        a[k, k] = inverse
        for i in range(k + 1, n):
            if a[k, i] != 0.0:
                for j in range(i, n):
                    a[i, j] -= a[k, i] * a[k, j] * inverse  # products need not wait for the division
        for j in range(k + 1, n):
            a[k, j] *= inverse
    return True


@kernel
def cholesky_solve(a, n, b):
    """Solve with the factors of ``cholesky_factor``; b (n,) becomes the solution."""
    for k in range(n):
        value = b[k]
        for j in range(k + 1, n):
            b[j] -= value * a[k, j]
    for k in range(n):
        b[k] *= a[k, k]
    for k in range(n - 1, -1, -1):
        for j in range(n - 1, k, -1):  # the entry found last is used last
            b[k] -= a[k, j] * b[j]
