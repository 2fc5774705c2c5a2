"""Sparse LU factors of the product of two gradients, D D̃ᵀ + diag(D Dᵀ)/α, without exchange of rows.

The factors have the sparsity pattern of the Cholesky factor of D Dᵀ.  The product of the first k pivots is
the determinant of the first k rows. The determinant changes its sign if these rows lose rank between D̃ and
D.
"""

from __future__ import annotations

from mbref.kernels.compilation import kernel
from mbref.linear_algebra.sparse_cholesky import product_of_rows


@kernel
def factorise_product(factor, other, alpha, product):
    """Compute the factors of D D̃ᵀ + diag(D Dᵀ)/α into ``product``; D belongs to the factor, D̃ is ``other``
    (nd,).

    ``product.lower`` (nl,) contains L without the ones on its diagonal, ``product.upper`` the entries of Uᵀ.
    The pivots (r,) are relative to the diagonal of D Dᵀ.
    """
    first, lower, upper, pivots = factor.symbolic.l_start, product.lower, product.upper, product.pivots
    for k in range(pivots.shape[0]):
        start, square = first[k], product_of_rows(factor, first[k])
        square = square if square > 0.0 else 1.0  # a row without entries
        value, _ = eliminated(factor, other, product, start)
        pivot = value + square / alpha
        pivots[k] = pivot / square
        inverse = 1.0 / pivot if pivot != 0.0 else alpha / square
        for p in range(start + 1, first[k + 1]):
            below, right = eliminated(factor, other, product, p)
            lower[p], upper[p] = below * inverse, right


@kernel
def eliminated(factor, other, product, place):
    """Return the numbers of D D̃ᵀ below and right of the diagonal at a place of the Cholesky factor, minus
    products of earlier columns of L and U."""
    symbolic, d, lower, upper = factor.symbolic, factor.d, product.lower, product.upper
    below, right = 0.0, 0.0
    for p in range(symbolic.s_start[place], symbolic.s_start[place + 1]):
        i, j = symbolic.s_left[p], symbolic.s_right[p]
        below += d[i] * other[j]
        right += d[j] * other[i]
    for p in range(symbolic.update_start[place], symbolic.update_start[place + 1]):
        i, j = symbolic.update_left[p], symbolic.update_right[p]
        below -= lower[j] * upper[i]
        right -= lower[i] * upper[j]
    return below, right
