"""LM2: multipliers from (Φ_q M⁻¹ Φ_qᵀ) λ = Φ_q M⁻¹ g - γ, then q̈ = M⁻¹ (g - Φ_qᵀ λ) (Eqs. 6 to 8).

By Cholesky, in rows scaled to unit diagonal.  Fails on redundant rows and on a singular M.
"""

from __future__ import annotations

from mbref.compiled import exchangeable
from mbref.formulations.base import Formulation
from mbref.formulations.moore_penrose import begin, finish, transpose
from mbref.linalg import cholesky_factor, cholesky_solve, gram, times_transpose
from mbref.tables import ACCELERATE, FACTORISATIONS, OK, SINGULAR

SINGULAR_PIVOT = 1e-13  # of a matrix with unit diagonal; rounding leaves about 1e-15 of a redundant row


@exchangeable(ACCELERATE)
def accelerate(
    mass, inverse_root, jacobian, force, rhs, settings, scratch, pivots, counts, acceleration, multipliers
):
    m, n = jacobian.shape
    d = scratch[: m * n].reshape((m, n))
    s = scratch[m * n : m * n + m * m].reshape((m, m))
    dt = scratch[m * n + m * m : 2 * m * n + m * m].reshape((n, m))
    start = 2 * m * n + m * m
    b, x = scratch[start : start + m], scratch[start + m : start + m + n]
    if not begin(mass, inverse_root, jacobian, force, rhs, d, b, acceleration, multipliers):
        return SINGULAR
    transpose(d, dt)
    gram(dt, s)
    counts[FACTORISATIONS] += 1
    if not cholesky_factor(s, m, SINGULAR_PIVOT):
        return SINGULAR
    cholesky_solve(s, m, b)
    times_transpose(d, b, x)
    finish(inverse_root, x, b, acceleration, multipliers)
    return OK


LM2 = Formulation(
    name="lm2",
    equations="Eqs. 6-8",
    accelerate=accelerate,
    scratch=lambda m, n: 2 * m * n + m * m + m + n,
    handles_redundancy=False,
    handles_singular_mass=False,
)
