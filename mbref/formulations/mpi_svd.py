"""MPI-SVD: accelerations by the Moore–Penrose inverse from the singular value decomposition.

D = U S Vᵀ and D⁺ = V S⁺ Uᵀ (Eqs. 27 and 28) in Eq. 26.  Exists for any rank; singular values up to the
rank tolerance times the largest count as zero.  The multipliers are those of least norm in scaled rows.
"""

from __future__ import annotations

from mbref.formulations.base import Formulation
from mbref.formulations.moore_penrose import begin, finish
from mbref.kernels.compilation import exchangeable
from mbref.kernels.layout import ACCELERATE, FACTORISATIONS, NOT_FINITE, OK, RANK_TOLERANCE, SINGULAR
from mbref.linear_algebra.orthogonal_factorisations import svd_solve


@exchangeable(ACCELERATE)
def accelerate(
    mass, inverse_root, jacobian, force, rhs, settings, scratch, pivots, counts, acceleration, multipliers
):
    m, n = jacobian.shape
    d = scratch[: m * n].reshape((m, n))
    b = scratch[m * n : m * n + m]
    x = scratch[m * n + m : m * n + m + n]
    dual = scratch[m * n + m + n : m * n + m + n + m]
    if not begin(mass, inverse_root, jacobian, force, rhs, d, b, acceleration, multipliers):
        return SINGULAR
    counts[FACTORISATIONS] += 1
    if svd_solve(d, b, settings[RANK_TOLERANCE], x, dual) < 0:
        return NOT_FINITE
    finish(inverse_root, x, dual, acceleration, multipliers)
    return OK


MPI_SVD = Formulation(
    name="mpi-svd",
    equations="Eqs. 26-28",
    accelerate=accelerate,
    scratch=lambda m, n: m * n + 2 * m + n,
    pivots_by_size=True,
    handles_redundancy=True,
    handles_singular_mass=False,
)
