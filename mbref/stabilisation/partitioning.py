"""Coordinate partitioning: only independent coordinates and their rates are integrated (section 3.2).

Among (r, p) of every body, with the rows Φ and pᵀp - 1, Gaussian elimination with full pivoting finds
the redundant rows and the independent coordinates v (Eqs. 10 and 11).  At every evaluation the dependent
coordinates u follow from Φ(u, v, t) = 0 by Newton–Raphson (Eq. 15), started by u + h u' + ½ h² u'' of the
last accepted step (Eq. 16), and their rates from Φ_u u' = ν - Φ_v v' (Eq. 14).  Φ_p = 2 Φ_π' L.

The partition is kept while the smallest pivot of Φ_u relative to its largest stays above ``kept`` times its
largest value so far; then the partition of largest pivots is computed. It replaces the present one, and the
integrator restarts, unless the present one has the greater smallest pivot by a factor. So a partition that is
chosen near a singular position is replaced behind it, and a good one is kept through a singular position,
where all pivots are small.  A largest pivot below 1 counts as 1: all pivots fall together where bodies spin
freely, and a row pᵀp - 1 has a pivot of 1 at least, as a component of p is at least 1/2.  With ``kept`` = 0.1
partitions last near turning points of a coordinate, and errors are 10 to 1000 times larger than with 0.6. A
partition with fewer dependent coordinates ends the run: the run is at a singular position.

Rows between velocities alone, as of a wheel that does not slip, leave fewer independent rates than
independent coordinates.  Then the rates have a partition of their own, of all rows: y contains independent
coordinates and independent rates, and all other rates follow from these. A wheel turns fast, and its pivots
vanish while others are smaller; so partitions are compared by the products of all pivots.
"""

from __future__ import annotations

from numpy import inf, log

from mbref.equations.coordinates import coordinate_rates, copy_state
from mbref.equations.evaluation import assemble_system, evaluate
from mbref.kernels.compilation import exchangeable, kernel
from mbref.kernels.layout import ACCEPT, CHANGED, ENTER, NOT_CONVERGED, OK, RATES, SINGULAR_AHEAD
from mbref.linear_algebra.elimination import full_pivot, lu_of_chosen, lu_solve, size_of_determinant
from mbref.linear_algebra.vectors import copy
from mbref.stabilisation.base import Stabilisation
from mbref.stabilisation.euler_parameter_rates import (
    jacobian_by_euler_parameters,
    residual_of_rows,
    scale_by_lengths,
    second_rates,
    velocities_of_rates,
)
from mbref.stabilisation.partition_layout import Options, Scratch, options_of, scratch_of

MOST_DEPENDENT_STEPS = 20  # largest number of Newton steps for the dependent coordinates
# ratio of smallest pivots, present to new partition, above which the present one is kept; 1.1 to 1.5 gave the
# same outcomes; with 1, one stayed whose motion was 2 mm off; with 2, one that passes singular positions went
BETTER = 1.3
SINGULAR_DEPENDENT = 1e-13  # pivot of Φ_u (1, or 1/m) below which Φ_u is singular to rounding


@kernel
def partition_jacobian(memory):
    """Compute the Jacobian at the state of the last evaluation, in scenes with wheels in their own units."""
    scratch = scratch_of(memory.chart)
    jacobian_by_euler_parameters(memory.state.coordinates, memory.equations, scratch.jacobian)
    scratch.row_scale[:], scratch.column_scale[:] = 1.0, 1.0
    if memory.equations.scene.velocity_rows.shape[0] > 0:
        scale_by_lengths(memory.equations.scene, scratch.jacobian, scratch.row_scale, scratch.column_scale)


@kernel
def choose_coordinates(memory):
    """Choose the partition at ``memory.state``, the state of the last evaluation."""
    q, scratch, system = memory.state.coordinates, scratch_of(memory.chart), memory.equations.system
    a, velocity_rows = scratch.jacobian, memory.equations.scene.velocity_rows
    partition_jacobian(memory)
    for row in velocity_rows:
        a[row] = 0.0
    system.counts.factorisations += 1
    rank = full_pivot(
        a, a.shape[0], a.shape[1], scratch.row_order, scratch.column_order, system.settings.rank_tolerance
    )
    scratch.partition.rank = scratch.partition.rate_rank = rank
    if velocity_rows.shape[0] > 0:
        choose_rates(memory)
    memory.loop.clock.y_size = 2 * q.shape[0] - rank - scratch.partition.rate_rank
    scratch.partition.largest_pivot = -inf


@kernel
def choose_rates(memory):
    """Choose the partition of the rates by all rows, at the state of the last evaluation."""
    scratch, settings = scratch_of(memory.chart), memory.equations.system.settings
    a, rows, columns = scratch.jacobian, scratch.rate_row_order, scratch.rate_column_order
    partition_jacobian(memory)
    memory.equations.system.counts.factorisations += 1
    scratch.partition.rate_rank = full_pivot(
        a, a.shape[0], a.shape[1], rows, columns, settings.rank_tolerance
    )


