"""Independent constraint rows, and a dependent variable for each, by complete pivoting of the gradient G."""

from __future__ import annotations

from numpy import inf

from mbref.kernels.compilation import kernel


@kernel
def put_gradient(y, memory):
    """G at variables y[0] into ``work``; rows are of length one about, or zero in all positions."""
    rows, work = memory.polynomials.rows, memory.solver.work
    work[:] = 0.0
    for e in range(rows.linear_row.shape[0]):
        if rows.linear_lane[e] < work.shape[1]:
            work[rows.linear_row[e], rows.linear_lane[e]] += rows.linear_weight[e]
    for e in range(rows.row.shape[0]):
        if rows.lane[e] < work.shape[1]:
            work[rows.row[e], rows.lane[e]] += rows.weight[e] * y[0, rows.other[e]]


@kernel
def largest_entry(work, row, order, k):
    """The largest entry among the rows and columns from k on, and its places."""
    best, at_row, at_column = -1.0, k, k
    for p in range(k, row.shape[0]):
        for q in range(k, order.shape[0]):
            size = abs(work[row[p], order[q]])
            if size > best:
                best, at_row, at_column = size, p, q
    return best, at_row, at_column


@kernel
def eliminate(work, row, order, k):
    """Subtract the pivot row k from those after it."""
    for p in range(k + 1, row.shape[0]):
        factor = work[row[p], order[k]] / work[row[k], order[k]]
        if factor != 0.0:
            for q in range(k, order.shape[0]):
                work[row[p], order[q]] -= factor * work[row[k], order[q]]


@kernel
def choose(memory):
    """Choose independent rows and dependent variables by complete pivoting; how many there are."""
    solver, tolerance = memory.solver, memory.run.equations.system.settings.rank_tolerance
    row, order, work, rank = solver.row, solver.order, solver.work, 0
    put_gradient(memory.series.terms, memory)
    for k in range(row.shape[0]):
        row[k] = k
    for k in range(order.shape[0]):
        order[k] = k
    while rank < min(row.shape[0], order.shape[0]):
        size, p, q = largest_entry(work, row, order, rank)
        if size <= tolerance:
            break
        row[rank], row[p] = row[p], row[rank]
        order[rank], order[q] = order[q], order[rank]
        eliminate(work, row, order, rank)
        rank += 1
    memory.progress.choice += 1
    return rank


@kernel
def keep_pivot(memory):
    """Keep the least pivot of rows and variables that are no longer used; minus infinity where one has
    another sign than where the step began."""
    solver, least = memory.solver, inf
    for k in range(memory.progress.rank):
        same = solver.last[k] * solver.past[k] > 0.0
        least = min(least, abs(solver.last[k]) if same else -inf)
    memory.progress.kept_pivot = least


@kernel
def kept_pivot(memory):
    """The least pivot of the rows and variables where the step began, just before others were chosen;
    minus infinity if a sign had changed, or others were chosen more than once or never."""
    progress = memory.progress
    return progress.kept_pivot if progress.choice == progress.past_choice + 1 else -inf
