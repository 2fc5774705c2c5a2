"""Rank and redundancy of large Jacobians, by the regularised inverse instead of singular values.

With rows of Φ_q scaled to unit length, S = Φ_q Φ_qᵀ and B = (I/α) (S + I/α)⁻¹, B² has the left null vectors'
sum of squares on its diagonal, plus (1/(α σ²))² for every other singular value σ.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbref.linear_algebra.minimum_norm import ALPHA, MinimumNorm

if TYPE_CHECKING:
    from scipy.sparse import csr_array


def dense_null_shares(matrix: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return ``null_shares`` (…, r) of small matrices (…, m, n), whose rows may be zero."""
    lengths = np.sqrt((matrix * matrix).sum(axis=-1, keepdims=True))
    d = matrix / np.where(lengths > 0, lengths, 1.0)
    unit = np.eye(matrix.shape[-2])
    inverse = np.linalg.solve(ALPHA * (d @ d.swapaxes(-1, -2)) + unit, unit[:, rows])
    return np.sum(inverse**2, axis=-2)


def null_shares(solution: MinimumNorm, rows: np.ndarray) -> np.ndarray:
    """Return the squared component of each of these rows in the left null space of the matrix of
    ``solution``, from 0 to 1."""
    shares = np.zeros(rows.size)
    for k, row in enumerate(rows):
        unit = np.zeros(solution.d.shape[0])
        unit[row] = 1.0
        shares[k] = np.sum((solution.regularised_solution(unit) / ALPHA) ** 2)
    return shares


class Redundancy:
    """Rank of a Jacobian (m, n), and squared components ``shares`` of its rows in the left null space.

    Singular values above 1e-4 of the rows' length count fully.
    """

    def __init__(self, jacobian: csr_array):
        self._solution = MinimumNorm(jacobian, np.ones(jacobian.shape[1]))
        self.shares = null_shares(self._solution, np.arange(jacobian.shape[0]))
        self.rank = jacobian.shape[0] - round(float(np.sum(self.shares)))

    def singular_values(self) -> tuple[float, float]:
        """Return the smallest nonzero and the largest singular value of unit rows."""
        from scipy.sparse.linalg import LinearOperator, eigsh

        d, inverse = self._solution.d, self._solution.regularised_solution
        m = d.shape[0]

        def inverted(x: np.ndarray) -> np.ndarray:
            for _ in range(2):
                x = x - inverse(x) / ALPHA  # the remainder of x is in the row space
            return inverse(x)

        start = np.random.default_rng(1).normal(size=m)
        largest = eigsh(
            LinearOperator((m, m), lambda x: d @ (d.T @ x)), 1, v0=start, return_eigenvectors=False
        )
        least = eigsh(LinearOperator((m, m), inverted), 1, v0=start, return_eigenvectors=False)
        return float(np.sqrt(1 / least[0] - 1 / ALPHA)), float(np.sqrt(largest[0]))
