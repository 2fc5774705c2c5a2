"""The partition: independent constraint rows, a dependent variable for each, and their pivots."""

from __future__ import annotations

from numpy import inf

from mbref.kernels.compilation import inlined, kernel
from mbref.linear_algebra.vectors import copy
from mbref.taylor.coupled_coordinates import add_gradients, has_coordinates
from mbref.taylor.simd import WIDTH, load, store


@kernel
def freedoms(memory):
    """Return the number of degrees of freedom: variables that the rows leave to the forces."""
    return memory.solver.pivot_columns.shape[0] - memory.partition.rank


@kernel
def is_undriven(memory):
    """Return whether nothing in the scene depends on time: it has no drivers and no factors of loads."""
    return memory.run.equations.piece.shape[0] == 0


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
    if has_coordinates(memory.polynomials):
        add_gradients(terms, solver.tableau, memory)


@kernel
def save_replaced_pivot(memory):
    """Save the least pivot of the partition that is replaced; minus infinity if a sign differs from the sign
    at the start of the step."""
    solver, least = memory.solver, inf
    for k in range(memory.partition.rank):
        same = solver.last[k] * solver.past[k] > 0.0
        least = min(least, unit_pivot(k, solver) if same else -inf)
    memory.partition.replaced_pivot = least


@kernel
def replaced_pivot(memory):
    """Return the least pivot of the partition at the start of the step, just before its only replacement.

    Return minus infinity if a sign has changed, or if the partition was not replaced exactly once.
    """
    partition = memory.partition
    is_single = partition.partition_id == memory.step.start_partition_id + 1
    return partition.replaced_pivot if is_single else -inf


@inlined
def unit_pivot(k, solver):
    """Return the size of pivot k of G in the unit of its variable."""
    return solver.unit[solver.pivot_columns[k]] * abs(solver.last[k])


@kernel
def least_pivot(memory):
    """Return the least pivot of G at the last factorisation; 1 without rows, or without closed loops, where
    no position is singular."""
    solver, least = memory.solver, 1.0
    if memory.run.control.closed_loops == 0.0:
        return least
    for k in range(memory.partition.rank):
        least = min(least, unit_pivot(k, solver))
    return least


@kernel
def save_start_pivots(memory):
    """Save pivots, null vector and partition of the last factorisation for the start of a step."""
    solver, step, partition, distance = memory.solver, memory.step, memory.partition, memory.distance
    copy(solver.last, solver.past)
    for i in range(solver.pivot_columns.shape[0]):
        solver.past_motion[i] = solver.null_space[0, i]
    step.start_partition_id, step.start_parity = partition.partition_id, partition.parity
    distance.start_pivot = least_pivot(memory)
    distance.largest_pivot = max(distance.largest_pivot, distance.start_pivot)
