"""The iteration of ALF-dual on a sparse factor of S + I/α: a change by which Φ_q times it grows as asked.

It is the least in the metric of M, which redundant rows do not disturb; what is left of the growth shrinks
by 1 / (1 + α σ²) an iteration, σ being a singular value of unit rows.
"""

from __future__ import annotations

from numpy import sqrt

from mbref.kernels.compilation import inlined
from mbref.kernels.layout import COLUMNS, FACTORISATIONS, INVERSE_ROOT, JACOBIAN, NOT_CONVERGED, OK, SCRATCH
from mbref.linear_algebra.sparse_cholesky import (
    assemble,
    factorise,
    memories,
    part,
    solve,
    subtract_product,
    times_transpose,
)
from mbref.linear_algebra.symbolic_factorisation import COLUMN, ROW
from mbref.linear_algebra.vectors import copy

TINY, NEVER = 1e-300, 1e300
LEAST = 2  # iterations of ``settle``: enough but near singular positions, so that their number is fixed


@inlined
def factor(plan, work, alpha, counts):
    """L of S + I/α at the state last evaluated; whether it could be had."""
    memory, inverse_root = work[SCRATCH][0], work[COLUMNS][INVERSE_ROOT]
    d, l, diagonal, _, _, _, _, root, _ = memories(plan, memory)
    counts[FACTORISATIONS] += 1
    assemble(plan, work[JACOBIAN], inverse_root, alpha, d, l, diagonal, root)
    return factorise(plan, l)


@inlined
def settle(plan, work, epsilon, most, target, multipliers):
    """Change ``target`` (n,) by the least in the metric of M that makes Φ_q target grow by b of the memory.

    Stops when the next change would be ≤ ``epsilon``, judged by how the changes shrink.  ``multipliers``
    (m,) become the sums of -Δλ in the rows that move.  Returns OK; NOT_CONVERGED after ``most`` iterations.
    """
    d, l, _, _, b, step, total, root, x = memories(plan, work[SCRATCH][0])
    row = part(plan, ROW)
    total[:] = 0.0
    status, change, expected = NOT_CONVERGED, 0.0, NEVER
    for k in range(most):
        if k > 0:
            subtract_product(plan, d, x, b)
        last, change = change, improve(plan, d, l, b, step, root, x, target)
        for i in range(row.shape[0]):
            total[i] -= step[i]
        expected = min(expected, change * min(1.0, change / max(last, TINY)))
        if k + 1 >= min(LEAST, most) and expected <= epsilon:
            status = OK
            break
    for i in range(row.shape[0]):
        multipliers[row[i]] = total[i]
    return status


@inlined
def correct(plan, work, iterations, target):
    """As ``settle`` with a fixed number of iterations."""
    d, l, _, _, b, step, _, root, x = memories(plan, work[SCRATCH][0])
    for k in range(iterations):
        if k > 0:
            subtract_product(plan, d, x, b)
        improve(plan, d, l, b, step, root, x, target)


@inlined
def improve(plan, d, l, b, step, root, x, target):
    """One iteration: target += M^(-1/2) x, x = Dᵀ (S + I/α)⁻¹ b; its size, as of ``add_scaled``."""
    copy(b, step)
    solve(plan, l, step)
    times_transpose(plan, d, step, x)
    return add_scaled(plan, root, x, target)


@inlined
def add_scaled(plan, root, x, target):
    """target (n,) += root x; the norm of that, relative to the larger of 1 and the norm of the target."""
    column, change, size = part(plan, COLUMN), 0.0, 0.0
    for j in range(x.shape[0]):
        step, k = root[j] * x[j], column[j]
        value = target[k] + step
        target[k] = value
        change += step * step
        size += value * value
    return sqrt(change / max(1.0, size))
