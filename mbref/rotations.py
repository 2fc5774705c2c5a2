"""Euler parameters (unit quaternions w, x, y, z; body to world) and rotation vectors.

The functions accept arrays with any leading shape, and are used to read scenes, write trajectories and
measure angles. Compiled kernels use the scalar forms in ``mbref.kernels``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

Vector3 = tuple[float, float, float]  # a point or a vector
# A rotation matrix is 2 (a b ± c d) for the components a, b, c, d of a quaternion (0: w); 1 minus this on the
# diagonal. Few operations on whole arrays take less time than many operations on single components.
FACTOR_PLACES = np.array(
    [
        [2, 1, 1, 1, 1, 2, 1, 2, 1],
        [2, 2, 3, 2, 1, 3, 3, 3, 1],
        [3, 0, 0, 0, 3, 0, 0, 0, 2],
        [3, 3, 2, 3, 3, 1, 2, 1, 2],
    ]
)
PLUS = np.array([1.0, -1.0, 1.0, 1.0, 1.0, -1.0, -1.0, 1.0, 1.0])
DIAGONAL, TWICE = np.eye(3).ravel(), np.where(np.eye(3).ravel() > 0, -2.0, 2.0)


def to_matrix(p: np.ndarray) -> np.ndarray:
    """Return rotation matrices (…, 3, 3) of unit quaternions (…, 4)."""
    p = np.asarray(p, dtype=float)
    factors = p.take(FACTOR_PLACES, axis=-1)
    a, b, c, d = (factors[..., k, :] for k in range(4))
    entries = DIAGONAL + TWICE * (a * b + PLUS * (c * d))
    return entries.reshape(*p.shape[:-1], 3, 3)


def from_matrix(matrix: np.ndarray) -> np.ndarray:
    """Return unit quaternions (…, 4), w ≥ 0, of rotation matrices (…, 3, 3).

    The column of 4 p pᵀ with the largest diagonal entry is used, so that no digits cancel.
    """
    a = np.asarray(matrix, dtype=float)
    trace = a[..., 0, 0] + a[..., 1, 1] + a[..., 2, 2]
    k = np.zeros((*a.shape[:-2], 4, 4))
    k[..., 0, 0] = 1 + trace
    for i in range(3):
        j, l = (i + 1) % 3, (i + 2) % 3
        k[..., 1 + i, 1 + i] = 1 + 2 * a[..., i, i] - trace
        k[..., 0, 1 + i] = k[..., 1 + i, 0] = a[..., l, j] - a[..., j, l]
        k[..., 1 + i, 1 + j] = k[..., 1 + j, 1 + i] = a[..., i, j] + a[..., j, i]
    best = np.argmax(np.diagonal(k, axis1=-2, axis2=-1), axis=-1)
    p = np.take_along_axis(k, best[..., None, None], axis=-2)[..., 0, :]
    p = p / np.linalg.norm(p, axis=-1, keepdims=True)
    return np.where(p[..., :1] < 0, -p, p)


def multiply(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return Hamilton products (…, 4): the rotation q followed by p."""
    p, q = np.asarray(p, dtype=float), np.asarray(q, dtype=float)
    if p.ndim == q.ndim == 1:  # Python's numbers take a quarter of the time of small arrays
        return np.array(_product(*p.tolist(), *q.tolist()))
    product = np.empty(np.broadcast(p, q).shape)
    for k, part in enumerate(_product(*(a[..., i] for a in (p, q) for i in range(4)))):
        product[..., k] = part
    return product


def _product(*components: Any) -> tuple[Any, ...]:
    """Return the components of the product of p and q from theirs, which are numbers or arrays."""
    pw, px, py, pz, qw, qx, qy, qz = components
    return (
        pw * qw - px * qx - py * qy - pz * qz,
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
    )


def conjugate(p: np.ndarray) -> np.ndarray:
    """Return the inverse rotations (…, 4) of unit quaternions."""
    return np.asarray(p, dtype=float) * np.array([1.0, -1.0, -1.0, -1.0])


def unit(v: ArrayLike) -> np.ndarray:
    """Return a vector v / |v| (n,); zero for a zero vector."""
    v = np.asarray(v, dtype=float)
    return np.asarray(v / (np.linalg.norm(v) or 1.0))


NEXT, LAST = np.array([[1, 2, 0], [2, 0, 1]])  # components after and before each component


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return vector products (…, 3); for few vectors this is several times faster than NumPy's function."""
    if a.ndim == b.ndim == 1 and a.dtype == b.dtype == float:
        (a0, a1, a2), (b0, b1, b2) = a.tolist(), b.tolist()
        return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])
    product = a.take(NEXT, -1) * b.take(LAST, -1) - a.take(LAST, -1) * b.take(NEXT, -1)
    return product.astype(float, copy=False) if product.dtype.kind in "iu" else product


def rotate(p: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return vectors (…, 3) transformed from the body frame to the world frame."""
    return np.einsum("...ij,...j->...i", to_matrix(p), v)


def from_vector(v: np.ndarray) -> np.ndarray:
    """Return unit quaternions (…, 4) of rotation vectors (…, 3): axis times angle (rad)."""
    v = np.asarray(v, dtype=float)
    half = np.linalg.norm(v, axis=-1, keepdims=True) / 2
    return np.concatenate([np.cos(half), np.sinc(half / np.pi) * v / 2], axis=-1)


def angle_between(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the geodesic angle (…,) between orientations: 2 atan2(|vector|, |w|) of the relative
    quaternion."""
    relative = multiply(conjugate(p), q)
    return 2 * np.arctan2(np.linalg.norm(relative[..., 1:], axis=-1), np.abs(relative[..., 0]))


def to_vector(p: np.ndarray) -> np.ndarray:
    """Return rotation vectors (k, 3), rad, at most half a turn long, of unit quaternions (k, 4)."""
    p = np.where(p[:, :1] < 0, -p, p)
    sine = np.linalg.norm(p[:, 1:], axis=1, keepdims=True)
    angle = 2 * np.arctan2(sine, p[:, :1])
    return np.where(sine > 0, angle / np.where(sine > 0, sine, 1.0), 2.0) * p[:, 1:]
