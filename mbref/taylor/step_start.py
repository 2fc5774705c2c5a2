"""The start of a step: its partition by complete pivoting of the gradient G, the saved series that the step
evaluates, and the return to it after a failed attempt."""

from __future__ import annotations

from mbref.kernels.compilation import exchangeable, inlined, kernel
from mbref.kernels.layout import OK
from mbref.linear_algebra.vectors import copy
from mbref.taylor.correction import violation
from mbref.taylor.layout import PARTITION, RETURN_TO_START
from mbref.taylor.loads import TORSION, TORSION_SERIES
from mbref.taylor.partition import put_rows, save_start_pivots
from mbref.taylor.simd import WIDTH, load, max_abs, store
from mbref.taylor.solver import factorise_anew


@kernel
def save_series(memory):
    """Save the series that starts here as the one that the step evaluates; angles have no last order."""
    series, step, order = memory.series, memory.step, memory.mode.order
    for j in range(0, (order + 1) * series.terms.shape[1], WIDTH):
        store(load(series.terms, j), series.past, j)
    for s in range(series.past_angles.shape[0]):
        for k in range(order):
            series.past_angles[s, k] = series.torsions[TORSION_SERIES * s + TORSION, k]
        series.past_angles[s, order] = 0.0
    step.last_order = step.used_order = order
    step.time_to_pole = 0.0


@exchangeable(RETURN_TO_START)
def return_to_start(memory):
    """Restore the state, the partition and the pivots at the start of the step, and measure its violation."""
    past, terms = memory.series.past, memory.series.terms
    for k in range(2):
        copy(past[k], terms[k])
    memory.step.start_violation = violation(memory)
    if memory.partition.partition_id != memory.step.start_partition_id:
        memory.kernels.partition(memory)
        save_start_pivots(memory)
    return OK


@exchangeable(PARTITION)
def choose_partition(memory):
    """Choose a partition at the first coefficients, and compute its response; return its rank."""
    memory.partition.rank = memory.kernels.choose(memory)
    factorise_anew(memory)
    return memory.partition.rank


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
    for _ in range(min(pivot_rows.shape[0], pivot_columns.shape[0])):
        p = place_of_largest_row(row_max, pivot_rows, rank)
        if not row_max[pivot_rows[p]] > tolerance:
            break
        parity = parity != (p != rank)
        pivot_rows[rank], pivot_rows[p] = pivot_rows[p], pivot_rows[rank]
        q, r = rank, pivot_rows[rank]
        for free in range(rank, pivot_columns.shape[0]):
            if abs(tableau[r, pivot_columns[free]]) == row_max[r]:
                q = free
                break
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
