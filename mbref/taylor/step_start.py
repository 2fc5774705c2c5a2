"""The start of a step: its partition by complete pivoting of the gradient G, and the return to it after a
failed attempt."""

from __future__ import annotations

from mbref.kernels.compilation import exchangeable, inlined, kernel
from mbref.kernels.layout import OK
from mbref.linear_algebra.vectors import copy
from mbref.taylor.correction import violation
from mbref.taylor.layout import PARTITION, RETURN_TO_START
from mbref.taylor.partition import put_rows, save_start_pivots
from mbref.taylor.simd import WIDTH, load, max_abs, store
from mbref.taylor.solver import factorise_anew

GROWN = 2.0  # largest entry of G / its value at the start: up to this growth, positions keep their unit


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

    Lengths that grow along slides would enlarge some pivots and reduce others, far from singular positions.
    So positions have the growth of the mechanism since its start as their unit. The tableau contains other
    numbers afterwards.
    """
    solver, tolerance = memory.solver, memory.run.equations.system.settings.rank_tolerance
    pivot_rows, pivot_columns, rank = solver.pivot_rows, solver.pivot_columns, 0
    tableau, row_max = solver.tableau, solver.row_max
    parity = False
    put_rows(memory)
    copy(memory.series.variable, solver.left)
    put_largest_entries(memory)
    if choose_units(memory):
        copy(solver.unit, solver.left)
        put_largest_entries(memory)
    copy(memory.series.variable, solver.left)
    for k in range(pivot_rows.shape[0]):
        pivot_rows[k] = k
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


@kernel
def put_largest_entries(memory):
    """Multiply the columns of the tableau by ``left``, and keep the largest entry of each row."""
    for k in range(memory.solver.pivot_rows.shape[0]):
        subtract_pivot_row(k, 0.0, k, memory)


@kernel
def choose_units(memory):
    """Choose the units of the variables by the growth of the largest entry of G since the first selection.

    Return whether positions have another unit than 1.
    """
    solver, partition, forms, largest = memory.solver, memory.partition, memory.pose_maps.along, 0.0
    for k in range(solver.row_max.shape[0]):
        largest = max(largest, solver.row_max[k])
    if partition.start_entry == 0.0:
        partition.start_entry = largest
    has_grown = largest > GROWN * partition.start_entry
    growth = largest / partition.start_entry if has_grown else 1.0
    for i in range(solver.pivot_columns.shape[0]):
        is_position = forms[i, 0] != 0.0 or forms[i, 1] != 0.0 or forms[i, 2] != 0.0
        solver.unit[i] = growth if is_position else 1.0
    return has_grown


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
