"""MPI-SVD: accelerations by the Moore–Penrose inverse from the singular value decomposition.

    q̈ = q̈_unc + M^(-1/2) D⁺ (γ - Φ_q q̈_unc),   D = Φ_q M^(-1/2),   q̈_unc = M⁻¹ g      (Eqs. 26 to 28)

The multipliers are those of least norm in the scaled rows: λ = -(Dᵀ)⁺ M^(1/2) (q̈ - q̈_unc).  Exists for any
rank; singular values up to the rank tolerance times the largest count as zero.
"""

from __future__ import annotations

from mbref.compiled import exchangeable
from mbref.formulations.base import Formulation
from mbref.linalg import equilibrate, svd_solve
from mbref.tables import ACCELERATE, FACTORISATIONS, NOT_FINITE, OK, RANK_TOLERANCE, SINGULAR


@exchangeable(ACCELERATE)
def accelerate(
    mass, inverse_root, jacobian, force, rhs, settings, scratch, pivots, counts, acceleration, multipliers
):
    m, n = jacobian.shape
    d = scratch[: m * n].reshape((m, n))
    b = scratch[m * n : m * n + m]
    x = scratch[m * n + m : m * n + m + n]
    dual = scratch[m * n + m + n : m * n + m + n + m]
    equilibrate(jacobian, inverse_root, d, multipliers)
    for j in range(n):
        if not mass[j] > 0.0:
            return SINGULAR
        acceleration[j] = force[j] / mass[j]
    for i in range(m):
        b[i] = rhs[i]
        for j in range(n):
            b[i] -= jacobian[i, j] * acceleration[j]
        b[i] *= multipliers[i]
    counts[FACTORISATIONS] += 1
    if svd_solve(d, b, settings[RANK_TOLERANCE], x, dual) < 0:
        return NOT_FINITE
    for j in range(n):
        acceleration[j] += inverse_root[j] * x[j]
    for i in range(m):
        multipliers[i] *= -dual[i]
    return OK


MPI_SVD = Formulation(
    name="mpi-svd",
    equations="Eqs. 26-28",
    accelerate=accelerate,
    scratch=lambda m, n: m * n + 2 * m + n,
    handles_redundancy=True,
    handles_singular_mass=False,
)
