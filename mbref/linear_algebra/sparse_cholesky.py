"""Sparse kernels: D = Φ_q M^(-1/2), the factor L Δ Lᵀ of S + I/α with S = D Dᵀ, solutions and products.

α weighs rows of unit length, S_ii = 1, so that S_ii (1 + 1/α) stands on the diagonal; a row without entries
has 1 on the diagonal and changes nothing. Rows that link copies of a body (``linear_algebra.hubs``) have no
1/α.  Vectors of rows and columns are in the order of ``SparseFactor.symbolic``. Rows of one joint often have
equal patterns, so that pairs of columns of L form panels.
"""

from __future__ import annotations

from numpy import sqrt, uint64

from mbref.kernels.compilation import inlined, kernel
from mbref.kernels.layout import LINK

U0, U1 = uint64(0), uint64(1)  # sums with indices stay unsigned: compiled code tests signed indices


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
def add_products(factor):
    """Compute the numbers of S, the inner products of the rows of D, at their places in L."""
    symbolic, d, l = factor.symbolic, factor.d, factor.l
    entry, left, right = symbolic.s_entry, symbolic.s_left, symbolic.s_right
    l[:] = 0.0
    for p in range(entry.shape[0]):
        l[entry[p]] += d[left[p]] * d[right[p]]


@kernel
def square_without_copies(factor, k):
    """Return S_ii of a row before bodies were split; zero for a row that links copies."""
    symbolic, d, share, square = factor.symbolic, factor.d, factor.share, 0.0
    if symbolic.row[k] != LINK:
        for p in range(symbolic.d_start[k], symbolic.d_start[k + 1]):
            square += d[p] * d[p] * share[symbolic.d_column[p]]
    return square


@inlined
def regularise(factor, alpha):
    """Add 1/α to the diagonal of S, which stands in L."""
    first, l, diagonal = factor.symbolic.l_start, factor.l, factor.diagonal
    has_copies = factor.symbolic.link.shape[0] > 0
    for k in range(diagonal.shape[0]):
        value = l[first[k]]
        if has_copies:
            value += square_without_copies(factor, k) / alpha
        else:
            value *= 1.0 + 1.0 / alpha
        diagonal[k] = value if value > 0.0 else 1.0
        l[first[k]] = diagonal[k]


@inlined
def divide_column(k, factor, b):
    """Divide column k of L by its pivot, and subtract its products with b_k from later numbers of b; return
    False if the pivot is ≤ 0."""
    first, row, l, scaled = factor.symbolic.l_start, factor.symbolic.l_row, factor.l, factor.scaled
    start = first[k]
    if not l[start] > 0.0:
        return False
    inverse, found = 1.0 / l[start], b[k]
    l[start] = inverse
    for p in range(start + U1, first[k + U1]):
        value = l[p]
        scaled[p] = value
        l[p] = value * inverse
        b[row[p]] -= l[p] * found
    return True


@inlined
def subtract_from_neighbour(k, factor):
    """Subtract the products of column k of L from the next column, which has the same rows."""
    first, l, scaled = factor.symbolic.l_start, factor.l, factor.scaled
    start, end = first[k + U1], first[k + U1 + U1]
    apart = start - first[k] - U1
    weight = l[start - apart]
    for p in range(start, end):
        l[p] -= weight * scaled[p - apart]


@inlined
def subtract_products(k, has_two, place, factor):
    """Subtract the products of the last column k of a panel, and of the column before it if the panel
    ``has_two``, from later columns of L; return the first place in ``symbolic.update`` of the next panel."""
    first, update, l, scaled = factor.symbolic.l_start, factor.symbolic.update, factor.l, factor.scaled
    start, end = first[k] + U1, first[k + U1]
    if has_two:
        apart = first[k] - first[k - U1] - U1
        for j in range(start, end):
            one, other = scaled[j - apart], scaled[j]
            for i in range(j, end):
                l[update[place]] -= l[i - apart] * one + l[i] * other
                place = place + U1
    else:
        for j in range(start, end):
            one = scaled[j]
            for i in range(j, end):
                l[update[place]] -= l[i] * one
                place = place + U1
    return place


@inlined
def factorise(factor, alpha, b):
    """Compute L of S + I/α, with 1/Δ instead of its unit diagonal, and b := L⁻¹ b; return False if an entry
    of Δ is ≤ 0.

    A panel of two columns changes each later number of L once instead of twice.
    """
    add_products(factor)
    regularise(factor, alpha)
    panel, place = factor.symbolic.panel, U0
    for c in range(panel.shape[0] - 1):
        last = panel[c + 1] - U1
        has_two = last > panel[c]
        if has_two:
            if not divide_column(last - U1, factor, b):
                return False
            subtract_from_neighbour(last - U1, factor)
        if not divide_column(last, factor, b):
            return False
        place = subtract_products(last, has_two, place, factor)
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
