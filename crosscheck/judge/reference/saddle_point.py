"""Sparse products and saddle-point systems in any arithmetic: factorised in double precision, then refined
iteratively.

Iterative refinement with residuals in the arithmetic itself (N. J. Higham, Accuracy and Stability of
Numerical Algorithms, 2002, ch. 12) gains in each step about 16 digits minus the decimal logarithm of the
condition number.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg.lapack import dgetrf, dgetrs

from crosscheck.judge.arithmetic import Arithmetic, doubles
from crosscheck.judge.deadline import ask

ROUNDS = 40  # largest number of refinement steps
FIRST = 4.0  # initial correction size, so that the first step is never the last
STALLED = 0.5  # ratio of successive corrections above which refinement ends


class Sparse:
    """A matrix (m, n) with few nonzero entries, in any arithmetic."""

    def __init__(self, matrix: np.ndarray):
        rows, self._columns = np.nonzero(doubles(matrix))
        self._values, self._size = matrix[rows, self._columns], len(matrix)
        self._filled, self._starts = np.unique(rows, return_index=True)

    def __call__(self, vectors: np.ndarray) -> np.ndarray:
        """Return the matrix times vectors (…, n): (…, m)."""
        out = np.zeros((*vectors.shape[:-1], self._size), dtype=vectors.dtype)
        if len(self._filled):
            terms = self._values * vectors[..., self._columns]
            out[..., self._filled] = np.add.reduceat(terms, self._starts, axis=-1)
        return out


class SaddlePoint:
    """The system M x + Gᵀ y = f, G x - C y = g with x, f (3, n).

    ``mass`` M (n, n) acts on each row, ``rows`` are G (m, 3, n), ``compliance`` (m,) is the diagonal of C.
    """

    def __init__(self, mass: np.ndarray, rows: np.ndarray, compliance: np.ndarray, arithmetic: Arithmetic):
        self._eps, self._arithmetic = arithmetic.eps, arithmetic
        self._size = 3 * len(mass)
        matrix = arithmetic.zeros(self._size + len(rows), self._size + len(rows))
        for i in range(3):
            at = slice(i * len(mass), (i + 1) * len(mass))
            matrix[at, at] = mass
        flat = rows.reshape(len(rows), self._size)
        matrix[self._size :, : self._size], matrix[: self._size, self._size :] = flat, flat.T
        ends = np.arange(self._size, len(matrix))
        matrix[ends, ends] = -compliance
        self._product, near = Sparse(matrix), doubles(matrix)
        self._scale = 1 / np.sqrt(np.maximum(np.abs(near).max(axis=1), 1e-300))
        self._factors = dgetrf(near * self._scale[:, None] * self._scale)[:2]

    def solve(self, force: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return x (3, n) and y (m,) for f (3, n) and g (m,)."""
        wanted = self._arithmetic.settled(np.concatenate([force.ravel(), rate]))
        found, left, last = 0 * wanted, wanted, FIRST
        for _ in range(ROUNDS):
            ask()
            size = np.abs(left).max()
            if float(size) == 0.0:
                break
            step = dgetrs(*self._factors, doubles(left / size) * self._scale)[0]
            found = self._arithmetic.settled(found + (self._scale * step) * size)
            change = float(np.abs(step).max() * size / np.abs(found / self._scale).max())
            if change * change / last <= self._eps or not change <= STALLED * last:
                break
            last, left = change, self._arithmetic.settled(wanted - self._product(found))
        return found[: self._size].reshape(force.shape), found[self._size :]