@kernel
def order_of_rates(memory):
    """Return the order of the rates, the dependent ones first, and the number of dependent rates."""
    scratch = scratch_of(memory.chart)
    if memory.equations.scene.velocity_rows.shape[0] > 0:
        return scratch.rate_column_order, scratch.partition.rate_rank
    return scratch.column_order, scratch.partition.rank


@kernel
def gather_independent(y, memory):
    """Copy the independent coordinates and rates of ``memory.state`` into y; return the length of y."""
    state, scratch = memory.state, scratch_of(memory.chart)
    order, rank = scratch.column_order, scratch.partition.rank
    of_rates, rate_rank = order_of_rates(memory)
    k, free = order.shape[0] - rank, of_rates.shape[0] - rate_rank
    for i in range(k):
        y[i] = state.coordinates[order[rank + i]]
    for i in range(free):
        y[k + i] = state.coordinate_rates[of_rates[rate_rank + i]]
    return k + free


@exchangeable(ENTER)
def enter(t, y, memory):
    state = memory.state
    coordinate_rates(state.coordinates, state.velocities, state.coordinate_rates)
    evaluate(t, state.coordinates, state.velocities, memory.equations)
    choose_coordinates(memory)
    copy_state(state, memory.previous)
    memory.watch.accepted_time = t
    return gather_independent(y, memory)


@kernel
def factorise_dependent(memory):
    """Compute LU factors of Φ_u at the state of the last evaluation; return False if Φ_u is singular."""
    scratch, partition = scratch_of(memory.chart), scratch_of(memory.chart).partition
    partition_jacobian(memory)
    memory.equations.system.counts.factorisations += 1
    chosen = scratch.row_order, scratch.column_order, partition.rank
    pivot = lu_of_chosen(scratch.jacobian, chosen, scratch.dependent, scratch.exchanges, SINGULAR_DEPENDENT)
    partition.pivot = pivot if pivot > 0.0 else partition.pivot
    return pivot > 0.0


@kernel
def factorise_rates(memory):
    """Compute LU factors of the dependent rates at the state of the last evaluation, if they have a partition
    of their own; return False if they are singular. ``pivot`` is then the logarithm of the product of all
    pivots."""
    if memory.equations.scene.velocity_rows.shape[0] == 0:
        return True
    scratch, partition = scratch_of(memory.chart), scratch_of(memory.chart).partition
    partition_jacobian(memory)
    memory.equations.system.counts.factorisations += 1
    lu, exchanges = scratch.dependent_rates, scratch.rate_exchanges
    chosen = scratch.rate_row_order, scratch.rate_column_order, partition.rate_rank
    if lu_of_chosen(scratch.jacobian, chosen, lu, exchanges, SINGULAR_DEPENDENT) == 0.0:
        return False
    partition.pivot = size_of_determinant(lu, partition.rate_rank)
    partition.pivot += size_of_determinant(scratch.dependent, partition.rank)
    return True


@kernel
def is_smaller(pivot, factor, other, memory):
    """Return whether a pivot is smaller than a factor times another one; see ``factorise_rates``."""
    if memory.equations.scene.velocity_rows.shape[0] == 0:
        return pivot < factor * other
    return pivot < log(factor) + other


@kernel
def predict_dependent(t, memory):
    """Predict dependent coordinates by u + h u' + ½ h² u'' of the last accepted state (Eq. 16)."""
    q, last, scratch = memory.state.coordinates, memory.previous, scratch_of(memory.chart)
    h = t - memory.watch.accepted_time
    for i in range(scratch.partition.rank):
        j = scratch.column_order[i]
        rate, second = last.coordinate_rates[j], last.coordinate_second[j]
        q[j] = last.coordinates[j] + h * rate + 0.5 * h * h * second


@kernel
def solve_dependent_coordinates(t, y, memory):
    """Compute the dependent coordinates of y by Newton–Raphson into ``memory.state``, and factorise Φ_u
    there.

    ``projection.newton_step`` is not used, because only the dependent coordinates are unknown here (Eq. 15).
    """
    state, scratch = memory.state, scratch_of(memory.chart)
    order, rank, b = scratch.column_order, scratch.partition.rank, scratch.residual
    system, before = memory.equations.system, inf
    tolerance, stuck = system.settings.newton_tolerance, system.settings.stuck
    predict_dependent(t, memory)
    for i in range(order.shape[0] - rank):
        state.coordinates[order[rank + i]] = y[i]
    for _ in range(MOST_DEPENDENT_STEPS):
        evaluate(t, state.coordinates, state.velocities, memory.equations)
        violation = residual_of_rows(
            state.coordinates, memory.equations.rows.phi, scratch.row_order[:rank], b
        )
        if not factorise_dependent(memory):
            return NOT_CONVERGED
        if violation <= tolerance or before <= violation <= stuck:
            return OK
        before = violation
        system.counts.newton += 1
        for i in range(rank):
            b[i] *= scratch.row_scale[scratch.row_order[i]]
        lu_solve(scratch.dependent, rank, scratch.exchanges, b)
        for i in range(rank):
            state.coordinates[order[i]] -= b[i] * scratch.column_scale[order[i]]
    return NOT_CONVERGED


