"""Sparse kernels: D = Φ_q M^(-1/2), the factor L Δ Lᵀ of S + I/α with S = D Dᵀ, solutions and products.

α weighs rows of unit length, S_ii = 1, so that S_ii (1 + 1/α) stands on the diagonal; a row without entries
has 1 there and changes nothing.  Vectors of rows and columns are in the order of ``SparseFactor.symbolic``.
"""

from __future__ import annotations

from mbref.kernels.compilation import inlined


@inlined
def assemble_gradients(factor, numbers, inverse_root):
    """M^(-1/2) and D from M^(-1/2) (n,) and the flat constraint Jacobian."""
    symbolic, d, root = factor.symbolic, factor.d, factor.root
    entry, d_column, column = symbolic.d_entry, symbolic.d_column, symbolic.column
    for j in range(column.shape[0]):
        root[j] = inverse_root[column[j]]
    for k in range(entry.shape[0]):
        d[k] = numbers[entry[k]] * root[d_column[k]]


@inlined
def assemble(factor, numbers, inverse_root, alpha):
    """M^(-1/2) and D from M^(-1/2) (n,) and the flat constraint Jacobian, and S + I/α into L."""
    symbolic, d, l, diagonal = factor.symbolic, factor.d, factor.l, factor.diagonal
    assemble_gradients(factor, numbers, inverse_root)
    l[:] = 0.0
    start, target = symbolic.s_start, symbolic.s_target
    left, right, first = symbolic.s_left, symbolic.s_right, symbolic.l_start
    for k in range(target.shape[0]):
        value = 0.0
        for p in range(start[k], start[k + 1]):
            value += d[left[p]] * d[right[p]]
        l[target[k]] = value
    for k in range(diagonal.shape[0]):
        value = l[first[k]] * (1.0 + 1.0 / alpha)
        diagonal[k] = value if value > 0.0 else 1.0
        l[first[k]] = diagonal[k]


@inlined
def factorise(factor):
    """L of S + I/α in its place, 1/Δ instead of its unit diagonal; False where an entry of Δ is ≤ 0."""
    first, update, l = factor.symbolic.l_start, factor.symbolic.update, factor.l
    u = 0
    for k in range(first.shape[0] - 1):
        start, end = first[k], first[k + 1]
        if not l[start] > 0.0:
            return False
        inverse = 1.0 / l[start]
        l[start] = inverse
        for p in range(start + 1, end):
            for other in range(p, end):
                l[update[u]] -= l[p] * l[other] * inverse
                u += 1
        for p in range(start + 1, end):
            l[p] *= inverse
    return True


@inlined
def regularised_factor(factor, numbers, inverse_root, alpha):
    """Assemble and factorise S + I/α; False where it is not positive definite."""
    assemble(factor, numbers, inverse_root, alpha)
    return factorise(factor)


@inlined
def solve(factor, b):
    """b := (S + I/α)⁻¹ b."""
    first, row, l = factor.symbolic.l_start, factor.symbolic.l_row, factor.l
    size = first.shape[0] - 1
    for k in range(size):
        value = b[k]
        for p in range(first[k] + 1, first[k + 1]):
            b[row[p]] -= l[p] * value
    for k in range(size - 1, -1, -1):
        value = b[k] * l[first[k]]
        for p in range(first[k + 1] - 1, first[k], -1):  # the entry found last is used last, also below
            value -= l[p] * b[row[p]]
        b[k] = value


@inlined
def subtract_product(factor, x, b):
    """b -= D x."""
    start, column, d = factor.symbolic.d_start, factor.symbolic.d_column, factor.d
    for k in range(b.shape[0]):
        value = b[k]
        for p in range(start[k], start[k + 1]):
            value -= d[p] * x[column[p]]
        b[k] = value


@inlined
def times_transpose(factor, b, x):
    """x := Dᵀ b."""
    start, column, d = factor.symbolic.d_start, factor.symbolic.d_column, factor.d
    x[:] = 0.0
    for k in range(b.shape[0] - 1, -1, -1):
        value = b[k]
        for p in range(start[k], start[k + 1]):
            x[column[p]] += d[p] * value


@inlined
def find_squared_pivots(factor):
    """Squares (r,) of the pivots of unit rows: the sines of the angle between each row and those before."""
    first, l, diagonal, squares = factor.symbolic.l_start, factor.l, factor.diagonal, factor.squared_pivots
    for k in range(diagonal.shape[0]):
        squares[k] = 1.0 / (l[first[k]] * diagonal[k])


@inlined
def least_squared_pivot(factor):
    """The least square of a pivot of unit rows; 1 without rows."""
    first, l, diagonal, most = factor.symbolic.l_start, factor.l, factor.diagonal, 1.0
    for k in range(diagonal.shape[0]):
        most = max(most, l[first[k]] * diagonal[k])
    return 1.0 / most
