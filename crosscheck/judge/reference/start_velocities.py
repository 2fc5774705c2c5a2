"""Initial velocities by the documented rule, to the last digit of any arithmetic.

Among the velocities that satisfy the rows, the rule selects the velocities nearest to the given velocities.
If degrees of freedom are left, it selects the velocities of least kinetic energy. Each solution is corrected
by pseudo-inverses in double precision until its residuals, computed in the arithmetic itself, are at rounding
level (Å. Björck, Numerical Methods for Least Squares Problems, 1996, section 2.9). In double precision alone
the start would differ from the start of the rule by 1e-16, and near singular positions by 1e-13, in all
formulations alike.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crosscheck.judge import constraints
from crosscheck.judge.arithmetic import Arithmetic, doubles
from crosscheck.judge.deadline import ask
from crosscheck.judge.tolerances import RANK
from mbref.scene import Scene

ROUNDS = 40  # largest number of correction steps
STALLED = 0.5  # ratio of successive corrections above which the iteration ends


@dataclass(frozen=True)
class Given:
    """The velocities that a scene gives: the ``components`` among (nb, 6) velocities and angular velocities,
    their ``values`` (g,), and ``weights`` (g,).

    The weight of an angular velocity is the scene's length.
    """

    components: np.ndarray
    values: np.ndarray
    weights: np.ndarray


def given(scene: Scene) -> Given:
    """Return the given velocities of a scene."""
    left_out = (np.nan,) * 3
    rows = [(*(b.velocity or left_out), *(b.angular_velocity or left_out)) for b in scene.body]
    values = np.array(rows, dtype=float).ravel()
    components = np.flatnonzero(~np.isnan(values))
    weights = np.where(components % 6 < 3, 1.0, constraints.scene_length(scene))
    return Given(components, values[components], weights)


def start_velocities(
    arithmetic: Arithmetic,
    rows: np.ndarray,
    rates: np.ndarray,
    fit: np.ndarray,
    wanted: np.ndarray,
    mass: np.ndarray,
) -> np.ndarray:
    """Return z (n,) with rows (m, n) z = rates (m,), then with least |fit (g, n) z - wanted (g,)|, then with
    least zᵀ mass (n, n) z.

    The rows must be independent.
    """
    z = least_squares(arithmetic, rows, rates)
    free = null_space(arithmetic, rows)
    fitted = arithmetic.settled(fit @ free)
    z = arithmetic.settled(z + free @ least_squares(arithmetic, fitted, wanted - fit @ z))
    free = arithmetic.settled(free @ null_space(arithmetic, fitted))
    energy, momentum = arithmetic.settled(free.T @ mass @ free), arithmetic.settled(free.T @ (mass @ z))
    return arithmetic.settled(z - free @ least_squares(arithmetic, energy, momentum))


def least_squares(arithmetic: Arithmetic, matrix: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return x (n,) with least |matrix (m, n) x - wanted (m,)|."""
    inverse = np.linalg.pinv(doubles(matrix), rcond=RANK)
    x, left, last = arithmetic.zeros(matrix.shape[1]), wanted, np.inf
    for _ in range(ROUNDS):
        ask()
        gap, slope = doubles(wanted - left - matrix @ x), doubles(-1 * matrix.T @ left)
        step = inverse @ (gap - inverse.T @ slope)
        size = float(np.abs(step).max(initial=0.0))
        if not size < STALLED * last:
            break
        x, last = arithmetic.settled(x + step), size
        left = arithmetic.settled(left + (gap - doubles(matrix) @ step))
    return x


def null_space(arithmetic: Arithmetic, matrix: np.ndarray) -> np.ndarray:
    """Return a nearly orthonormal basis (n, k) of the null space of a matrix (m, n)."""
    near = doubles(matrix)
    _, s, vt = np.linalg.svd(near, full_matrices=True)
    rank = int((s > RANK * s.max(initial=0.0)).sum())
    basis, inverse, last = arithmetic.array(vt[rank:].T), np.linalg.pinv(near, rcond=RANK), np.inf
    for _ in range(ROUNDS):
        ask()
        step = inverse @ doubles(matrix @ basis)
        size = float(np.abs(step).max(initial=0.0))
        if not size < STALLED * last:
            break
        basis, last = arithmetic.settled(basis - step), size
    return basis