@kernel
def solve_dependent_rates(y, memory):
    """Compute the dependent rates of y (Eq. 14) and v of all bodies into ``memory.state``, with the last
    factor of the dependent columns."""
    scratch, nu, q_rate = scratch_of(memory.chart), memory.equations.rows.nu, memory.state.coordinate_rates
    (order, rank), a, b = order_of_rates(memory), scratch.jacobian, scratch.residual
    rows, lu, exchanges = scratch.row_order, scratch.dependent, scratch.exchanges
    if memory.equations.scene.velocity_rows.shape[0] > 0:
        rows, lu, exchanges = scratch.rate_row_order, scratch.dependent_rates, scratch.rate_exchanges
    free, first = order.shape[0] - rank, q_rate.shape[0] - scratch.partition.rank
    for i in range(rank):
        row = rows[i]
        b[i] = nu[row] * scratch.row_scale[row] if row < nu.shape[0] else 0.0
        for k in range(free):
            b[i] -= a[row, order[rank + k]] * (y[first + k] / scratch.column_scale[order[rank + k]])
    lu_solve(lu, rank, exchanges, b)
    for i in range(rank):
        q_rate[order[i]] = b[i] * scratch.column_scale[order[i]]
    for k in range(free):
        q_rate[order[rank + k]] = y[first + k]
    velocities_of_rates(memory.state)


@exchangeable(RATES)
def rates(t, y, y_rate, memory):
    status = solve_dependent_coordinates(t, y, memory)
    if status != OK:
        return status
    if not factorise_rates(memory):
        return NOT_CONVERGED
    solve_dependent_rates(y, memory)
    state, equations, scratch = memory.state, memory.equations, scratch_of(memory.chart)
    assemble_system(t, state.coordinates, state.velocities, equations)
    status = memory.kernels.accelerate(equations.system)
    second_rates(equations.system.acceleration, state)
    order, rank = scratch.column_order, scratch.partition.rank
    of_rates, rate_rank = order_of_rates(memory)
    k = order.shape[0] - rank
    for i in range(k):
        y_rate[i] = state.coordinate_rates[order[rank + i]]
    for i in range(of_rates.shape[0] - rate_rank):
        y_rate[k + i] = state.coordinate_second[of_rates[rate_rank + i]]
    return status


@exchangeable(ACCEPT)
def accept(t, y, memory):
    status = solve_dependent_coordinates(t, y, memory)
    if status != OK:
        return status
    if not factorise_rates(memory):
        return NOT_CONVERGED
    solve_dependent_rates(y, memory)
    copy_state(memory.state, memory.previous)
    memory.watch.accepted_time = t
    partition = scratch_of(memory.chart).partition
    partition.largest_pivot = max(partition.largest_pivot, partition.pivot)
    if is_smaller(partition.pivot, options_of(memory.chart_options).kept, partition.largest_pivot, memory):
        rank, rate_rank = partition.rank, partition.rate_rank
        replaced = replace_partition(memory)
        if partition.rank < rank or partition.rate_rank < rate_rank:
            return SINGULAR_AHEAD
        if replaced:
            gather_independent(y, memory)
            return CHANGED
    return OK


@kernel
def replace_partition(memory):
    """Choose the partition at ``memory.state``; return False and keep the last one if that is better."""
    scratch = scratch_of(memory.chart)
    partition, pivot = scratch.partition, scratch.partition.pivot
    rank, rate_rank = partition.rank, partition.rate_rank
    copy(scratch.row_order, scratch.last_row_order)
    copy(scratch.column_order, scratch.last_column_order)
    copy(scratch.rate_row_order, scratch.last_rate_row_order)
    copy(scratch.rate_column_order, scratch.last_rate_column_order)
    choose_coordinates(memory)
    if partition.rank != rank or partition.rate_rank != rate_rank:
        return True
    factorise_dependent(memory)
    factorise_rates(memory)
    if is_smaller(pivot, BETTER, partition.pivot, memory):
        return True
    copy(scratch.last_row_order, scratch.row_order)
    copy(scratch.last_column_order, scratch.column_order)
    copy(scratch.last_rate_row_order, scratch.rate_row_order)
    copy(scratch.last_rate_column_order, scratch.rate_column_order)
    partition.pivot = partition.largest_pivot = pivot
    return False


PARTITIONING = Stabilisation(
    "partitioning",
    enter,
    rates,
    rates,
    accept,
    memory=Scratch,
    numbers=Options,
    chooses_coordinates=True,
    watches_rank=True,
    # rad; with steps of 1 rad, velocities of a four-bar at rtol 1e-3 were off by a tenth of the largest
    largest_turn=0.5,
)
