"""Determinant det(G₁ G₀ᵀ) of the constraint gradients at two times of a step, by its sign and logarithm.

The determinant changes its sign if two branches cross, and keeps its sign if the rank of G is unchanged (a
bordered test function:  W.  Govaerts, Numerical Methods for Bifurcations of Dynamical Equilibria, 2000).  G₀
is the gradient at the start of the step.  For a square G it is det G₁ det G₀, and det G at both ends is the
product of the pivots.  With one degree of freedom the minors of G are the product of the pivots times the
null vector T (one at the independent variable), so that the determinant is the product of both pivot products
and T₁ · T₀.
"""

from __future__ import annotations

from numpy import inf, log

from mbref.kernels.compilation import exchangeable, kernel
from mbref.kernels.layout import OK
from mbref.linear_algebra.elimination import determinant, product_of_pivots
from mbref.taylor.coupled_coordinates import add_gradients
from mbref.taylor.layout import DETERMINANT, GRADIENT
from mbref.taylor.partition import freedoms


@exchangeable(GRADIENT)
def evaluate_gradient(y, memory):
    """Evaluate G at variables y[0] into ``work``; rows have about unit length, or are zero everywhere."""
    rows, work = memory.polynomials.rows, memory.solver.work
    work[:] = 0.0
    for e in range(rows.linear_row.shape[0]):
        if rows.linear_lane[e] < work.shape[1]:
            work[rows.linear_row[e], rows.linear_lane[e]] += rows.linear_weight[e]
    for e in range(rows.row.shape[0]):
        if rows.lane[e] < work.shape[1]:
            work[rows.row[e], rows.lane[e]] += rows.weight[e] * y[0, rows.other[e]]
    add_gradients(y, work, memory)
    return OK


@kernel
def save_start_determinant(memory):
    """Save G at the start of the step; for a square G its determinant."""
    step, partition = memory.step, memory.partition
    if freedoms(memory) > 0:
        memory.kernels.gradient(memory.series.past, memory)
        save_gradient(memory)
    elif partition.partition_id == step.start_partition_id:
        step.start_negative, step.start_logarithm = product_of_pivots(memory.solver.past, partition.rank)
    else:
        memory.kernels.gradient(memory.series.past, memory)
        step.start_negative, step.start_logarithm = square_determinant(memory)


@kernel
def save_gradient(memory):
    """Save Gᵀ of the independent rows of the gradient in ``work``."""
    solver = memory.solver
    for i in range(memory.partition.rank):
        for c in range(solver.work.shape[1]):
            solver.past_gradient[c, i] = solver.work[solver.pivot_rows[i], c]


@exchangeable(DETERMINANT)
def gradient_determinant(y, memory):
    """Return whether det(G G₀ᵀ) of the independent rows is negative, and its logarithm:  G at variables
    y[0]."""
    memory.kernels.gradient(y, memory)
    if freedoms(memory) == 0:
        negative, size = square_determinant(memory)
        return negative != memory.step.start_negative, size + memory.step.start_logarithm
    return product_determinant(memory)


@kernel
def square_determinant(memory):
    """Return whether det G of a square gradient in ``work`` is negative, and its logarithm.

    Rows and variables are in their pivot order, so that the determinant is the product of the pivots.
    """
    solver, rank = memory.solver, memory.partition.rank
    for i in range(rank):
        for c in range(rank):
            solver.product[i, c] = solver.work[solver.pivot_rows[i], solver.pivot_columns[c]]
    return determinant(solver.product, rank)


@kernel
def product_determinant(memory):
    """Return whether det(G G₀ᵀ) of the gradient in ``work`` is negative, and its logarithm."""
    solver, rank = memory.solver, memory.partition.rank
    products, past, work = solver.product, solver.past_gradient, solver.work
    for i in range(rank):
        for j in range(rank):
            products[i, j] = 0.0
        for c in range(work.shape[1]):
            entry = work[solver.pivot_rows[i], c]
            if entry != 0.0:
                for j in range(rank):
                    products[i, j] += entry * past[c, j]
    return determinant(products, rank)


@kernel
def gradient_determinant_at_end(memory):
    """Return whether the test function is negative at the end of the step, and its logarithm."""
    if has_one_null_vector(memory):
        return determinant_by_null_vectors(memory)
    if freedoms(memory) > 0:
        return memory.kernels.determinant(memory.series.terms, memory)
    negative, size = product_of_pivots(memory.solver.last, memory.partition.rank)
    return negative != memory.step.start_negative, size + memory.step.start_logarithm


@kernel
def log_determinant_at_start(memory):
    """Return the logarithm of det(G₀ G₀ᵀ)."""
    if freedoms(memory) == 0:
        return 2.0 * memory.step.start_logarithm
    if has_one_null_vector(memory):
        return log_start_by_null_vector(memory)
    _, size = memory.kernels.determinant(memory.series.past, memory)
    return size


# --- one degree of freedom ------------------------------------------------------------------------------
@kernel
def has_one_null_vector(memory):
    """Return whether one variable is independent, of equal rows at both ends of the step."""
    step, partition = memory.step, memory.partition
    has_equal_rows = partition.rank == memory.solver.pivot_rows.shape[0]
    is_kept = partition.partition_id == step.start_partition_id
    return freedoms(memory) == 1 and (is_kept or has_equal_rows)


@kernel
def minors_oppose(along, memory):
    """Return whether the minors at both ends, by signs of the pivots, point against each other along motions
    whose product has the sign of ``along``."""
    solver, partition = memory.solver, memory.partition
    negative = (along < 0.0) != (partition.parity != memory.step.start_parity)
    for k in range(partition.rank):
        negative = negative != (solver.last[k] * solver.past[k] < 0.0)
    return negative


@kernel
def null_vector_product(memory):
    """Return T₁ · T₀, the product of the null vectors at both ends of the step."""
    solver, along = memory.solver, 0.0
    for i in range(solver.pivot_columns.shape[0]):
        along += solver.null_space[0, i] * solver.past_motion[i]
    return along


@kernel
def null_vectors_oppose(memory):
    """Return whether the test function is negative at the end of the step, by pivots and null vectors."""
    return minors_oppose(null_vector_product(memory), memory)


@kernel
def rates_oppose(memory):
    """Return whether the motion, without drivers, has the direction of the minors' null vector at one end of
    the step only.

    The direction differs at both ends if branches cross, because the minors are smooth and vanish at the
    crossing, however far the null vector turns in the step.
    """
    solver, past, terms, before, after = memory.solver, memory.series.past, memory.series.terms, 0.0, 0.0
    for i in range(solver.pivot_columns.shape[0]):
        before += solver.past_motion[i] * past[1, i]
        after += solver.null_space[0, i] * terms[1, i]
    return minors_oppose(before * after, memory)


@kernel
def determinant_by_null_vectors(memory):
    """Return whether the test function is negative at the end of the step, and its logarithm, by null
    vectors."""
    along, solver, rank = null_vector_product(memory), memory.solver, memory.partition.rank
    _, before = product_of_pivots(solver.past, rank)
    _, after = product_of_pivots(solver.last, rank)
    size = log(abs(along)) if along != 0.0 else -inf
    return minors_oppose(along, memory), before + after + size


@kernel
def log_start_by_null_vector(memory):
    """Return the logarithm of det(G₀ G₀ᵀ), by pivots and the null vector at the start."""
    solver, square = memory.solver, 0.0
    for i in range(solver.pivot_columns.shape[0]):
        square += solver.past_motion[i] * solver.past_motion[i]
    _, size = product_of_pivots(solver.past, memory.partition.rank)
    return 2.0 * size + log(square)
