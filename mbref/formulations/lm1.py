"""LM1: the augmented system of Eq. 5, solved directly by LU with partial pivoting.

    [M   Φ_qᵀ] [q̈]   [g]
    [Φ_q   0 ] [λ ] = [γ]

The system is scaled symmetrically by M^(-1/2) and the length of the rows, so that the test for singularity
does not depend on units. LM1 fails on redundant rows. LM1 needs no M⁻¹, so that bodies without inertia are
allowed if constraints determine their accelerations.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from mbref.formulations.base import About, Formulation
from mbref.kernels.compilation import exchangeable
from mbref.kernels.layout import ACCELERATE, OK, SINGULAR
from mbref.kernels.named_memory import Indices, Matrix, Vector, opener
from mbref.linear_algebra.elimination import lu_factor, lu_solve
from mbref.linear_algebra.orthogonal_factorisations import equilibrate

ABOUT = About(
    title="Lagrange multipliers, the augmented matrix",
    meaning="accelerations and Lagrange multipliers together, by LU; fails on redundant rows",
    formula=(
        r"\begin{pmatrix} M & \Phi_q^T \\ \Phi_q & 0 \end{pmatrix} \begin{pmatrix} \ddot q \\ \lambda "
        r"\end{pmatrix} = \begin{pmatrix} g \\ \gamma \end{pmatrix}"
    ),
    text="Eq. 5. The matrix is scaled symmetrically and solved by LU with partial pivoting.",
    use=(
        "Bodies without mass or inertia; mechanisms without redundant rows; comparison as "
        "the textbook method."
    ),
    fails="Redundant rows make the matrix singular: `SINGULAR_MATRIX` at t = 0.",
)

SINGULAR_PIVOT = 1e-12  # pivot of the scaled matrix with rows and columns of unit size


class Scratch(NamedTuple):
    """Memory of the augmented system."""

    matrix: Annotated[Matrix, "m + n", "m + n"]
    d: Annotated[Matrix, "m", "n"]  # Φ_q M^(-1/2) with rows of unit length
    b: Annotated[Vector, "m + n"]
    pivots: Annotated[Indices, "m + n"]


scratch_of = opener(Scratch)


@exchangeable(ACCELERATE)
def accelerate(system):
    scratch, root, multipliers = scratch_of(system.scratch), system.inverse_root, system.multipliers
    a, d, b = scratch.matrix, scratch.d, scratch.b
    m, n = system.jacobian.shape
    equilibrate(system.jacobian, root, d, multipliers)
    a[:] = 0.0
    for j in range(n):
        a[j, j] = system.mass[j] * root[j] * root[j]
        b[j] = system.force[j] * root[j]
    for i in range(m):
        b[n + i] = system.rhs[i] * multipliers[i]
        for j in range(n):
            a[n + i, j] = d[i, j]
            a[j, n + i] = d[i, j]
    system.counts.factorisations += 1
    if not lu_factor(a, m + n, scratch.pivots, SINGULAR_PIVOT):
        return SINGULAR
    lu_solve(a, m + n, scratch.pivots, b)
    for j in range(n):
        system.acceleration[j] = b[j] * root[j]
    for i in range(m):
        multipliers[i] *= b[n + i]
    return OK


LM1 = Formulation(
    name="lm1",
    about=ABOUT,
    equations="Eq. 5",
    accelerate=accelerate,
    scratch=Scratch,
    handles_redundancy=False,
    handles_singular_mass=True,
)
