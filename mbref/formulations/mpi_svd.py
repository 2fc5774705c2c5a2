"""MPI-SVD: accelerations by the Moore–Penrose inverse from the singular value decomposition.

D = U S Vᵀ and D⁺ = V S⁺ Uᵀ (Eqs. 27 and 28) in Eq. 26.  D⁺ exists for any rank; singular values up to the
rank tolerance times the largest singular value count as zero.  The multipliers have least norm in scaled
rows.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from mbref.formulations.base import About, Formulation
from mbref.formulations.moore_penrose import recover_solution, scaled_residual
from mbref.kernels.compilation import exchangeable
from mbref.kernels.layout import ACCELERATE, NOT_FINITE, OK, SINGULAR
from mbref.kernels.named_memory import Matrix, Vector, opener
from mbref.linear_algebra.orthogonal_factorisations import svd_solve

ABOUT = About(
    title="Moore–Penrose inverse by singular values",
    meaning="Moore-Penrose inverse by singular values; any rank; expensive",
    formula=(
        r"\ddot q = \ddot q_u + M^{-1/2} D^+ (\gamma - \Phi_q \ddot q_u), \qquad D = \Phi_q M^{-1/2} = U "
        r"S V^T, \qquad D^+ = V S^+ U^T"
    ),
    text=(
        r"Eqs. 26 to 28, with $\ddot q_u = M^{-1} g$. Singular values up to the rank tolerance count as "
        "zero; the multipliers have least norm."
    ),
    use="Redundant rows of any kind, with multipliers that are well defined; small mechanisms.",
    fails=(
        "Bodies without mass. The cost grows with the cube of the size; near a singular position the "
        "rank is a decision."
    ),
)


class Scratch(NamedTuple):
    """Memory of D, its right-hand side and the two solutions."""

    d: Annotated[Matrix, "m", "n"]
    b: Annotated[Vector, "m"]
    x: Annotated[Vector, "n"]
    dual: Annotated[Vector, "m"]


scratch_of = opener(Scratch)


@exchangeable(ACCELERATE)
def accelerate(system):
    scratch = scratch_of(system.scratch)
    if not scaled_residual(system, scratch.d, scratch.b):
        return SINGULAR
    system.counts.factorisations += 1
    if svd_solve(scratch.d, scratch.b, system.settings.rank_tolerance, scratch.x, scratch.dual) < 0:
        return NOT_FINITE
    recover_solution(scratch.x, scratch.dual, system)
    return OK


MPI_SVD = Formulation(
    name="mpi-svd",
    about=ABOUT,
    equations="Eqs. 26-28",
    accelerate=accelerate,
    scratch=Scratch,
    handles_redundancy=True,
    handles_singular_mass=False,
)
