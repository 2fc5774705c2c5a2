"""LM2: multipliers from (Φ_q M⁻¹ Φ_qᵀ) λ = Φ_q M⁻¹ g - γ, then q̈ = M⁻¹ (g - Φ_qᵀ λ) (Eqs. 6 to 8).

The multipliers are computed by Cholesky factorisation, which does not depend on the scale of rows. LM2 fails
on redundant rows and on a singular M. The pivot of a redundant row is rounding: ε divided by earlier pivots,
1e-16 to 5e-12 on the paper's mechanisms at random poses. So a row within 3e-6 rad of a dependent row counts
as redundant.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from mbref.formulations.base import About, Formulation
from mbref.kernels.compilation import exchangeable, kernel
from mbref.kernels.layout import ACCELERATE, OK, SINGULAR
from mbref.kernels.named_memory import Matrix, Vector, opener
from mbref.linear_algebra.elimination import cholesky_factor, cholesky_solve, gram

ABOUT = About(
    title="Lagrange multipliers, the Schur complement",
    meaning="Lagrange multipliers first, by Cholesky; cheap; fails on redundant rows",
    formula=(
        r"(\Phi_q M^{-1} \Phi_q^T)\, \lambda = \Phi_q M^{-1} g - \gamma, \qquad \ddot q = M^{-1} (g - "
        r"\Phi_q^T \lambda)"
    ),
    text="Eqs. 6 to 8, by Cholesky.",
    use="Mechanisms without redundant rows and with all masses; it needs the fewest operations.",
    fails=("Redundant rows (also rows within 3e-6 rad of a dependent one), and bodies without inertia."),
)

DEPENDENT_PIVOT = 1e-11  # pivot / diagonal entry: sine² of the angle between a row and earlier rows


class Scratch(NamedTuple):
    """Memory of the Schur complement and its factors."""

    transposed: Annotated[Matrix, "n", "m"]  # M^(-1/2) Φ_qᵀ
    s: Annotated[Matrix, "m", "m"]  # Φ_q M⁻¹ Φ_qᵀ and its Cholesky factor
    b: Annotated[Vector, "m"]
    diagonal: Annotated[Vector, "m"]  # of S


scratch_of = opener(Scratch)


@kernel
def factor_schur_complement(rows, dt, s, diagonal):
    """Factorise Φ_q M⁻¹ Φ_qᵀ from the first columns of M^(-1/2) Φ_qᵀ; return False if rows are dependent."""
    gram(dt, s)
    for i in range(rows):
        diagonal[i] = s[i, i]
    if not cholesky_factor(s, rows):
        return False
    for i in range(rows):  # noqa: SIM110 - kernels have no generators
        if not s[i, i] * diagonal[i] < 1.0 / DEPENDENT_PIVOT:
            return False
    return True


@exchangeable(ACCELERATE)
def accelerate(system):
    scratch, jacobian, acceleration = scratch_of(system.scratch), system.jacobian, system.acceleration
    dt, s, b, diagonal = scratch.transposed, scratch.s, scratch.b, scratch.diagonal
    m, n = jacobian.shape
    for i in range(m):
        b[i] = -system.rhs[i]
    for j in range(n):
        if not system.mass[j] > 0.0:
            return SINGULAR
        acceleration[j] = system.force[j] / system.mass[j]
        for i in range(m):
            b[i] += jacobian[i, j] * acceleration[j]
            dt[j, i] = jacobian[i, j] * system.inverse_root[j]
    system.counts.factorisations += 1
    if not factor_schur_complement(m, dt, s, diagonal):
        return SINGULAR
    cholesky_solve(s, m, b)
    for j in range(n):
        for i in range(m - 1, -1, -1):  # the solution's last entry is found first
            acceleration[j] -= system.inverse_root[j] * dt[j, i] * b[i]
    for i in range(m):
        system.multipliers[i] = b[i]
    return OK


LM2 = Formulation(
    name="lm2",
    about=ABOUT,
    equations="Eqs. 6-8",
    accelerate=accelerate,
    scratch=Scratch,
    handles_redundancy=False,
    handles_singular_mass=False,
)
