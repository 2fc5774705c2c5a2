"""ALF-dual: the iteration of ALF on the m x m matrix of its multipliers.

    (S + I/α) Δλ = Φ_q q̈_i - γ,   q̈_{i+1} = q̈_i - M⁻¹ Φ_qᵀ Δλ,   S = Φ_q M⁻¹ Φ_qᵀ,   q̈_0 = M⁻¹ g

By the Woodbury identity its iterates satisfy Eqs. 17 to 19.  α enters as 1/α added to S, and not as a factor
of Φ_qᵀ Φ_q added to M, so that a large α costs no digits and few iterations are needed; no rank is decided.
Regularisation acts on rows of unit length in the metric of M.  The iteration is
``linear_algebra.minimum_norm`` with b = γ - Φ_q q̈_0, on a sparse factor of S + I/α; it stops when the next
change would be ≤ epsilon, relative to the larger of 1 and the acceleration.  Clearly independent rows need no
1/α: the first iteration then gives the solution of LM2.  Small inertias cause small singular values; if rows
are independent, the iteration is repeated with a larger α.  Rows that are nearly dependent at the start, as
with two slightly tilted hinges, cause even smaller singular values, which conjugate directions resolve; so do
long stacks of loops with redundant rows.
"""

from __future__ import annotations

from typing import NamedTuple

from mbref.formulations.alf import feedback
from mbref.formulations.base import About, Formulation
from mbref.kernels.compilation import exchangeable, inlined, kernel
from mbref.kernels.layout import ACCELERATE, LINK, NOT_CONVERGED, OK, SINGULAR, SparseFactor
from mbref.kernels.named_memory import opener
from mbref.linear_algebra.minimum_norm import go_on_by_conjugate_directions, solve_to_tolerance
from mbref.linear_algebra.sparse_cholesky import (
    add_transpose,
    assemble_gradients,
    factorise,
    least_squared_pivot,
    of_row,
    substitute_back,
    substitute_forward,
)

ABOUT = About(
    title="Augmented Lagrangian on the multipliers",
    meaning="augmented Lagrangian on the multipliers; redundant rows; default for many bodies",
    formula=(
        r"(S + I/\alpha)\, \Delta\lambda = \Phi_q \ddot q_i - \gamma, \qquad \ddot q_{i+1} = \ddot q_i - "
        r"M^{-1} \Phi_q^T \Delta\lambda, \qquad S = \Phi_q M^{-1} \Phi_q^T"
    ),
    text=(
        "By the Woodbury identity the iterates are equal to `alf`. A large α costs no digits here, no "
        "rank is decided, and the matrix is factored sparsely."
    ),
    use="Any mechanism with all masses, redundant or not; the default for many bodies.",
    fails="Bodies without mass or inertia: $M^{-1}$ does not exist.",
)


class Options(NamedTuple):
    """Numbers of ALF-dual: α, the relative change that ends the iteration, the largest number of iterations;
    gains of Φ' and Φ as in ALF."""

    alpha: float = 1e10
    epsilon: float = 1e-12
    iterations: float = 20.0
    omega: float = 0.0
    mu: float = 1.0


# factor for the next α; α above which 1/α is rounding compared with S
STRONGER, LARGEST_ALPHA = 1e3, 1e16
# ratio of successive changes of dependent rows, above which conjugate directions continue the iteration
SLOW = 0.2
INFINITE = 1e300  # α that stands for a matrix without 1/α
INDEPENDENT_ROWS = 1e-4  # squared pivot of clearly independent rows
SETTLED = 1e-14  # relative change of accelerations that ends the iteration
# the largest α with which the matrix of redundant rows is positive definite in double precision
REDUNDANT_ALPHA = 1e15
options_of, factor_of = opener(Options), opener(SparseFactor)


@exchangeable(ACCELERATE)
def accelerate(system):
    settings = system.settings
    if settings.independent and not settings.nearly_dependent and solve_exactly(system):
        return OK
    return iterate_until_solved(system)


