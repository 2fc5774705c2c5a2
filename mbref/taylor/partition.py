"""Independent constraint rows, and a dependent variable for each, by complete pivoting of the gradient G."""

from __future__ import annotations

from numpy import inf

from mbref.kernels.compilation import exchangeable, inlined, kernel
from mbref.kernels.layout import OK
from mbref.linear_algebra.vectors import copy
from mbref.taylor.angles import add_angle_gradients
from mbref.taylor.layout import GRADIENT, PARTITION
from mbref.taylor.simd import WIDTH, load, max_abs, store


@kernel
def freedoms(memory):
    """Return the number of degrees of freedom: variables that the rows leave to the forces."""
    return memory.solver.pivot_columns.shape[0] - memory.partition.rank


@kernel
def is_undriven(memory):
    """Return whether nothing in the scene depends on time: it has no drivers and no factors of loads."""
    return memory.run.equations.piece.shape[0] == 0


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
    add_angle_gradients(y, work, memory)
    return OK


@kernel
def eliminate_below(work, pivot_rows, pivot_columns, k):
    """Subtract pivot row k from the rows after it."""
    for p in range(k + 1, pivot_rows.shape[0]):
        factor = work[pivot_rows[p], pivot_columns[k]] / work[pivot_rows[k], pivot_columns[k]]
        if factor != 0.0:
            for q in range(k, pivot_columns.shape[0]):
                work[pivot_rows[p], pivot_columns[q]] -= factor * work[pivot_rows[k], pivot_columns[q]]


@inlined
def put_rows(memory):
    """Evaluate the tableau [G 1] at the first coefficients: a row has a one in the lane of its multiplier."""
    solver, rows, terms = memory.solver, memory.polynomials.rows, memory.series.terms
    tableau, linear, place = solver.tableau.reshape(-1), solver.linear, solver.place
    weight, other = rows.weight, rows.other
    for j in range(0, tableau.shape[0], WIDTH):
        store(load(linear, j), tableau, j)
    for e in range(place.shape[0]):
        tableau[place[e]] += weight[e] * terms[0, other[e]]
    if memory.polynomials.torsions.row.shape[0] > 0:
        add_angle_gradients(terms, solver.tableau, memory)


@exchangeable(PARTITION)
def choose(memory):
    """Choose independent rows and dependent variables by complete pivoting; return their number.

    The tableau contains other numbers afterwards.
    """
    solver, tolerance = memory.solver, memory.run.equations.system.settings.rank_tolerance
    pivot_rows, pivot_columns, rank = solver.pivot_rows, solver.pivot_columns, 0
    tableau, row_max = solver.tableau, solver.row_max
    parity = False
    put_rows(memory)
    copy(memory.series.variable, solver.left)
    for k in range(pivot_rows.shape[0]):
        pivot_rows[k] = k
        subtract_pivot_row(k, 0.0, k, memory)
    for k in range(pivot_columns.shape[0]):
        pivot_columns[k] = k
    while rank < min(pivot_rows.shape[0], pivot_columns.shape[0]):
        p = place_of_largest_row(row_max, pivot_rows, rank)
        if not row_max[pivot_rows[p]] > tolerance:
            break
        parity = parity != (p != rank)
        pivot_rows[rank], pivot_rows[p] = pivot_rows[p], pivot_rows[rank]
        q, r = rank, pivot_rows[rank]
        while q < pivot_columns.shape[0] - 1 and abs(tableau[r, pivot_columns[q]]) != row_max[r]:
            q += 1
        parity = parity != (q != rank)
        pivot_columns[rank], pivot_columns[q] = pivot_columns[q], pivot_columns[rank]
        c = pivot_columns[rank]
        solver.left[c], inverse = 0.0, 1.0 / tableau[r, c]
        for p in range(rank + 1, pivot_rows.shape[0]):
            subtract_pivot_row(pivot_rows[p], inverse * tableau[pivot_rows[p], c], r, memory)
        rank += 1
    memory.partition.partition_id += 1
    memory.partition.parity = parity
    return rank


@inlined
def place_of_largest_row(row_max, pivot_rows, first):
    """Return the first place, from ``first`` on, of the row with the largest entry."""
    place = first
    for p in range(first + 1, pivot_rows.shape[0]):
        if row_max[pivot_rows[p]] > row_max[pivot_rows[place]]:
            place = p
    return place


@inlined
def subtract_pivot_row(i, factor, pivot, memory):
    """Subtract a pivot row, times a factor, from row i in the free columns; keep its largest entry."""
    tableau, left, largest = memory.solver.tableau, memory.solver.left, 0.0
    lanes = tableau.shape[1]
    for j in range(0, memory.solver.pivot_columns.shape[0], WIDTH):
        entries = load(tableau, i * lanes + j) - factor * load(tableau, pivot * lanes + j)
        entries = load(left, j) * entries
        store(entries, tableau, i * lanes + j)
        largest = max(largest, max_abs(entries))
    memory.solver.row_max[i] = largest


@kernel
def save_replaced_pivot(memory):
    """Save the least pivot of the partition that is replaced; minus infinity if a sign differs from the sign
    at the start of the step."""
    solver, least = memory.solver, inf
    for k in range(memory.partition.rank):
        same = solver.last[k] * solver.past[k] > 0.0
        least = min(least, abs(solver.last[k]) if same else -inf)
    memory.partition.replaced_pivot = least


@kernel
def replaced_pivot(memory):
    """Return the least pivot of the partition at the start of the step, just before its only replacement.

    Return minus infinity if a sign has changed, or if the partition was not replaced exactly once.
    """
    partition = memory.partition
    is_single = partition.partition_id == memory.step.start_partition_id + 1
    return partition.replaced_pivot if is_single else -inf


@kernel
def least_pivot(memory):
    """Return the least pivot of G at the last factorisation; 1 without rows."""
    solver, least = memory.solver, 1.0
    for k in range(memory.partition.rank):
        least = min(least, abs(solver.last[k]))
    return least


@kernel
def save_start_pivots(memory):
    """Save pivots, null vector and partition of the last factorisation for the start of a step."""
    solver, step, partition, progress = memory.solver, memory.step, memory.partition, memory.progress
    copy(solver.last, solver.past)
    for i in range(solver.pivot_columns.shape[0]):
        solver.past_motion[i] = solver.null_space[0, i]
    step.start_partition_id, step.start_parity = partition.partition_id, partition.parity
    step.start_pivot = least_pivot(memory)
    progress.largest_pivot = max(progress.largest_pivot, step.start_pivot)
