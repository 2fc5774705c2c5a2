"""Sparse kernels: D = Φ_q M^(-1/2), the factor L Δ Lᵀ of S + I/α with S = D Dᵀ, solutions and products.

α weighs rows of unit length, S_ii = 1, so that S_ii (1 + 1/α) stands on the diagonal; a row without entries
has 1 on the diagonal and changes nothing. Rows that link copies of a body (``linear_algebra.hubs``) have no
1/α.  Vectors of rows and columns are in the order of
``SparseFactor.symbolic``.
"""

from __future__ import annotations

from numpy import sqrt

from mbref.kernels.compilation import inlined, kernel
from mbref.kernels.layout import LINK


@inlined
def assemble_gradients(factor, numbers, inverse_root):
    """Compute M^(-1/2) and D from M^(-1/2) (n,) and the flat constraint Jacobian."""
    symbolic, d, root, share = factor.symbolic, factor.d, factor.root, factor.share
    entry, d_column, column, link = symbolic.d_entry, symbolic.d_column, symbolic.column, symbolic.link
    for j in range(column.shape[0]):
        root[j] = inverse_root[column[j]]
    if link.shape[0] > 0:
        for j in range(column.shape[0]):
            root[j] /= sqrt(share[j])
    for k in range(entry.shape[0]):
        d[k] = numbers[entry[k]] * root[d_column[k]]
    for p in range(0, link.shape[0], 2):
        d[link[p]], d[link[p + 1]] = root[d_column[link[p]]], -root[d_column[link[p + 1]]]


@inlined
def of_row(vector, row):
    """Return the element of a vector (m,) for a row of the factor: zero for a row that links copies."""
    return vector[row] if row != LINK else 0.0


@inlined
def product_of_rows(factor, entry):
    """Return the entry of S at the place of an entry of L: the inner product of two rows of D."""
    symbolic, d, value = factor.symbolic, factor.d, 0.0
    start, left, right = symbolic.s_start, symbolic.s_left, symbolic.s_right
    for p in range(start[entry], start[entry + 1]):
        value += d[left[p]] * d[right[p]]
    return value


@inlined
def eliminate(value, factor, entry):
    """Subtract from a number of S + I/α the products of numbers of L in its row and column, from earlier
    columns."""
    symbolic, l, scaled = factor.symbolic, factor.l, factor.scaled
    start, left, right = symbolic.update_start, symbolic.update_left, symbolic.update_right
    for p in range(start[entry], start[entry + 1]):
        value -= l[left[p]] * scaled[right[p]]
    return value


@kernel
def square_without_copies(factor, k):
    """Return S_ii of a row before bodies were split; zero for a row that links copies."""
    symbolic, d, share, square = factor.symbolic, factor.d, factor.share, 0.0
    if symbolic.row[k] != LINK:
        for p in range(symbolic.d_start[k], symbolic.d_start[k + 1]):
            square += d[p] * d[p] * share[symbolic.d_column[p]]
    return square


@inlined
def factorise(factor, alpha, b):
    """Compute L of S + I/α, with 1/Δ instead of its unit diagonal, and b := L⁻¹ b; return False if an entry
    of Δ is ≤ 0.

    Every number is computed at once from its products, and b while the next column waits for its pivot.
    """
    first, row, l = factor.symbolic.l_start, factor.symbolic.l_row, factor.l
    has_copies = factor.symbolic.link.shape[0] > 0
    for k in range(first.shape[0] - 1):
        start, value = first[k], product_of_rows(factor, first[k])
        if has_copies:
            value += square_without_copies(factor, k) / alpha
        else:
            value *= 1.0 + 1.0 / alpha
        factor.diagonal[k] = value if value > 0.0 else 1.0
        pivot = eliminate(factor.diagonal[k], factor, start)
        if not pivot > 0.0:
            return False
        inverse, found = 1.0 / pivot, b[k]
        l[start] = inverse
        for p in range(start + 1, first[k + 1]):
            value = eliminate(product_of_rows(factor, p), factor, p)
            factor.scaled[p] = value
            l[p] = value * inverse
            b[row[p]] -= l[p] * found
    return True


@inlined
def regularised_factor(factor, numbers, inverse_root, alpha):
    """Compute D and the factor of S + I/α; return False if S + I/α is not positive definite."""
    assemble_gradients(factor, numbers, inverse_root)
    factor.step[:] = 0.0
    return factorise(factor, alpha, factor.step)


@inlined
def solve(factor, b):
    """Replace b by (S + I/α)⁻¹ b."""
    substitute_forward(factor, b)
    substitute_back(factor, b)


@inlined
def substitute_forward(factor, b):
    """Replace b by L⁻¹ b, as ``factorise`` does; return bᵀ (S + I/α)⁻¹ b."""
    first, row, l, square = factor.symbolic.l_start, factor.symbolic.l_row, factor.l, 0.0
    for k in range(first.shape[0] - 1):
        value = b[k]
        square += value * value * l[first[k]]
        for p in range(first[k] + 1, first[k + 1]):
            b[row[p]] -= l[p] * value
    return square


@inlined
def substitute_back(factor, b):
    """Replace b by L⁻ᵀ Δ⁻¹ b."""
    first, row, l = factor.symbolic.l_start, factor.symbolic.l_row, factor.l
    for k in range(first.shape[0] - 2, -1, -1):
        value = b[k] * l[first[k]]
        for p in range(first[k + 1] - 1, first[k], -1):  # the entry found last is used last, also below
            value -= l[p] * b[row[p]]
        b[k] = value


@inlined
def subtract_product(factor, x, b):
    """Subtract D x from b."""
    start, column, d = factor.symbolic.d_start, factor.symbolic.d_column, factor.d
    for k in range(b.shape[0]):
        value = b[k]
        for p in range(start[k], start[k + 1]):
            value -= d[p] * x[column[p]]
        b[k] = value


@inlined
def times_transpose(factor, b, x):
    """Compute x = Dᵀ b."""
    x[:] = 0.0
    add_transpose(factor, b, x)


@inlined
def add_transpose(factor, b, x):
    """Add Dᵀ b to x."""
    start, column, d = factor.symbolic.d_start, factor.symbolic.d_column, factor.d
    for k in range(b.shape[0] - 1, -1, -1):
        value = b[k]
        for p in range(start[k], start[k + 1]):
            x[column[p]] += d[p] * value


@inlined
def find_squared_pivots(factor):
    """Compute the squared pivots (r,) of unit rows: squared sines of the angle between each row and the rows
    before it."""
    first, l, diagonal, squares = factor.symbolic.l_start, factor.l, factor.diagonal, factor.squared_pivots
    for k in range(diagonal.shape[0]):
        squares[k] = 1.0 / (l[first[k]] * diagonal[k])


@inlined
def least_squared_pivot(factor):
    """Return the least squared pivot of unit rows; 1 without rows."""
    first, l, diagonal, most = factor.symbolic.l_start, factor.l, factor.diagonal, 1.0
    for k in range(diagonal.shape[0]):
        most = max(most, l[first[k]] * diagonal[k])
    return 1.0 / most
