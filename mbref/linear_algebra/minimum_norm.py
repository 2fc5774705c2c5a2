"""Minimum-norm solutions of D x = b with dependent rows, by the augmented Lagrangian iteration in the dual.

    (S + I/α) Δ = b - D x,   x += Dᵀ Δ,   S = D Dᵀ,   x_0 = 0

With D = Φ_q M^(-1/2), the change M^(-1/2) x is the least change in the metric of M for which Φ_q times the
change equals b. Redundant rows do not disturb the change. An iteration reduces the remainder by the factor 1
/ (1 + α σ²), with a singular value σ of unit rows.  No rank is decided.  ALF-dual
(``formulations.alf_dual``), the projection and the consistent start are this iteration.  ``factor.residual``
contains b.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy import inf, sqrt

from mbref.kernels.compilation import FLOAT, INT, VECTOR, entry, inlined, kernel
from mbref.kernels.layout import LINK, NOT_CONVERGED, OK, SparseFactor
from mbref.kernels.named_memory import Named, packed
from mbref.linear_algebra.sparse_cholesky import (
    add_transpose,
    regularised_factor,
    solve,
    substitute_back,
    substitute_forward,
    subtract_product,
    times_transpose,
)
from mbref.linear_algebra.symbolic_factorisation import sparse_factor, symbolic_factorisation, system_rows
from mbref.linear_algebra.vectors import copy

if TYPE_CHECKING:
    from scipy.sparse import csr_array

# least number of iterations of ``solve_to_tolerance``; enough away from singular positions, so that it is
# fixed there
LEAST_ITERATIONS = 2
ALPHA = 1e10  # penalty of projections and single solutions; singular values below 1e-5 are ignored
# largest number of iterations of a system that is solved once; relative change that ends them
ITERATIONS, LAST_CHANGE = 20, 1e-15
OF_BODY = 6  # columns of a body, in matrices that are solved once
UNFINISHED = 1e-12  # change of multipliers / multipliers, above which an iteration ended too early
DEPENDENT_ROW = 1e-11  # singular value of unit rows below which a remaining row counts as dependent
FACTOR = Named(SparseFactor)


@inlined
def solve_to_tolerance(factor, epsilon, most, slowest, target, multipliers):
    """Change ``target`` (n,) by the least change for which Φ_q times the change equals the residual.

    The iteration ends when the next change would be ≤ ``epsilon``, estimated from the previous changes.
    ``multipliers`` (m,) become the sums of -Δ in the rows that take part.  Returns OK, or NOT_CONVERGED after
    ``most`` iterations, or once a change exceeds the previous change times ``slowest``.  ``factor.step``
    contains L⁻¹ times the residual, where ``factorise`` leaves this product.
    """
    row, step, total = factor.symbolic.row, factor.step, factor.total
    total[:] = 0.0
    status, change, expected = NOT_CONVERGED, 0.0, inf
    for k in range(most):
        if k > 0:
            subtract_product(factor, factor.change, factor.residual)
            copy(factor.residual, step)
            substitute_forward(factor, step)
        last, change = change, change_by_step(factor, target)
        for i in range(row.shape[0]):
            total[i] -= step[i]
        expected = min(expected, change * min(1.0, change / last if last > 0.0 else 1.0))
        if k + 1 >= min(LEAST_ITERATIONS, most) and expected <= epsilon:
            status = OK
            break
        if k > 1 and change > slowest * last:
            break
    write_multipliers(row, total, multipliers)
    return status


@inlined
def write_multipliers(row, total, multipliers):
    """Write the multipliers of the factor's rows to their rows in the system."""
    for i in range(row.shape[0]):
        if row[i] != LINK:
            multipliers[row[i]] = total[i]


@kernel
def go_on_by_conjugate_directions(factor, alpha, target, multipliers):
    """Continue after ``solve_to_tolerance``, by Craig's method with S + I/α as preconditioner.

    A singular value that is small compared with α^(-1/2) takes about one direction (J. E. Craig, J. Math. and
    Physics 34, 1955). Returns OK if only rounding, or rows dependent to DEPENDENT_ROW, remain; otherwise
    NOT_CONVERGED.
    """
    factor.direction[:], before = 0.0, 1.0
    for _ in range(ITERATIONS):
        before = step_along_conjugate_direction(before, norm_of(target, factor), alpha, factor)
        if before == 0.0:
            return OK
        write_multipliers(factor.symbolic.row, factor.total, multipliers)
        add_scaled(factor, target)
    return NOT_CONVERGED


