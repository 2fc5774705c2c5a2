"""Constraint rows of a model with many bodies at many poses: least changes by one sparse factorisation each.

Φ_q x = b is solved with the factor of S + I/α (``linear_algebra.minimum_norm``). The pivots of unit rows show
the rank: a pivot is the sine of the angle between a row and all rows before it. A pivot that is neither large
nor rounding leaves the rank in doubt.
"""

from __future__ import annotations

import numpy as np

from mbref.equations.active_coordinates import STATES, patterns, random_states
from mbref.equations.model import Model
from mbref.kernels.compilation import FLOAT, INT, MATRIX, VECTOR, entry
from mbref.kernels.layout import OK, SINGULAR
from mbref.kernels.named_memory import packed
from mbref.linear_algebra.minimum_norm import FACTOR, ITERATIONS, LAST_CHANGE, iterate, product
from mbref.linear_algebra.sparse_cholesky import find_squared_pivots, regularised_factor, subtract_product
from mbref.linear_algebra.symbolic_factorisation import sparse_factor, symbolic_factorisation

PENALTY = 1e12  # large, so that pivots of dependent rows, of the size 1/α, are far from others
# squared pivots of unit rows: above the first a row is independent, below the second it depends on others,
# as a sum of them with weights of up to some hundreds
INDEPENDENT_ROW_PIVOT, DEPENDENT_ROW_PIVOT = 1e-5, 1e-7


@entry(INT(FLOAT, VECTOR, VECTOR, MATRIX, MATRIX, FACTOR))
def change_all_least(alpha, numbers, root, x, rhs, factor):
    """Change each of x (k, n) by the least change in the metric 1 / root² for which Φ_q x = rhs (k, m).

    ``numbers`` are the flat blocks of Φ_q. Returns OK, or SINGULAR if S + I/α is not positive definite.
    """
    if not regularised_factor(factor, numbers, root, alpha):
        return SINGULAR
    find_squared_pivots(factor)
    row, column, scaled = factor.symbolic.row, factor.symbolic.column, factor.change
    for k in range(x.shape[0]):
        target, size = x[k], 0.0
        for i in range(row.shape[0]):
            factor.residual[i] = rhs[k, row[i]]
        for j in range(column.shape[0]):
            scaled[j] = target[column[j]] / root[column[j]]
            size += scaled[j] * scaled[j]
        subtract_product(factor, scaled, factor.residual)
        before = -1.0
        for _ in range(ITERATIONS):
            iterate(factor, target)
            subtract_product(factor, scaled, factor.residual)
            change = product(scaled, scaled)
            size = max(size, change)
            if change <= LAST_CHANGE * LAST_CHANGE * size or (before > 0.0 and change >= before):
                break
            before = change
    return OK


class SparseRows:
    """The rows of Φ_q of a model, with the pattern of their entries at all poses."""

    def __init__(self, model: Model, q: np.ndarray):
        about = random_states(STATES, model.n).about(q, model.scene.duration)
        entries = patterns(model, model.terms(*about))[0] | patterns(model, model.terms(np.zeros(1), q))[0]
        row, place = np.nonzero(entries)
        columns = model.entry_columns
        moving = np.zeros(model.n, dtype=bool)
        moving[columns[row, place]] = True
        symbolic = symbolic_factorisation(row, columns[row, place], columns.shape[1] * row + place, moving)
        self._factor = packed(sparse_factor(symbolic))

    def change(
        self, blocks: np.ndarray, root: np.ndarray, x: np.ndarray, rhs: np.ndarray, penalty: float = PENALTY
    ) -> bool:
        """Change each of x (k, n) by the least change, in the metric 1 / root² (n,), for which Φ_q x = rhs.

        Arguments are Φ_q as blocks (m, 12) and right-hand sides (k, m). Singular values of unit rows below
        the inverse root of the penalty are ignored. Returns False if the factorisation fails.
        """
        status = change_all_least(penalty, blocks.reshape(-1), root, x, rhs, self._factor.argument)
        return bool(status == OK)

    @property
    def rank(self) -> int | None:
        """The rank at the last pose, and None if pivots do not show it."""
        squares = self._factor.values.squared_pivots
        clear = squares > INDEPENDENT_ROW_PIVOT
        return int(clear.sum()) if (clear | (squares < DEPENDENT_ROW_PIVOT)).all() else None

    @property
    def are_independent(self) -> bool:
        """Whether no row depended on other rows at the last pose; False before the first one."""
        return bool((self._factor.values.squared_pivots > INDEPENDENT_ROW_PIVOT).all())

    @property
    def least_pivot(self) -> float:
        """The least pivot of independent unit rows at the last pose; 1 without rows."""
        squares = self._factor.values.squared_pivots
        return float(np.sqrt(squares.min(initial=1.0, where=squares > INDEPENDENT_ROW_PIVOT)))
