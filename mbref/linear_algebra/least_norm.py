"""Solutions of least squares and least norm, and the null space, of dense equations, by singular values."""

from __future__ import annotations

import numpy as np


def least_norm(matrix: np.ndarray, rhs: np.ndarray, tolerance: float) -> np.ndarray:
    """Return the solutions x (…, n) of A x = b, of least squares and least norm, for A (…, m, n), b (…, m).

    Singular values below ``tolerance`` times the largest count as zero.
    """
    left, values, right = np.linalg.svd(matrix, full_matrices=False)
    return _pseudo_solutions(left, values, right, rhs, tolerance)[0]


def least_norm_and_null_space(
    matrix: np.ndarray, rhs: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return ``least_norm`` of one system, and an orthonormal basis (n, k) of the null space."""
    left, values, right = np.linalg.svd(matrix)
    count = len(values)
    x, rank = _pseudo_solutions(left[:, :count], values, right[:count], rhs, tolerance)
    return x, right[int(rank) :].T


def null_space(matrix: np.ndarray, tolerance: float) -> np.ndarray:
    """Return the orthonormal basis (n, k) of the null space of A (m, n) that ``unique_basis`` chooses."""
    return unique_basis(least_norm_and_null_space(matrix, np.zeros(len(matrix)), tolerance)[1])


def unique_basis(basis: np.ndarray) -> np.ndarray:
    """Return the basis B Q (n, k) of the space of an orthonormal basis B (n, k), with Q R = Bᵀ X for fixed
    random numbers X (n, k) and R with a positive diagonal.

    Rounding turns a basis by singular vectors at will within equal singular values. This basis depends on
    the space alone, so that numbers drawn for its coordinates mean one vector on every processor.
    """
    drawn = np.random.default_rng(1).normal(size=basis.shape)
    q, r = np.linalg.qr(basis.T @ drawn)
    return np.asarray(basis @ (q * np.copysign(1.0, np.diag(r))))


def _pseudo_solutions(
    left: np.ndarray, values: np.ndarray, right: np.ndarray, rhs: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return solutions (…, n) and ranks (…,) from singular vectors and values."""
    large = values > tolerance * values.max(axis=-1, keepdims=True, initial=0.0)
    inverse = large / np.where(large, values, 1.0)
    parts = inverse[..., None] * (left.swapaxes(-1, -2) @ rhs[..., None])
    return (right.swapaxes(-1, -2) @ parts)[..., 0], large.sum(axis=-1)