@kernel
def step_along_conjugate_direction(before, size, alpha, factor):
    """Subtract D times ``change`` from the residual, and take the next conjugate direction: its step is added
    to ``total``, with the opposite sign, and Dᵀ times the step is the new ``change``.

    Return the product of residual and preconditioned residual, which is ``before`` of the next step; 0 if
    only rounding of a solution of this ``size``, or rows dependent to DEPENDENT_ROW, remain.
    """
    residual, step, change, direction = factor.residual, factor.step, factor.change, factor.direction
    subtract_product(factor, change, residual)
    copy(residual, step)
    solve(factor, step)
    along = product(residual, step)
    if along <= alpha * (LAST_CHANGE * size) ** 2:
        return 0.0
    for i in range(step.shape[0]):
        direction[i] = step[i] + along / before * direction[i]
    times_transpose(factor, direction, change)
    square = product(change, change)
    if along * alpha * DEPENDENT_ROW**2 >= square:
        return 0.0
    length = along / square
    for i in range(step.shape[0]):
        factor.total[i] -= length * direction[i]
    for j in range(change.shape[0]):
        change[j] *= length
    return along


@kernel
def norm_of(target, factor):
    """Return the larger of 1 and the norm of M^(1/2) target (n,)."""
    column, root, square = factor.symbolic.column, factor.root, 1.0  # a copy has a part of its body's mass
    for j in range(root.shape[0]):
        value = target[column[j]] / root[j]
        square = max(square, value * value)
    return sqrt(square)


@kernel
def product(a, b):
    """Return the inner product of two vectors."""
    total = 0.0
    for i in range(a.shape[0]):
        total += a[i] * b[i]
    return total


@inlined
def solve_fixed_iterations(factor, iterations, target):
    """Solve as ``solve_to_tolerance`` does, with a fixed number of iterations."""
    for k in range(iterations):
        if k > 0:
            subtract_product(factor, factor.change, factor.residual)
        iterate(factor, target)


@inlined
def iterate(factor, target):
    """Make one iteration: target += M^(-1/2) x, x = Dᵀ (S + I/α)⁻¹ b; return the size of that change."""
    copy(factor.residual, factor.step)
    substitute_forward(factor, factor.step)
    return change_by_step(factor, target)


@inlined
def change_by_step(factor, target):
    """Make the second part of ``iterate``, with L⁻¹ b in ``factor.step``."""
    substitute_back(factor, factor.step)
    times_transpose(factor, factor.step, factor.change)
    return add_scaled(factor, target)


@inlined
def add_scaled(factor, target):
    """Compute target (n,) += M^(-1/2) x; return the norm of this change, relative to the larger of 1 and the
    target's norm."""
    column, root, x, change, size = factor.symbolic.column, factor.root, factor.change, 0.0, 0.0
    share = factor.share
    for j in range(x.shape[0]):
        step, k = root[j] * x[j] * share[j], column[j]  # copies make equal changes
        value = target[k] + step
        target[k] = value
        change += step * step
        size += value * value
    return sqrt(change / max(1.0, size))


@inlined
def find_least_multipliers(factor, force, multipliers):
    """Compute the multipliers λ of the factor's rows for which Φ_qᵀ λ is nearest to forces (n,).

    For redundant rows they have the least norm in unit rows.

    (S + I/α) Δ = D x, x -= Dᵀ Δ, λ += Δ, from the scaled forces x.
    """
    row, column, x, step, total = (
        factor.symbolic.row, factor.symbolic.column, factor.change, factor.step, factor.total,
    )  # fmt: skip
    for j in range(column.shape[0]):
        x[j] = factor.root[j] * force[column[j]] * factor.share[j]
    total[:] = 0.0
    before, change, size, scale = inf, 0.0, 0.0, sqrt(product(x, x))
    for _ in range(ITERATIONS):
        factor.residual[:] = 0.0
        subtract_product(factor, x, factor.residual)
        copy(factor.residual, step)
        solve(factor, step)
        add_transpose(factor, step, x)
        change, size = 0.0, 0.0
        for i in range(row.shape[0]):
            total[i] -= step[i]
            change += step[i] * step[i]
            size += total[i] * total[i]
        if not LAST_CHANGE * LAST_CHANGE * size < change < before:
            break
        before = change
    if change > UNFINISHED * UNFINISHED * size:  # near a singular position
        balance_along_conjugate_directions(factor, scale)
    write_multipliers(row, total, multipliers)