@kernel
def solve_exactly(system):
    """Solve for independent rows, without 1/α; return False if they are not clearly independent.

    Rows with squared pivots below ``Settings.clear_pivot`` need a second iteration, which removes the
    rounding errors of the first iteration. It is left out if its change of M^(1/2) q̈, √(rᵀ S⁻¹ r) with the
    residual r, is small compared with M^(1/2) q̈ and M^(1/2) q̈_0: at high speeds accelerations along the rows
    exceed the accelerations that forces cause.
    """
    factor = factor_of(system.scratch)
    row, step = factor.symbolic.row, factor.step
    if not start(INFINITE, system):
        return False
    pivot = least_squared_pivot(factor)
    if not pivot > INDEPENDENT_ROWS:
        return False
    substitute_back(factor, step)
    add_transpose(factor, step, factor.change)
    for i in range(row.shape[0]):
        if row[i] != LINK:
            system.multipliers[row[i]] = -step[i]
    size = put_accelerations(system)
    if not pivot > system.settings.clear_pivot:
        put_residual(factor.change, system)
        size = min(size, square_of_forces(system))
        if not substitute_forward(factor, step) <= SETTLED * SETTLED * size:
            substitute_back(factor, step)
            add_transpose(factor, step, factor.change)
            for i in range(row.shape[0]):
                if row[i] != LINK:
                    system.multipliers[row[i]] -= step[i]
            put_accelerations(system)
    return True


@inlined
def put_accelerations(system):
    """Compute q̈ from M^(1/2) q̈ in ``factor.change``; return the square of its norm."""
    factor, square = factor_of(system.scratch), 0.0
    column, root, x = factor.symbolic.column, factor.root, factor.change
    for j in range(column.shape[0]):
        system.acceleration[column[j]] = root[j] * x[j]
        square += x[j] * x[j]
    return square


@inlined
def square_of_forces(system):
    """Return the square of the norm of M^(1/2) q̈_0 = M^(-1/2) g."""
    factor, square = factor_of(system.scratch), 0.0
    column, root, share = factor.symbolic.column, factor.root, factor.share
    for j in range(column.shape[0]):
        part = root[j] * system.force[column[j]] * share[j]
        square += part * part
    return square


@kernel
def iterate_until_solved(system):
    """Iterate, with a larger α if needed; return OK, SINGULAR or NOT_CONVERGED."""
    options, factor = options_of(system.options), factor_of(system.scratch)
    alpha, status = options.alpha, iterate_with(options.alpha, system)
    slow = status == NOT_CONVERGED and not system.settings.independent
    if system.settings.nearly_dependent or slow:
        status = go_on_by_conjugate_directions(factor, alpha, system.acceleration, system.multipliers)
    while status == NOT_CONVERGED and system.settings.independent and alpha < LARGEST_ALPHA:
        alpha *= STRONGER
        status = iterate_with(alpha, system)
    if status == SINGULAR and alpha > options.alpha:  # rounding of redundant rows
        status = iterate_with(REDUNDANT_ALPHA, system)
    return status


@kernel
def iterate_with(alpha, system):
    """Iterate from q̈_0 with 1/α added to S; return OK, SINGULAR or NOT_CONVERGED."""
    options, factor = options_of(system.options), factor_of(system.scratch)
    if not start(alpha, system):
        return SINGULAR
    slowest = 1.0 if system.settings.independent else SLOW
    return solve_to_tolerance(
        factor, options.epsilon, int(options.iterations), slowest, system.acceleration, system.multipliers
    )


@kernel
def start(alpha, system):
    """Compute the factor of S + I/α, q̈_0, b = γ - Φ_q q̈_0 and L⁻¹ b; return False if S + I/α or M is
    singular.

    The results are M^(1/2) q̈_0 in ``factor.change``, b in ``factor.residual``, and L⁻¹ b in ``factor.step``.
    """
    factor = factor_of(system.scratch)
    column, root, x, share = factor.symbolic.column, factor.root, factor.change, factor.share
    system.counts.factorisations += 1
    assemble_gradients(factor, system.blocks.reshape(-1), system.inverse_root)
    for j in range(column.shape[0]):
        k = column[j]
        if not system.mass[k] > 0.0:
            return False
        x[j] = root[j] * system.force[k] * share[j]
        system.acceleration[k] = root[j] * x[j]
    put_residual(x, system)
    return factorise(factor, alpha, factor.step)


@inlined
def put_residual(x, system):
    """Compute γ - D x into ``factor.residual`` and ``factor.step``, with x (c,) = M^(1/2) q̈.

    Both arrays are written in one loop, because a later copy would wait for the numbers stored last.
    """
    factor = factor_of(system.scratch)
    row, start, column, d = factor.symbolic.row, factor.symbolic.d_start, factor.symbolic.d_column, factor.d
    for i in range(row.shape[0]):
        value = of_row(system.rhs, row[i])
        for p in range(start[i], start[i + 1]):
            value -= d[p] * x[column[p]]
        factor.residual[i], factor.step[i] = value, value


ALF_DUAL = Formulation(
    name="alf-dual",
    about=ABOUT,
    equations="Eqs. 17-19 in the multipliers",
    accelerate=accelerate,
    scratch=None,
    crosses="by regularisation",
    handles_redundancy=True,
    handles_singular_mass=False,
    numbers=Options,
    feedback=feedback,
)
