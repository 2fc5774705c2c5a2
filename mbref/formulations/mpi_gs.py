"""MPI-GS: accelerations by the Moore–Penrose inverse from Gram–Schmidt orthogonalisation.

Eqs. 29 and 30 ask for independent columns, which redundant rows with free coordinates do not give.  Here
columns are taken in the order of their size and dependent ones left out, D P = Q R, and a second
orthogonalisation of the rows of R gives R = L Zᵀ: D⁺ = P Z L⁻¹ Qᵀ, the true inverse for any rank.
"""

from __future__ import annotations

from mbref.formulations.base import Formulation
from mbref.formulations.moore_penrose import begin, finish
from mbref.kernels.compilation import exchangeable
from mbref.kernels.layout import ACCELERATE, FACTORISATIONS, OK, RANK_TOLERANCE, SINGULAR
from mbref.linear_algebra.orthogonal_factorisations import gram_schmidt_solve


@exchangeable(ACCELERATE)
def accelerate(
    mass, inverse_root, jacobian, force, rhs, settings, scratch, pivots, counts, acceleration, multipliers
):
    m, n = jacobian.shape
    d = scratch[: m * n].reshape((m, n))
    columns = scratch[m * n : 2 * m * n].reshape((n, m))
    r = scratch[2 * m * n : 2 * m * n + n * n].reshape((n, n))
    l = scratch[2 * m * n + n * n : 2 * m * n + 2 * n * n].reshape((n, n))
    start = 2 * m * n + 2 * n * n
    b = scratch[start : start + m]
    dual = scratch[start + m : start + 2 * m]
    x = scratch[start + 2 * m : start + 2 * m + n]
    c = scratch[start + 2 * m + n : start + 2 * m + 2 * n]
    if not begin(mass, inverse_root, jacobian, force, rhs, d, b, acceleration, multipliers):
        return SINGULAR
    counts[FACTORISATIONS] += 1
    gram_schmidt_solve(d, b, settings[RANK_TOLERANCE], columns, r, l, pivots, c, x, dual)
    finish(inverse_root, x, dual, acceleration, multipliers)
    return OK


MPI_GS = Formulation(
    name="mpi-gs",
    equations="Eqs. 26, 29, 30",
    accelerate=accelerate,
    scratch=lambda m, n: 2 * m * n + 2 * n * n + 2 * m + 2 * n,
    pivots_by_size=True,
    handles_redundancy=True,
    handles_singular_mass=False,
)
