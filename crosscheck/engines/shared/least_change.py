"""Changes of velocities of least kinetic energy that meet constraint rows."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_triangular

from crosscheck.engines.shared.sampling import Failed
from mbref.motions.trajectory import Outcome

REDUNDANT = 1e-7  # singular value / largest singular value; smaller values belong to redundant rows


def root_of_mass(mass: np.ndarray, t: float) -> np.ndarray:
    """Return the lower Cholesky factor of a mass matrix (n, n) at time t (s). Raises Failed if the matrix is
    not finite."""
    if not np.isfinite(mass).all():
        raise Failed(Outcome.NOT_FINITE, t, f"the state is not finite at {t:.6g} s")
    return np.linalg.cholesky(mass)


def least_change(root: np.ndarray, jacobian: np.ndarray, wanted: np.ndarray, t: float) -> np.ndarray:
    """Return the change (n,) of least kinetic energy for which rows (m, n) have the wanted values (m,).

    ``root`` is from ``root_of_mass``. Raises Failed if rows or values are not finite.
    """
    if not (np.isfinite(jacobian).all() and np.isfinite(wanted).all()):
        raise Failed(Outcome.NOT_FINITE, t, f"the closure errors are not finite at {t:.6g} s")
    spread = solve_triangular(root, jacobian.T, lower=True).T
    least = np.linalg.lstsq(spread, wanted, rcond=REDUNDANT)[0]
    found: np.ndarray = solve_triangular(root, least, lower=True, trans="T")
    return found
