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


class Redundancy:
    """Rank of a Jacobian (m, n), and squared components ``shares`` of its rows in the left null space.

    Singular values above 1e-4 of the rows' length count fully.
    """

    def __init__(self, jacobian: csr_array):
        self._solution = MinimumNorm(jacobian, np.ones(jacobian.shape[1]))
        self.shares = np.array([self._share(row) for row in range(jacobian.shape[0])])
        self.rank = jacobian.shape[0] - round(float(np.sum(self.shares)))

    def _share(self, row: int) -> float:
        """Return the squared component of the unit vector (m,) of a row in the left null space, from 0 to
        1."""
        unit = np.zeros(self._solution.d.shape[0])
        unit[row] = 1.0
        return float(np.sum((self._solution.regularised_solution(unit) / ALPHA) ** 2))

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
