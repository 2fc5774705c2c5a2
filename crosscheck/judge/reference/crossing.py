"""Singular positions inside a panel: located by the smallest singular value, and bridged by a polynomial.

On a smooth branch that crosses a singular position transversally, the least singular value of the constraint
Jacobian is |s(t)| with s smooth and s(t*) = 0.  The accelerations stay smooth, but the equations for them
lose digits near t*; near t* the accelerations are taken from a polynomial through the other points.  If the
iteration does not converge with these accelerations, the previous panel is extended across the singular
position (tree.py, panels.py).
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import chebyshev

NEAR = 0.15  # distance from singularity / its median; accelerations at nearer points are interpolated
MOST = 0.25  # largest fraction of interpolated points
DEGREE = 8  # degree of the polynomial by which a change of sign is detected
WINDOW = 12  # points on either side to which the bridging polynomial is fitted
SIGNED = 0.1  # misfit of the signed distance / misfit of the unsigned distance, below which the sign changes


def near_singular(distance: np.ndarray) -> np.ndarray:
    """Return which points (K,) are near a singular position that the panel crosses."""
    return distance < NEAR * np.median(distance)


def singular_time(nodes: np.ndarray, distance: np.ndarray) -> float | None:
    """Return the place in [-1, 1] at which the distance from singularity (K,), given as absolute values,
    changes its sign."""
    near = near_singular(distance)
    if not np.isfinite(distance).all() or not _inside(near):
        return None
    least = int(np.argmin(distance))
    window = np.arange(max(0, least - WINDOW), min(len(nodes), least + WINDOW + 1))
    x, d, k = nodes[window], distance[window], np.arange(len(nodes))[window]
    fits = [_fit(x, d * (1 - 2 * (k < least + after))) for after in (0, 1)]
    misfit, coefficients = min(fits, key=lambda fit: fit[0])
    if misfit > SIGNED * _fit(x, d)[0]:
        return None
    roots = chebyshev.chebroots(coefficients)
    real = roots[np.abs(roots.imag) < 1e-9].real
    inside = real[np.abs(real - nodes[least]) <= np.diff(nodes).max()]
    return float(inside[np.argmin(np.abs(inside - nodes[least]))]) if len(inside) else None


def _inside(near: np.ndarray) -> bool:
    """Return whether some points are to be bridged, not too many, with other points on both sides."""
    return bool(near.any() and near.sum() <= MOST * len(near) and not near[0] and not near[-1])


def singular_ahead(nodes: np.ndarray, distance: np.ndarray) -> float | None:
    """Return the place in (1, 3) at which the distance (K,) from singularity becomes zero if the distance
    continues as at the panel's end."""
    x, d = nodes[-WINDOW // 2 :], distance[-WINDOW // 2 :]
    slope, _ = np.polyfit(x, d, 1)
    ahead = 1 - d[-1] / slope if slope < 0 else np.inf
    return float(ahead) if ahead < 1 + 2 else None


def _fit(x: np.ndarray, d: np.ndarray) -> tuple[float, np.ndarray]:
    """Fit a polynomial to the distances from singularity; return largest residual and coefficients."""
    coefficients = chebyshev.chebfit(x, d, DEGREE)
    return float(np.abs(chebyshev.chebval(x, coefficients) - d).max()), coefficients


def bridged(nodes: np.ndarray, rates: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """Return rates (K, n); near the singular position the rates come from the polynomial through the rates of
    the other points."""
    near = near_singular(distance)
    if not _inside(near):
        return rates
    x = nodes.astype(float)
    degree = len(x) - 2 * int(near.sum()) - 4
    basis = chebyshev.chebvander(x, degree)
    rates = rates.copy()
    rates[near] = basis[near] @ (np.linalg.pinv(basis[~near]) @ rates[~near])
    return rates