@kernel
def balance_along_conjugate_directions(factor, scale):
    """Add the multipliers that the remaining forces x in ``change`` need to those in ``total``: conjugate
    gradients for S λ = D x with S + I/α as preconditioner. ``scale`` is the norm of all forces."""
    factor.residual[:], factor.direction[:], before = 0.0, 0.0, 1.0
    for _ in range(ITERATIONS):
        before = step_along_conjugate_direction(before, scale, ALPHA, factor)
        if before == 0.0:
            break


@entry(INT(VECTOR, VECTOR, FACTOR))
def factorise_once(numbers, inverse_root, factor):
    """Factorise S + I/α, called from Python; return 0 if S + I/α is not positive definite."""
    return 1 if regularised_factor(factor, numbers, inverse_root, ALPHA) else 0


@entry(FLOAT(VECTOR, FACTOR))
def iterate_once(target, factor):
    """Run one iteration of the minimum-norm solver on ``target``, called from Python; return the size of the
    change of ``target``. The residual is updated."""
    size = iterate(factor, target)
    subtract_product(factor, factor.change, factor.residual)
    return size


@entry(INT(VECTOR, FACTOR))
def solve_once(b, factor):
    """Replace b by (S + I/α)⁻¹ b; called from Python."""
    solve(factor, b)
    return OK


class MinimumNorm:
    """Solutions x of A x = b, least in the norm of the weights (n,); rows of A (m, n) may be redundant.

    ``d`` is A diag(weights)^(-1/2) with rows of unit length.
    """

    def __init__(self, matrix: csr_array, weight: np.ndarray):
        from scipy.sparse import csr_array

        self._root = 1 / np.sqrt(weight)
        d = csr_array(matrix.multiply(self._root))
        lengths = np.sqrt(np.asarray((d * d).sum(axis=1)).ravel())
        self._scale = 1 / np.where(lengths > 0, lengths, 1.0)
        self.d = csr_array(d.multiply(self._scale[:, None]))
        self.d.sort_indices()
        row = np.repeat(np.arange(self.d.shape[0]), np.diff(self.d.indptr))
        active = np.zeros(self.d.shape[1], dtype=bool)
        active[self.d.indices] = True
        symbolic = symbolic_factorisation(row, self.d.indices, np.arange(row.size), active, OF_BODY)
        self._factor = packed(sparse_factor(symbolic))
        factorise_once(self.d.data, np.ones(self.d.shape[1]), self._factor.argument)
        self._rows, self._places = system_rows(symbolic), np.flatnonzero(symbolic.row != LINK)

    def __call__(self, rhs: np.ndarray) -> np.ndarray:
        """Return x (n,) for b = rhs (m,); if rows contradict each other, by least squares of unit rows."""
        x, factor = np.zeros(self.d.shape[1]), self._factor.values
        factor.residual[:] = 0.0
        factor.residual[self._places] = (self._scale * rhs)[self._rows]
        for _ in range(ITERATIONS):
            iterate_once(x, self._factor.argument)
            if np.linalg.norm(factor.change) <= LAST_CHANGE * np.linalg.norm(x):
                break
        return self._root * x

    def regularised_solution(self, b: np.ndarray) -> np.ndarray:
        """Return (S + I/α)⁻¹ b (m,) for unit rows."""
        solution, own = ALPHA * b, np.zeros(self._factor.values.residual.size)
        own[self._places] = b[self._rows]
        solve_once(own, self._factor.argument)
        solution[self._rows] = own[self._places]
        return solution
