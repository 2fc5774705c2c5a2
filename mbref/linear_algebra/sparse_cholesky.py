"""Sparse kernels over a ``Plan``: D, the factors L Δ Lᵀ of S + I/α, solutions and products.

S = D Dᵀ with D = Φ_q M^(-1/2).  α weighs rows of unit length, S_ii = 1, so that S_ii (1 + 1/α) stands on the
diagonal; a row without entries has 1 there and changes nothing.  Vectors of rows and columns are the plan's.
"""

from __future__ import annotations

from mbref.kernels.compilation import inlined, view
from mbref.linear_algebra.symbolic_factorisation import (
    COLUMN,
    D_COLUMN,
    D_ENTRY,
    D_START,
    L_ROW,
    L_START,
    ROW,
    S_LEFT,
    S_RIGHT,
    S_START,
    S_TARGET,
    UPDATE,
)


@view
def part(plan, k):
    """One of the parts of the plan's indices."""
    return plan[plan[k] : plan[k + 1]]


@view
def memories(plan, memory):
    """Views of the memory: D, L, S_ii, pivots squared, three vectors of rows, M^(-1/2), one of columns."""
    d, l, r = part(plan, D_ENTRY).shape[0], part(plan, L_ROW).shape[0], part(plan, ROW).shape[0]
    c = part(plan, COLUMN).shape[0]
    a = d + l
    return (
        memory[:d], memory[d:a], memory[a : a + r], memory[a + r : a + 2 * r], memory[a + 2 * r : a + 3 * r],
        memory[a + 3 * r : a + 4 * r], memory[a + 4 * r : a + 5 * r], memory[a + 5 * r : a + 5 * r + c],
        memory[a + 5 * r + c : a + 5 * r + 2 * c],
    )  # fmt: skip


@inlined
def assemble(plan, jacobian, inverse_root, alpha, d, l, diagonal, root):
    """M^(-1/2) and D from the model's diagonal (n,) and blocks (m, 12), and S + I/α into the places of L."""
    entry, column, moving = part(plan, D_ENTRY), part(plan, D_COLUMN), part(plan, COLUMN)
    blocks = jacobian.reshape(-1)
    for j in range(moving.shape[0]):
        root[j] = inverse_root[moving[j]]
    for k in range(entry.shape[0]):
        d[k] = blocks[entry[k]] * root[column[k]]
    l[:] = 0.0
    start, target = part(plan, S_START), part(plan, S_TARGET)
    left, right = part(plan, S_LEFT), part(plan, S_RIGHT)
    for k in range(target.shape[0]):
        value = 0.0
        for p in range(start[k], start[k + 1]):
            value += d[left[p]] * d[right[p]]
        l[target[k]] = value
    first = part(plan, L_START)
    for k in range(diagonal.shape[0]):
        value = l[first[k]] * (1.0 + 1.0 / alpha)
        diagonal[k] = value if value > 0.0 else 1.0
        l[first[k]] = diagonal[k]


@inlined
def factorise(plan, l):
    """L of S + I/α in its place, 1/Δ instead of its unit diagonal; False where an entry of Δ is ≤ 0."""
    first, update = part(plan, L_START), part(plan, UPDATE)
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
def solve(plan, l, b):
    """b := (S + I/α)⁻¹ b."""
    first, row = part(plan, L_START), part(plan, L_ROW)
    size = first.shape[0] - 1
    for k in range(size):
        value = b[k]
        for p in range(first[k] + 1, first[k + 1]):
            b[row[p]] -= l[p] * value
    for k in range(size - 1, -1, -1):
        value = b[k] * l[first[k]]
        for p in range(first[k + 1] - 1, first[k], -1):  # what was found last comes last, also below
            value -= l[p] * b[row[p]]
        b[k] = value


@inlined
def subtract_product(plan, d, x, b):
    """b -= D x."""
    start, column = part(plan, D_START), part(plan, D_COLUMN)
    for k in range(b.shape[0]):
        value = b[k]
        for p in range(start[k], start[k + 1]):
            value -= d[p] * x[column[p]]
        b[k] = value


@inlined
def times_transpose(plan, d, b, x):
    """x := Dᵀ b."""
    start, column = part(plan, D_START), part(plan, D_COLUMN)
    x[:] = 0.0
    for k in range(b.shape[0] - 1, -1, -1):
        value = b[k]
        for p in range(start[k], start[k + 1]):
            x[column[p]] += d[p] * value


@inlined
def squared_pivots(plan, l, diagonal, squares):
    """Squares (r,) of the pivots of unit rows: the sines of the angle between each row and those before."""
    first = part(plan, L_START)
    for k in range(diagonal.shape[0]):
        squares[k] = 1.0 / (l[first[k]] * diagonal[k])
