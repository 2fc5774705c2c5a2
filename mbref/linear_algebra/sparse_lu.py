"""Sparse LU factors of the product of two gradients, D D̃ᵀ + diag(D Dᵀ)/α, without exchange of rows.

The factors have the sparsity pattern of the Cholesky factor of D Dᵀ.  The product of the first k pivots is
the determinant of the first k rows. The determinant changes its sign if these rows lose rank between D̃ and
D.
"""

from __future__ import annotations

from mbref.kernels.compilation import inlined, kernel
from mbref.linear_algebra.sparse_cholesky import U0, U1


@kernel
def factorise_product(factor, other, alpha, product):
    """Compute the factors of D D̃ᵀ + diag(D Dᵀ)/α into ``product``; D belongs to the factor, D̃ is ``other``
    (nd,).

    ``product.lower`` (nl,) contains L without the ones on its diagonal, ``product.upper`` the entries of Uᵀ.
    The pivots (r,) are relative to the diagonal of D Dᵀ.
    """
    panel, before = factor.symbolic.panel, U0
    add_products_of(factor, other, product)
    for c in range(panel.shape[0] - 1):
        begin, end, place = panel[c] + U0, panel[c + 1] + U0, before
        for k in range(begin, end):
            divide_by_pivot(k, factor, alpha, product)
            if k + U1 < end:
                subtract_from_next(k, factor, product)
        for k in range(begin, end):
            place = subtract_from_later(k, end, before, factor, product)
        before = place


@inlined
def add_products_of(factor, other, product):
    """Compute the numbers of D D̃ᵀ below and right of the diagonal, at their places in the factor."""
    symbolic, d, lower, upper = factor.symbolic, factor.d, product.lower, product.upper
    entry, left, right = symbolic.s_entry, symbolic.s_left, symbolic.s_right
    lower[:], upper[:] = 0.0, 0.0
    for p in range(entry.shape[0]):
        lower[entry[p]] += d[left[p]] * other[right[p]]
        upper[entry[p]] += d[right[p]] * other[left[p]]


@inlined
def divide_by_pivot(k, factor, alpha, product):
    """Compute pivot k, and divide column k of L by the pivot."""
    first, start, d, square = factor.symbolic.l_start, factor.symbolic.d_start, factor.d, 0.0
    for p in range(start[k], start[k + U1]):
        square += d[p] * d[p]
    square = square if square > 0.0 else 1.0  # a row without entries
    pivot = product.lower[first[k]] + square / alpha
    product.pivots[k] = pivot / square
    inverse = 1.0 / pivot if pivot != 0.0 else alpha / square
    for p in range(first[k] + U1, first[k + U1]):
        product.lower[p] *= inverse


@inlined
def subtract_from_next(k, factor, product):
    """Subtract the products of column k of L and row k of U from the next ones, which have equal places."""
    first, lower, upper = factor.symbolic.l_start, product.lower, product.upper
    start, end = first[k + U1], first[k + U1 + U1]
    apart = start - first[k] - U1
    below, right = lower[start - apart], upper[start - apart]
    for p in range(start, end):
        lower[p] -= lower[p - apart] * right
        upper[p] -= upper[p - apart] * below


@inlined
def subtract_from_later(k, end, place, factor, product):
    """Subtract the products of column k of L and row k of U from the numbers behind the panel, which ends
    before column ``end``; return the first place in ``symbolic.update`` of the next panel."""
    first, update = factor.symbolic.l_start, factor.symbolic.update
    lower, upper = product.lower, product.upper
    for j in range(first[k] + (end - k), first[k + U1]):
        for i in range(j, first[k + U1]):
            lower[update[place]] -= lower[i] * upper[j]
            upper[update[place]] -= lower[j] * upper[i]
            place = place + U1
    return place
