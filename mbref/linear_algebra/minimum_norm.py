"""Least changes of large systems, outside the stepping loop: ALF-dual on SuperLU's factor of S + I/α."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array, diags_array, eye_array
from scipy.sparse.linalg import splu

from mbref.equations.model import Model

LARGE = 40  # rows; above, dense singular values take longer
ALPHA = 1e10  # singular values below 1e-5 of unit rows are left alone
ITERATIONS, ROUNDING = 20, 1e-15


def sparse_jacobian(model: Model, blocks: np.ndarray) -> csr_array:
    """Φ_q (m, n) from its blocks (m, 12), without the fixed frame's columns and without zeros."""
    columns = model.entry_columns()
    row, entry = np.nonzero((blocks != 0) & (columns < model.n))
    return csr_array((blocks[row, entry], (row, columns[row, entry])), shape=(model.m, model.n))


class LeastChange:
    """Solutions x of A x = b, least in the norm of the weights (n,); rows of A may be redundant."""

    def __init__(self, matrix: csr_array, weight: np.ndarray):
        self._root = 1 / np.sqrt(weight)
        d = csr_array(matrix * self._root)
        lengths = np.sqrt((d * d).sum(axis=1))
        self._scale = 1 / np.where(lengths > 0, lengths, 1.0)
        self.d = csr_array(diags_array(self._scale) @ d)
        s = (self.d @ self.d.T).tocsc() + eye_array(d.shape[0], format="csc") / ALPHA
        self.regularised = splu(
            s, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )

    def __call__(self, rhs: np.ndarray) -> np.ndarray:
        """x (n,) for b = rhs (m,); in the sense of least squares of unit rows where they contradict."""
        b, x = self._scale * rhs, np.zeros(self.d.shape[1])
        for _ in range(ITERATIONS):
            step = self.d.T @ self.regularised.solve(b)
            x += step
            b -= self.d @ step
            if np.linalg.norm(step) <= ROUNDING * np.linalg.norm(x):
                break
        return self._root * x
