"""MPI-GS: accelerations by the Moore–Penrose inverse from Gram–Schmidt orthogonalisation.

Eqs. 29 and 30 need independent columns, which do not exist with redundant rows or degrees of freedom. Here
columns are selected in the order of their size, dependent columns are left out, D P = Q R, and a second
orthogonalisation of the rows of R gives R = L Zᵀ: D⁺ = P Z L⁻¹ Qᵀ, the true inverse for any rank.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from mbref.formulations.base import About, Formulation
from mbref.formulations.moore_penrose import recover_solution, scaled_residual, transpose
from mbref.kernels.compilation import exchangeable
from mbref.kernels.layout import ACCELERATE, OK, SINGULAR
from mbref.kernels.named_memory import Indices, Matrix, Vector, opener
from mbref.linear_algebra.orthogonal_factorisations import gram_schmidt_solve

ABOUT = About(
    title="Moore–Penrose inverse by Gram–Schmidt",
    meaning="Moore-Penrose inverse by Gram-Schmidt; any rank",
    formula=r"D P = Q R, \qquad R = L Z^T, \qquad D^+ = P Z L^{-1} Q^T",
    text=(
        "Eqs. 29 and 30, completed for any rank: columns in order of their size, dependent ones left "
        "out, then the rows of R orthogonalised."
    ),
    use="Redundant rows of any kind, at less cost than `mpi-svd`.",
    fails="Bodies without mass; the rank is decided by the size of a column's remainder.",
)


class Scratch(NamedTuple):
    """Memory of D, its columns as rows, and the triangular factors of both orthogonalisations."""

    d: Annotated[Matrix, "m", "n"]
    columns: Annotated[Matrix, "n", "m"]
    r: Annotated[Matrix, "n", "n"]
    l: Annotated[Matrix, "n", "n"]
    order: Annotated[Indices, "n"]
    order_rows: Annotated[Indices, "n"]
    b: Annotated[Vector, "m"]
    c: Annotated[Vector, "n"]
    x: Annotated[Vector, "n"]
    dual: Annotated[Vector, "m"]


scratch_of = opener(Scratch)


@exchangeable(ACCELERATE)
def accelerate(system):
    scratch = scratch_of(system.scratch)
    if not scaled_residual(system, scratch.d, scratch.b):
        return SINGULAR
    system.counts.factorisations += 1
    transpose(scratch.d, scratch.columns)
    gram_schmidt_solve(system.settings.rank_tolerance, scratch)
    recover_solution(scratch.x, scratch.dual, system)
    return OK


MPI_GS = Formulation(
    name="mpi-gs",
    about=ABOUT,
    equations="Eqs. 26, 29, 30",
    accelerate=accelerate,
    scratch=Scratch,
    handles_redundancy=True,
    handles_singular_mass=False,
)
