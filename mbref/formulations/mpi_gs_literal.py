"""MPI-GS as the paper prints it: D = Q R by Gram–Schmidt and D⁺ = R⁻¹ Qᵀ (Eqs. 29 and 30).

Requires, as the paper says, that all columns of D are independent: as many independent rows as
coordinates, which only a fully driven mechanism has.  Fails as SINGULAR otherwise.
"""

from __future__ import annotations

from mbref.formulations.base import Formulation
from mbref.formulations.moore_penrose import begin, finish
from mbref.kernels.compilation import exchangeable
from mbref.kernels.layout import ACCELERATE, FACTORISATIONS, OK, RANK_TOLERANCE, SINGULAR
from mbref.linear_algebra.elimination import back_substitute
from mbref.linear_algebra.orthogonal_factorisations import gram_schmidt


@exchangeable(ACCELERATE)
def accelerate(
    mass, inverse_root, jacobian, force, rhs, settings, scratch, pivots, counts, acceleration, multipliers
):
    m, n = jacobian.shape
    d = scratch[: m * n].reshape((m, n))
    columns = scratch[m * n : 2 * m * n].reshape((n, m))
    r = scratch[2 * m * n : 2 * m * n + n * n].reshape((n, n))
    start = 2 * m * n + n * n
    b, dual = scratch[start : start + m], scratch[start + m : start + 2 * m]
    x = scratch[start + 2 * m : start + 2 * m + n]
    if not begin(mass, inverse_root, jacobian, force, rhs, d, b, acceleration, multipliers):
        return SINGULAR
    for i in range(m):
        dual[i] = 0.0
        for j in range(n):
            columns[j, i] = d[i, j]
    counts[FACTORISATIONS] += 1
    if not gram_schmidt(columns, r, settings[RANK_TOLERANCE]):
        return SINGULAR
    for k in range(n):  # x = R⁻¹ Qᵀ b
        x[k] = 0.0
        for i in range(m):
            x[k] += columns[k, i] * b[i]
    back_substitute(r, n, x)
    for k in range(n):  # (Dᵀ)⁺ x = Q R⁻ᵀ x
        value = x[k]
        for i in range(k):
            value -= r[i, k] * b[i]
        b[k] = value / r[k, k]
        for i in range(m):
            dual[i] += columns[k, i] * b[k]
    finish(inverse_root, x, dual, acceleration, multipliers)
    return OK


MPI_GS_LITERAL = Formulation(
    name="mpi-gs-literal",
    equations="Eqs. 26, 29, 30 as printed",
    accelerate=accelerate,
    scratch=lambda m, n: 2 * m * n + n * n + 2 * max(m, n) + n,
    pivots_by_size=True,
    handles_redundancy=True,
    handles_singular_mass=False,
    needs_independent_columns=True,
)
