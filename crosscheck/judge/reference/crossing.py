"""Singular positions inside a panel: found by the smallest singular value, bridged by a polynomial.

On a smooth branch that crosses a singular position transversally, the least singular value of the constraint
Jacobian is |s(t)| with s smooth and s(t*) = 0.  The accelerations stay smooth, but the equations for them
lose digits near t*; there they are taken from a polynomial through the other points.  Where the iteration
does not settle with these, the panel before is continued over the singular position (tree.py, panels.py).
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import chebyshev

NEAR = 0.15  # fraction of the median distance from singularity: nearer points are interpolated
MOST = 0.25  # largest fraction of interpolated points
DEGREE = 8  # degree of the polynomial that tests whether the distance changes its sign
WINDOW = 12  # points on either side that it goes through
SIGNED = 0.1  # misfit of the signed distance, relative to the misfit of the unsigned distance


def near_singular(distance: np.ndarray) -> np.ndarray:
    """Which points (K,) are near a singular position that the panel crosses."""
    return distance < NEAR * np.median(distance)


def singular_time(nodes: np.ndarray, distance: np.ndarray) -> float | None:
    """Where in [-1, 1] the distances (K,) from singularity, given as absolute values, change their sign."""
    near = near_singular(distance)
    if not np.isfinite(distance).all() or not _inside(near):
        return None
    least = int(np.argmin(distance))
    window = np.arange(max(0, least - WINDOW), min(len(nodes), least + WINDOW + 1))
    x, d, k = nodes[window], distance[window], np.arange(len(nodes))[window]
    fits = [_fit(x, np.where(k < least + after, -d, d)) for after in (0, 1)]
    misfit, coefficients = min(fits, key=lambda fit: fit[0])
    if misfit > SIGNED * _fit(x, d)[0]:
        return None
    roots = chebyshev.chebroots(coefficients)
    real = roots[np.abs(roots.imag) < 1e-9].real
    inside = real[np.abs(real - nodes[least]) <= np.diff(nodes).max()]
    return float(inside[np.argmin(np.abs(inside - nodes[least]))]) if len(inside) else None


def _inside(near: np.ndarray) -> bool:
    """Whether there are points to be bridged, not too many and with others on both sides."""
    return bool(near.any() and near.sum() <= MOST * len(near) and not near[0] and not near[-1])


def singular_ahead(nodes: np.ndarray, distance: np.ndarray) -> float | None:
    """Where in (1, 3) the distances (K,) will come to zero if they go on as at the panel's end."""
    x, d = nodes[-WINDOW // 2 :], distance[-WINDOW // 2 :]
    slope, _ = np.polyfit(x, d, 1)
    ahead = 1 - d[-1] / slope if slope < 0 else np.inf
    return float(ahead) if ahead < 1 + 2 else None


def _fit(x: np.ndarray, d: np.ndarray) -> tuple[float, np.ndarray]:
    """Fit a polynomial to the distances from singularity; return largest residual and coefficients."""
    coefficients = chebyshev.chebfit(x, d, DEGREE)
    return float(np.abs(chebyshev.chebval(x, coefficients) - d).max()), coefficients


def bridged(nodes: np.ndarray, rates: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """Rates (K, n) with those near the singular position from the polynomial through the others."""
    near = near_singular(distance)
    if not _inside(near):
        return rates
    x = nodes.astype(float)
    degree = len(x) - 2 * int(near.sum()) - 4
    basis = chebyshev.chebvander(x, degree)
    rates = rates.copy()
    rates[near] = basis[near] @ (np.linalg.pinv(basis[~near]) @ rates[~near])
    return rates
