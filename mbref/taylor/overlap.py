"""Determinants of the constraint gradients at both ends of a step.

det(G Gᵀ₀) changes its sign where branches cross, G₀ being the gradient where the step began; of a square G
it is det G det G₀, and det G at both ends is the product of the pivots.  Where one variable is independent,
the minors of G are the product of the pivots times the motion T that the rows allow, and the determinant is
the product of the minors of both.
"""

from __future__ import annotations

from numpy import log

from mbref.kernels.compilation import kernel
from mbref.linear_algebra.elimination import determinant, product_of_pivots
from mbref.taylor.partition import freedoms, put_gradient

SMALLEST = 1e-300  # of a number whose logarithm is taken


@kernel
def remember_gradient(memory):
    """Keep G where the step began; of a square one its determinant, by the pivots if they are of its rows."""
    progress, rank = memory.progress, memory.progress.rank
    if freedoms(memory) > 0:
        put_gradient(memory.series.past, memory)
        keep_gradient(memory)
    elif progress.choice == progress.past_choice:
        progress.past_negative, progress.past_logarithm = product_of_pivots(memory.solver.past, rank)
    else:
        put_gradient(memory.series.past, memory)
        progress.past_negative, progress.past_logarithm = determinant_of_rows(memory)


@kernel
def keep_gradient(memory):
    """Keep Gᵀ of the independent rows of the gradient in ``work``."""
    solver = memory.solver
    for i in range(memory.progress.rank):
        for c in range(solver.work.shape[1]):
            solver.past_gradient[c, i] = solver.work[solver.pivot_rows[i], c]


@kernel
def overlap(y, memory):
    """Whether det(G Gᵀ₀) of the independent rows is negative, and its logarithm: G at variables y[0]."""
    put_gradient(y, memory)
    if freedoms(memory) == 0:
        negative, size = determinant_of_rows(memory)
        return negative != memory.progress.past_negative, size + memory.progress.past_logarithm
    return overlap_of_rows(memory)


@kernel
def determinant_of_rows(memory):
    """Whether det G of a square gradient in ``work`` is negative, and its logarithm: of rows and variables as
    they were chosen, so that it is the product of the pivots."""
    solver, rank = memory.solver, memory.progress.rank
    for i in range(rank):
        for c in range(rank):
            solver.product[i, c] = solver.work[solver.pivot_rows[i], solver.pivot_columns[c]]
    return determinant(solver.product, rank)


@kernel
def overlap_at_end(memory):
    """The same as ``overlap`` where the step ends."""
    if has_one_motion(memory):
        return overlap_of_motions(memory)
    if freedoms(memory) > 0:
        return overlap(memory.series.terms, memory)
    negative, size = product_of_pivots(memory.solver.last, memory.progress.rank)
    return negative != memory.progress.past_negative, size + memory.progress.past_logarithm


@kernel
def size_at_start(memory):
    """The logarithm of det(G₀ Gᵀ₀)."""
    if freedoms(memory) == 0:
        return 2.0 * memory.progress.past_logarithm
    if has_one_motion(memory):
        return size_of_motion(memory)
    _, size = overlap(memory.series.past, memory)
    return size


@kernel
def overlap_of_rows(memory):
    """The same as ``overlap``, of the gradient in ``work``."""
    solver, rank = memory.solver, memory.progress.rank
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
def has_one_motion(memory):
    """Whether the rows leave one variable independent, and are the same ones at both ends of a step."""
    progress = memory.progress
    same = progress.choice == progress.past_choice or progress.rank == memory.solver.pivot_rows.shape[0]
    return freedoms(memory) == 1 and same


@kernel
def oppose(along, memory):
    """Whether minors at both ends of a step, by signs of the pivots, point against each other along motions
    whose product has the sign of ``along``."""
    solver, progress = memory.solver, memory.progress
    negative = (along < 0.0) != (progress.odd != progress.past_odd)
    for k in range(progress.rank):
        negative = negative != (solver.last[k] * solver.past[k] < 0.0)
    return negative


@kernel
def along_motions(memory):
    """The product of the motions T that the rows allow at both ends of a step."""
    solver, along = memory.solver, 0.0
    for i in range(solver.pivot_columns.shape[0]):
        along += solver.null_space[0, i] * solver.past_motion[i]
    return along


@kernel
def motions_oppose(memory):
    """Whether the determinant of the gradients at both ends of a step is negative, by pivots and motions."""
    return oppose(along_motions(memory), memory)


@kernel
def rates_oppose(memory):
    """Whether a motion without drivers goes along the minors at one end of a step alone.

    It does where branches cross, however far the minors turn on the way: they are smooth, and vanish there.
    """
    solver, past, terms, before, after = memory.solver, memory.series.past, memory.series.terms, 0.0, 0.0
    for i in range(solver.pivot_columns.shape[0]):
        before += solver.past_motion[i] * past[1, i]
        after += solver.null_space[0, i] * terms[1, i]
    return oppose(before * after, memory)


@kernel
def overlap_of_motions(memory):
    """The same as ``overlap_at_end``, by pivots and motions."""
    along, solver, rank = along_motions(memory), memory.solver, memory.progress.rank
    _, before = product_of_pivots(solver.past, rank)
    _, after = product_of_pivots(solver.last, rank)
    return oppose(along, memory), before + after + log(max(abs(along), SMALLEST))


@kernel
def size_of_motion(memory):
    """The same as ``size_at_start``, by pivots and motions."""
    solver, square = memory.solver, 0.0
    for i in range(solver.pivot_columns.shape[0]):
        square += solver.past_motion[i] * solver.past_motion[i]
    _, size = product_of_pivots(solver.past, memory.progress.rank)
    return 2.0 * size + log(square)
