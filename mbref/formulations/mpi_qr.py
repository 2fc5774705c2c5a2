"""MPI-QR: Eq. 26 by a Householder QR of Dᵀ with pivoting, the cheapest rank-revealing factorisation among the
formulations.

Dᵀ P = Q R; the rows behind the rank are redundant and left out, so that x = Q₁ R₁⁻ᵀ b₁ is the
solution of least norm and equals D⁺ b for consistent equations (Kim & Vanderploeg, ASME J. Mech.
Trans. Aut. Des. 108, 1986, use the same factorisation).  Redundant rows get no multiplier.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from mbref.formulations.base import About, Formulation
from mbref.formulations.moore_penrose import recover_solution, scaled_residual, transpose
from mbref.kernels.compilation import exchangeable
from mbref.kernels.layout import ACCELERATE, OK, SINGULAR
from mbref.kernels.named_memory import Indices, Matrix, Vector, opener
from mbref.linear_algebra.orthogonal_factorisations import minimum_norm, qr_pivoted, row_multipliers

ABOUT = About(
    title="Moore–Penrose inverse by pivoted QR",
    meaning="Moore-Penrose inverse by pivoted QR; any rank; the cheapest of them",
    formula=r"D^T P = Q R, \qquad x = Q_1 R_1^{-T} b_1",
    text="Householder QR of the transpose; rows beyond the rank are dropped (Kim & Vanderploeg, 1986).",
    use="The cheapest dense method that accepts redundant rows.",
    fails=("Bodies without mass. Redundant rows get no multiplier: reactions depend on the selected rows."),
)


class Scratch(NamedTuple):
    """Memory of D, the factors of its transpose, and the two solutions."""

    d: Annotated[Matrix, "m", "n"]
    transposed: Annotated[Matrix, "n", "m"]
    order: Annotated[Indices, "m"]
    tau: Annotated[Vector, "m"]
    work: Annotated[Vector, "m"]
    norms: Annotated[Matrix, 2, "m"]
    b: Annotated[Vector, "m"]
    dual: Annotated[Vector, "m"]
    x: Annotated[Vector, "n"]


scratch_of = opener(Scratch)


@exchangeable(ACCELERATE)
def accelerate(system):
    scratch = scratch_of(system.scratch)
    if not scaled_residual(system, scratch.d, scratch.b):
        return SINGULAR
    transpose(scratch.d, scratch.transposed)
    system.counts.factorisations += 1
    rank = qr_pivoted(system.settings.rank_tolerance, scratch)
    minimum_norm(rank, scratch)
    row_multipliers(rank, scratch)
    recover_solution(scratch.x, scratch.dual, system)
    return OK


MPI_QR = Formulation(
    name="mpi-qr",
    about=ABOUT,
    equations="Eq. 26 with a pivoted QR",
    accelerate=accelerate,
    scratch=Scratch,
    handles_redundancy=True,
    handles_singular_mass=False,
)
