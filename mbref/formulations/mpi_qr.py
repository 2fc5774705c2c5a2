"""MPI-QR: Eq. 26 by a pivoted Householder QR of Dᵀ, the cheapest of the rank-revealing ones here.

Dᵀ P = Q R; the rows behind the rank are redundant and left out, so that x = Q₁ R₁⁻ᵀ b₁ is the
solution of least norm and equals D⁺ b for consistent equations (Kim & Vanderploeg, ASME J. Mech.
Trans. Aut. Des. 108, 1986, use the same factorisation).  Redundant rows get no multiplier.
"""

from __future__ import annotations

from mbref.formulations.base import Formulation
from mbref.formulations.moore_penrose import begin, finish
from mbref.kernels.compilation import exchangeable
from mbref.kernels.layout import ACCELERATE, FACTORISATIONS, OK, RANK_TOLERANCE, SINGULAR
from mbref.linear_algebra.orthogonal_factorisations import minimum_norm, qr_pivoted, row_multipliers


@exchangeable(ACCELERATE)
def accelerate(
    mass, inverse_root, jacobian, force, rhs, settings, scratch, pivots, counts, acceleration, multipliers
):
    m, n = jacobian.shape
    d = scratch[: m * n].reshape((m, n))
    t = scratch[m * n : 2 * m * n].reshape((n, m))
    start = 2 * m * n
    b, dual = scratch[start : start + m], scratch[start + m : start + 2 * m]
    tau, work = scratch[start + 2 * m : start + 3 * m], scratch[start + 3 * m : start + 4 * m]
    norms = scratch[start + 4 * m : start + 6 * m].reshape((2, m))
    x = scratch[start + 6 * m : start + 6 * m + n]
    if not begin(mass, inverse_root, jacobian, force, rhs, d, b, acceleration, multipliers):
        return SINGULAR
    for i in range(m):
        for j in range(n):
            t[j, i] = d[i, j]
    counts[FACTORISATIONS] += 1
    rank = qr_pivoted(t, n, m, pivots, tau, norms, work, settings[RANK_TOLERANCE])
    minimum_norm(t, n, rank, pivots, tau, b, x)
    row_multipliers(t, rank, pivots, b, work, dual)
    finish(inverse_root, x, dual, acceleration, multipliers)
    return OK


MPI_QR = Formulation(
    name="mpi-qr",
    equations="Eq. 26 with a pivoted QR",
    accelerate=accelerate,
    scratch=lambda m, n: 2 * m * n + 6 * m + n,
    pivots_by_size=True,
    handles_redundancy=True,
    handles_singular_mass=False,
)
