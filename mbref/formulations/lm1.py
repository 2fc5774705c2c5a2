"""LM1: the augmented system of Eq. 5, solved as it stands by LU with partial pivoting.

    [M   Φ_qᵀ] [q̈]   [g]
    [Φ_q   0 ] [λ ] = [γ]

Scaled symmetrically by M^(-1/2) and the length of the rows, which changes no solution, so that "singular"
does not depend on units.  Fails on redundant rows; needs no M⁻¹, so that bodies without inertia are
allowed where the constraints hold them.
"""

from __future__ import annotations

from mbref.formulations.base import Formulation
from mbref.kernels.compilation import exchangeable
from mbref.kernels.layout import ACCELERATE, FACTORISATIONS, OK, SINGULAR
from mbref.linear_algebra.elimination import lu_factor, lu_solve
from mbref.linear_algebra.orthogonal_factorisations import equilibrate

SINGULAR_PIVOT = 1e-12  # of the scaled matrix, whose rows and columns have unit size


@exchangeable(ACCELERATE)
def accelerate(
    mass, inverse_root, jacobian, force, rhs, settings, scratch, pivots, counts, acceleration, multipliers
):
    m, n = jacobian.shape
    size = m + n
    a = scratch[: size * size].reshape((size, size))
    d = scratch[size * size : size * size + m * n].reshape((m, n))
    b = scratch[size * size + m * n : size * size + m * n + size]
    equilibrate(jacobian, inverse_root, d, multipliers)
    a[:] = 0.0
    for j in range(n):
        a[j, j] = mass[j] * inverse_root[j] * inverse_root[j]
        b[j] = force[j] * inverse_root[j]
    for i in range(m):
        b[n + i] = rhs[i] * multipliers[i]
        for j in range(n):
            a[n + i, j] = d[i, j]
            a[j, n + i] = d[i, j]
    counts[FACTORISATIONS] += 1
    if not lu_factor(a, size, pivots, SINGULAR_PIVOT):
        return SINGULAR
    lu_solve(a, size, pivots, b)
    for j in range(n):
        acceleration[j] = b[j] * inverse_root[j]
    for i in range(m):
        multipliers[i] *= b[n + i]
    return OK


LM1 = Formulation(
    name="lm1",
    equations="Eq. 5",
    accelerate=accelerate,
    scratch=lambda m, n: (m + n) * (m + n) + m * n + m + n,
    pivots_by_size=True,
    handles_redundancy=False,
    handles_singular_mass=True,
)
