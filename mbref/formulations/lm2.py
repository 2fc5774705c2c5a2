"""LM2: multipliers from (Φ_q M⁻¹ Φ_qᵀ) λ = Φ_q M⁻¹ g - γ, then q̈ = M⁻¹ (g - Φ_qᵀ λ) (Eqs. 6 to 8).

By Cholesky, which the scale of rows does not disturb.  Fails on redundant rows and on a singular M.  What
rounding leaves of a redundant row is ε over the pivots before it, 1e-16 to 5e-12 on the paper's mechanisms at
random poses; so a row nearer than 3e-6 rad to dependent counts as redundant.
"""

from __future__ import annotations

from mbref.formulations.base import Formulation
from mbref.kernels.compilation import exchangeable
from mbref.kernels.layout import ACCELERATE, FACTORISATIONS, OK, SINGULAR
from mbref.linear_algebra.elimination import cholesky_factor, cholesky_solve, gram

SINGULAR_PIVOT = 1e-11  # of its diagonal entry: the square of the sine between a row and those before


@exchangeable(ACCELERATE)
def accelerate(
    mass, inverse_root, jacobian, force, rhs, settings, scratch, pivots, counts, acceleration, multipliers
):
    m, n = jacobian.shape
    dt = scratch[: n * m].reshape((n, m))  # the transpose of D = Φ_q M^(-1/2)
    s = scratch[n * m : n * m + m * m].reshape((m, m))
    start = n * m + m * m
    b, diagonal = scratch[start : start + m], scratch[start + m : start + 2 * m]
    for i in range(m):
        b[i] = -rhs[i]
    for j in range(n):
        if not mass[j] > 0.0:
            return SINGULAR
        acceleration[j] = force[j] / mass[j]
        for i in range(m):
            b[i] += jacobian[i, j] * acceleration[j]
            dt[j, i] = jacobian[i, j] * inverse_root[j]
    gram(dt, s)
    for i in range(m):
        diagonal[i] = s[i, i]
    counts[FACTORISATIONS] += 1
    if not cholesky_factor(s, m):
        return SINGULAR
    for i in range(m):
        if not s[i, i] * diagonal[i] < 1.0 / SINGULAR_PIVOT:
            return SINGULAR
    cholesky_solve(s, m, b)
    for j in range(n):
        for i in range(m - 1, -1, -1):  # the solution's last entry is found first
            acceleration[j] -= inverse_root[j] * dt[j, i] * b[i]
    for i in range(m):
        multipliers[i] = b[i]
    return OK


LM2 = Formulation(
    name="lm2",
    equations="Eqs. 6-8",
    accelerate=accelerate,
    scratch=lambda m, n: n * m + m * m + 2 * m,
    handles_redundancy=False,
    handles_singular_mass=False,
)
