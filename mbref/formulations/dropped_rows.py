"""LM2 on independent rows alone: dependent rows are dropped at the first pose, or anew at every step.

Multibody codes of industry do so with redundant constraints: a pivoted factorisation of Φ_q finds as many
rows as its rank, the others are left out, and their multipliers are zero (Wehage & Haug, ASME J. Mech. Des.
104, 1982; Kim & Vanderploeg, ASME J. Mech. Trans. Aut. Des. 108, 1986; Wojtyra & Frączek, Multibody Syst.
Dyn. 30, 2013, on the arbitrary reactions).  Of the rows kept, Φ_k q̈ = γ_k:

    (Φ_k M⁻¹ Φ_kᵀ) λ_k = Φ_k M⁻¹ g - γ_k,    q̈ = M⁻¹ (g - Φ_kᵀ λ_k),    λ = 0 on dropped rows

``lm2-first-rows`` chooses rows at its first evaluation and keeps them: rows that depend on others at that
pose alone, for instance at a singular position, stay dropped, and the motion leaves them.  ``lm2-step-rows``
chooses at the first evaluation after every accepted step.  Both end as SINGULAR where rows kept become
dependent.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from mbref.formulations.base import About, Dense, Formulation
from mbref.formulations.lm2 import factor_schur_complement
from mbref.formulations.moore_penrose import transpose
from mbref.kernels.compilation import exchangeable, kernel
from mbref.kernels.layout import ACCELERATE, OK, SINGULAR
from mbref.kernels.named_memory import Indices, Matrix, Vector, opener
from mbref.linear_algebra.elimination import cholesky_solve
from mbref.linear_algebra.orthogonal_factorisations import equilibrate, qr_pivoted

ABOUT_STEP_ROWS = About(
    title="Dependent rows dropped at every step",
    meaning="lm2 without the rows that are dependent at each step",
    formula=(
        r"(\Phi_k M^{-1} \Phi_k^T)\, \lambda_k = \Phi_k M^{-1} g - \gamma_k, \qquad \lambda = 0 \text{ on"
        " dropped rows}"
    ),
    text=(
        "Like `lm2-first-rows`, but rows are selected again at the first evaluation after each accepted step."
    ),
    use="Mechanisms whose dependent rows change with the pose.",
    fails=(
        "Singular positions without projection: a row that is dropped there leaves the motion free to "
        "change its branch. The multipliers of redundant rows jump when other rows are "
        "selected."
    ),
)

ABOUT_FIRST_ROWS = About(
    title="Dependent rows dropped once",
    meaning="lm2 without the rows that are dependent at t = 0",
    formula=(
        r"(\Phi_k M^{-1} \Phi_k^T)\, \lambda_k = \Phi_k M^{-1} g - \gamma_k, \qquad \lambda = 0 \text{ on"
        " dropped rows}"
    ),
    text=(
        "A pivoted QR of the constraint Jacobian at the first evaluation finds as many independent rows "
        "as its rank; the other rows are dropped for the whole run, as many industrial codes do."
    ),
    use=("Comparisons with such codes; mechanisms whose redundant rows do not change along the motion."),
    fails=(
        "Mechanisms whose dependent rows change: `SINGULAR_MATRIX` if the kept rows become dependent."
        " At a singular start it drops a row that is needed later. Reactions of redundant rows depend on"
        " the choice."
    ),
)


class Choice(NamedTuple):
    """Number of rows kept, and the number of steps taken when they were chosen."""

    rank: int = 0
    step: int = -1  # none yet


class Scratch(NamedTuple):
    """The factors that choose rows, and the Schur complement of the rows kept."""

    d: Annotated[Matrix, "m", "n"]  # Φ_q M^(-1/2) with rows of unit length
    transposed: Annotated[Matrix, "n", "m"]  # Dᵀ and its QR; then M^(-1/2) Φ_kᵀ
    order: Annotated[Indices, "m"]  # rows kept first
    tau: Annotated[Vector, "m"]
    work: Annotated[Vector, "m"]
    norms: Annotated[Matrix, 2, "m"]
    s: Annotated[Matrix, "m", "m"]  # Φ_k M⁻¹ Φ_kᵀ and its Cholesky factor
    b: Annotated[Vector, "m"]
    choice: Choice


scratch_of = opener(Scratch)


@kernel
def choose_rows(system, scratch):
    """Choose independent rows by a pivoted QR of Dᵀ."""
    equilibrate(system.jacobian, system.inverse_root, scratch.d, scratch.work)
    transpose(scratch.d, scratch.transposed)
    system.counts.factorisations += 1
    scratch.choice.rank = qr_pivoted(system.settings.rank_tolerance, scratch)
    scratch.choice.step = system.counts.steps


@kernel
def solve_kept_rows(system, scratch):
    """q̈ and λ from the rows kept; SINGULAR where these are dependent, or M is singular."""
    acceleration, b, order = system.acceleration, scratch.b, scratch.order
    n, rank, s = acceleration.shape[0], scratch.choice.rank, scratch.s
    for j in range(n):
        if not system.mass[j] > 0.0:
            return SINGULAR
        acceleration[j] = system.force[j] / system.mass[j]
    put_kept_rows(system, scratch)
    system.counts.factorisations += 1
    if not factor_schur_complement(rank, scratch.transposed, s, scratch.work):
        return SINGULAR
    cholesky_solve(s, rank, b)
    system.multipliers[:] = 0.0
    for k in range(rank):
        system.multipliers[order[k]] = b[k]
        for j in range(n):
            acceleration[j] -= system.inverse_root[j] * scratch.transposed[j, k] * b[k]
    return OK


@kernel
def put_kept_rows(system, scratch):
    """M^(-1/2) Φ_kᵀ into the first columns of ``transposed``, and b = Φ_k M⁻¹ g - γ_k."""
    dt, b = scratch.transposed, scratch.b
    dt[:] = 0.0
    for k in range(scratch.choice.rank):
        row = scratch.order[k]
        b[k] = -system.rhs[row]
        for j in range(dt.shape[0]):
            b[k] += system.jacobian[row, j] * system.acceleration[j]
            dt[j, k] = system.jacobian[row, j] * system.inverse_root[j]


@exchangeable(ACCELERATE)
def accelerate_by_first_rows(system):
    """Accelerations and multipliers from the rows chosen at the first evaluation."""
    scratch = scratch_of(system.scratch)
    if scratch.choice.step < 0:
        choose_rows(system, scratch)
    return solve_kept_rows(system, scratch)


@exchangeable(ACCELERATE)
def accelerate_by_step_rows(system):
    """Accelerations and multipliers from the rows chosen since the last accepted step."""
    scratch = scratch_of(system.scratch)
    if scratch.choice.step != system.counts.steps:
        choose_rows(system, scratch)
    return solve_kept_rows(system, scratch)


LM2_FIRST_ROWS = Formulation(
    name="lm2-first-rows",
    about=ABOUT_FIRST_ROWS,
    equations="Eqs. 6-8 on rows chosen once",
    accelerate=accelerate_by_first_rows,
    linear_algebra=Dense(Scratch),
    needs_all_rows=True,
    handles_redundancy=True,
    handles_singular_mass=False,
)
LM2_STEP_ROWS = Formulation(
    name="lm2-step-rows",
    about=ABOUT_STEP_ROWS,
    equations="Eqs. 6-8 on rows chosen at every step",
    accelerate=accelerate_by_step_rows,
    linear_algebra=Dense(Scratch),
    needs_all_rows=True,
    handles_redundancy=True,
    handles_singular_mass=False,
)
