"""MPI-GS as the paper prints it: D = Q R by Gram–Schmidt and D⁺ = R⁻¹ Qᵀ (Eqs. 29 and 30).

The method requires, as the paper states, that all columns of D are independent: as many independent rows as
coordinates, which only a fully driven mechanism has.  With dependent columns the method fails as SINGULAR.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from mbref.formulations.base import About, Formulation
from mbref.formulations.moore_penrose import recover_solution, scaled_residual, transpose
from mbref.kernels.compilation import exchangeable
from mbref.kernels.layout import ACCELERATE, OK, SINGULAR
from mbref.kernels.named_memory import Matrix, Vector, opener
from mbref.linear_algebra.elimination import back_substitute
from mbref.linear_algebra.orthogonal_factorisations import gram_schmidt

ABOUT = About(
    title="Moore–Penrose inverse as printed",
    meaning="Gram-Schmidt as the paper prints it; fully driven mechanisms only",
    formula=r"D = Q R, \qquad D^+ = R^{-1} Q^T",
    text="Eqs. 29 and 30 as the paper prints them.",
    use=(
        "Fully driven mechanisms, where all columns of D are independent; to see what the printed "
        "equations need."
    ),
    fails="Mechanisms with a degree of freedom that no driver prescribes: `SINGULAR_MATRIX` at t = 0.",
)


class Scratch(NamedTuple):
    """Memory of D, its columns as rows, R, and the two solutions."""

    d: Annotated[Matrix, "m", "n"]
    columns: Annotated[Matrix, "n", "m"]
    r: Annotated[Matrix, "n", "n"]
    b: Annotated[Vector, "max(m, n)"]
    dual: Annotated[Vector, "m"]
    x: Annotated[Vector, "n"]


scratch_of = opener(Scratch)


@exchangeable(ACCELERATE)
def accelerate(system):
    scratch = scratch_of(system.scratch)
    columns, r, b, x, dual = scratch.columns, scratch.r, scratch.b, scratch.x, scratch.dual
    n, m = columns.shape
    if not scaled_residual(system, scratch.d, b):
        return SINGULAR
    transpose(scratch.d, columns)
    dual[:] = 0.0
    system.counts.factorisations += 1
    if not gram_schmidt(columns, r, system.settings.rank_tolerance):
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
    recover_solution(x, dual, system)
    return OK


MPI_GS_LITERAL = Formulation(
    name="mpi-gs-literal",
    about=ABOUT,
    equations="Eqs. 26, 29, 30 as printed",
    accelerate=accelerate,
    scratch=Scratch,
    handles_redundancy=True,
    handles_singular_mass=False,
    needs_independent_columns=True,
)
