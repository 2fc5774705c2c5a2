"""Vectors, quaternions and linear systems for arrays of any arithmetic; leading indices are samples."""

from __future__ import annotations

import numpy as np

from crosscheck.judge.arithmetic import doubles
from crosscheck.judge.deadline import ask

COLUMN = np.array([[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 0, 1], [3, 2, 1, 0]])
SIGN = np.array([[1, -1, -1, -1], [1, 1, -1, 1], [1, 1, 1, -1], [1, -1, 1, 1]])
"""Entries of the matrix L(p) with p q = L(p) q for quaternions."""
REGULAR = 1e-15  # regularisation on the diagonal of the scaled matrix
# least diagonal entry of a mass matrix / largest; smaller entries are scaled as if they had this size
LIGHT = 1e-12
REFINEMENTS = 40


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return vector products (…, 3)."""
    a, b = (np.concatenate([v, v[..., :2]], axis=-1) for v in (a, b))
    return a[..., 1:4] * b[..., 2:5] - a[..., 2:5] * b[..., 1:4]


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return scalar products (…) of vectors (…, n)."""
    return (a * b).sum(axis=-1)


def apply(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Return matrices (…, m, n) times vectors (…, n)."""
    return (matrix @ vector[..., None])[..., 0]


def unit(v: np.ndarray) -> np.ndarray:
    """Return vectors (…, n) scaled to length one."""
    return v / np.sqrt((v * v).sum(axis=-1, keepdims=True))


def product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return Hamilton products (…, 4) of quaternions (w, x, y, z): the rotation q followed by p."""
    return (p[..., COLUMN] * SIGN * q[..., None, :]).sum(axis=-1)


def skew(v: np.ndarray) -> np.ndarray:
    """Return matrices (…, 3, 3) with skew(v) u = v × u."""
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    entries = np.stack([0 * x, -z, y, z, 0 * x, -x, -y, x, 0 * x], axis=-1)
    return entries.reshape(*v.shape[:-1], 3, 3)


def matrices(p: np.ndarray) -> np.ndarray:
    """Return rotation matrices (…, 3, 3) of unit quaternions (…, 4)."""
    w, v = p[..., 0, None, None], p[..., 1:]
    return (2 * w * w - 1) * np.eye(3, dtype=int) + 2 * v[..., None] * v[..., None, :] + 2 * w * skew(v)


def saddle_solve(
    mass: np.ndarray, rows: np.ndarray, force: np.ndarray, right: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return x (K, n) with [M Gᵀ; G 0] (x, λ) = (force, right), and the matrix's distance (K,) from
    singularity.

    M (K, n, n) is positive semidefinite, G (K, m, n), force (K, n), right (K, m).  The inverse is computed in
    double precision, the residuals in the data's arithmetic (iterative refinement; Wilkinson, Rounding Errors
    in Algebraic Processes, 1963).  The distance is the inverse's Frobenius norm to the power -1/2, which is
    proportional to the least singular value of G near singularity. The distance is infinite without
    coordinates.
    """
    n = mass.shape[-1]
    scale, inverse = _scaled_inverse(doubles(mass), doubles(rows))
    matrix = _saddle(mass, rows, rows[:, :, :1] * 0 * np.zeros(rows.shape[1], dtype=int))
    wanted = np.concatenate([force, right], axis=1)
    x, last = wanted * 0, np.full((len(wanted), 1), np.inf)
    for _ in range(REFINEMENTS):
        ask()
        residual = doubles(wanted - apply(matrix, x))
        step = scale * apply(inverse, scale * residual)
        size = np.abs(step / scale).max(axis=1, initial=0.0, keepdims=True)
        settling = size < last / 2
        if not settling.any():
            break
        x, last = x + np.where(settling, step, 0.0), np.where(settling, size, last)
    with np.errstate(divide="ignore"):  # without coordinates no matrix is singular
        return x[:, :n], 1 / np.sqrt(np.linalg.norm(inverse, axis=(1, 2)))


def _scaled_inverse(mass: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return scales s (K, n + m) and the inverse of the matrix scaled from both sides by s.

    The matrix is made quasi-definite, so that it has an inverse at singular positions, too.
    """
    n, m = mass.shape[-1], rows.shape[-2]
    diagonal = np.diagonal(mass, axis1=1, axis2=2)
    light = LIGHT * diagonal.max(axis=1, initial=0.0, keepdims=True) + np.finfo(float).tiny
    across = 1 / np.sqrt(np.maximum(diagonal, light))
    size = np.linalg.norm(rows * across[:, None], axis=2).max(
        axis=0
    )  # also for rows that vanish at some samples
    along = np.broadcast_to(1 / np.where(size > 0, size, 1.0), (len(mass), m))
    scale = np.concatenate([across, along], axis=1)
    matrix = _saddle(mass, rows, np.zeros((len(mass), m, m))) * scale[:, None] * scale[..., None]
    return scale, np.linalg.inv(matrix + REGULAR * np.diag([1.0] * n + [-1.0] * m))


def _saddle(mass: np.ndarray, rows: np.ndarray, corner: np.ndarray) -> np.ndarray:
    upper = np.concatenate([mass, np.swapaxes(rows, 1, 2)], axis=2)
    return np.concatenate([upper, np.concatenate([rows, corner], axis=2)], axis=1)
