"""ALF: the augmented Lagrangian iteration on the n x n matrix M + Φ_qᵀ α Φ_q (Eqs. 17 to 20).

    (M + Φ_qᵀ α Φ_q) q̈_{i+1} = M q̈_i + Φ_qᵀ α (γ - 2 ω μ Φ' - ω² Φ),   M q̈_0 = g

Eq. 19 is misprinted: its load has Φ_q q̈_i in place of the velocity violation Φ' = Φ_q q' - ν, and Φ_q in
place of Φ. The β of Eq. 19 is used nowhere.  Eq. 20 stops when the change is ≤ epsilon; here relative to the
larger of 1 and the acceleration.  α weights rows of unit length in the metric of M, so that it does not
depend on units.  The product with α loses digits: the rounding of the product is α times the rounding of the
accelerations (see ``alf-dual``).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, NamedTuple

from numpy import sqrt

from mbref.formulations.base import About, Formulation
from mbref.kernels.compilation import exchangeable, kernel
from mbref.kernels.layout import ACCELERATE, NOT_CONVERGED, OK, SINGULAR
from mbref.kernels.named_memory import Matrix, Vector, opener
from mbref.linear_algebra.elimination import cholesky_factor, cholesky_solve
from mbref.linear_algebra.orthogonal_factorisations import equilibrate
from mbref.linear_algebra.vectors import copy

ABOUT = About(
    title="Augmented Lagrangian",
    meaning="augmented Lagrangian, a penalty iterated; bodies may lack inertia",
    formula=(
        r"(M + \Phi_q^T \alpha \Phi_q)\, \ddot q_{i+1} = M \ddot q_i + \Phi_q^T \alpha\, (\gamma - 2 "
        r"\omega \mu \dot\Phi - \omega^2 \Phi), \qquad M \ddot q_0 = g"
    ),
    text=(
        "Eqs. 17 to 20, with the load of Eq. 19 as it must be: the violation of velocities and of positions."
    ),
    use="Mechanisms with redundant rows and a singular mass matrix; comparison with the paper.",
    fails=(
        "The penalty α multiplies the rounding errors of the accelerations. For accuracy take `alf-dual`."
    ),
)


class Options(NamedTuple):
    """Numbers of ALF: the penalty α, the relative change that ends the iteration (Eq. 20), the largest number
    of iterations, ω and μ."""

    alpha: float = 1e5
    epsilon: float = 1e-9
    iterations: float = 100.0
    omega: float = 10.0
    mu: float = 1.0


class Scratch(NamedTuple):
    """Memory of the iteration, scaled by M^(-1/2) and the length of rows."""

    d: Annotated[Matrix, "m", "n"]  # Φ_q M^(-1/2) with rows of unit length
    matrix: Annotated[Matrix, "n", "n"]  # M + Φ_qᵀ α Φ_q and its Cholesky factor
    load: Annotated[Vector, "n"]
    x: Annotated[Vector, "n"]
    scaled: Annotated[Vector, "m"]  # right-hand side in unit rows
    total: Annotated[Vector, "m"]  # multipliers of unit rows


options_of, scratch_of = opener(Options), opener(Scratch)


def feedback(options: Mapping[str, float]) -> tuple[float, float]:
    """Return the gains of Φ' and Φ: 2 ω μ and ω²."""
    return 2 * options["omega"] * options["mu"], options["omega"] ** 2


@kernel
def changed(before, now):
    """Return the norm of the change relative to the larger of 1 and the norm of ``now`` (Eq. 20)."""
    change, size = 0.0, 0.0
    for j in range(now.shape[0]):
        step = now[j] - before[j]
        change += step * step
        size += now[j] * now[j]
    return sqrt(change / max(1.0, size))


@kernel
def augmented(mass, inverse_root, d, alpha, a):
    """Compute the upper half of M^(-1/2) (M + Φ_qᵀ α Φ_q) M^(-1/2) from D."""
    m, n = d.shape
    for j in range(n):
        for k in range(j, n):
            a[j, k] = 0.0
        a[j, j] = mass[j] * inverse_root[j] * inverse_root[j]
    for i in range(m):
        for j in range(n):
            weight = alpha * d[i, j]
            if weight != 0.0:
                for k in range(j, n):
                    a[j, k] += weight * d[i, k]


@exchangeable(ACCELERATE)
def accelerate(system):
    options, scratch = options_of(system.options), scratch_of(system.scratch)
    acceleration, multipliers, root = system.acceleration, system.multipliers, system.inverse_root
    m, n = system.jacobian.shape
    d, x, load, scaled, total = scratch.d, scratch.x, scratch.load, scratch.scaled, scratch.total
    equilibrate(system.jacobian, root, d, multipliers)
    augmented(system.mass, root, d, options.alpha, scratch.matrix)
    system.counts.factorisations += 1
    if not cholesky_factor(scratch.matrix, n):
        return SINGULAR
    for j in range(n):
        load[j] = system.force[j] * root[j]
        acceleration[j] = 0.0
    for i in range(m):
        scaled[i], total[i] = system.rhs[i] * multipliers[i], 0.0
    status = NOT_CONVERGED
    for _ in range(int(options.iterations)):
        iterate(options.alpha, scratch)
        for j in range(n):
            load[j] = system.mass[j] * root[j] * root[j] * x[j]
            x[j] *= root[j]
        change = changed(acceleration, x)
        copy(x, acceleration)
        if change <= options.epsilon:
            status = OK
            break
    for i in range(m):
        multipliers[i] *= total[i]
    return status


@kernel
def iterate(alpha, scratch):
    """Make one iteration of Eqs. 17 and 18: x = (M + Φ_qᵀ α Φ_q)⁻¹ (load + Φ_qᵀ α γ), λ += α (Φ_q x - γ)."""
    d, x, scaled, total = scratch.d, scratch.x, scratch.scaled, scratch.total
    m, n = d.shape
    copy(scratch.load, x)
    for i in range(m):
        for j in range(n):
            x[j] += d[i, j] * (alpha * scaled[i])
    cholesky_solve(scratch.matrix, n, x)
    for i in range(m):
        gap = -scaled[i]
        for j in range(n):
            gap += d[i, j] * x[j]
        total[i] += alpha * gap


ALF = Formulation(
    name="alf",
    about=ABOUT,
    equations="Eqs. 17-20",
    accelerate=accelerate,
    scratch=Scratch,
    needs_all_rows=True,
    crosses="by regularisation",
    handles_redundancy=True,
    handles_singular_mass=True,
    numbers=Options,
    feedback=feedback,
)
