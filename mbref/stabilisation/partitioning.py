"""Coordinate partitioning: only independent coordinates and their rates are integrated (section 3.2).

Among (r, p) of every body, with the rows Φ and pᵀp - 1, Gaussian elimination with full pivoting finds
the redundant rows and the independent coordinates v (Eqs. 10 and 11).  At every evaluation the dependent
coordinates u follow from Φ(u, v, t) = 0 by Newton–Raphson (Eq. 15), started by u + h u' + ½ h² u'' of the
last accepted step (Eq. 16), and their rates from Φ_u u' = ν - Φ_v v' (Eq. 14).  Φ_p = 2 Φ_π' L.

The partition is kept while the smallest pivot of Φ_u relative to its largest stays above ``kept`` times its
largest value so far; then the partition of largest pivots is computed. It replaces the present one, and the
integrator restarts, unless the present one has the greater smallest pivot by a factor. So a partition that is
chosen near a singular position is replaced behind it, and a good one is kept through a singular position,
where all pivots are small.  With ``kept`` = 0.1 partitions last near turning points of a coordinate, and
errors are 10 to 1000 times larger than with 0.6. A partition with fewer dependent coordinates ends the run:
the run is at a singular position.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from numpy import inf

from mbref.equations.coordinates import coordinate_rates, copy_state
from mbref.equations.evaluation import assemble_system, evaluate
from mbref.kernels.compilation import exchangeable, kernel
from mbref.kernels.layout import ACCEPT, CHANGED, ENTER, NOT_CONVERGED, OK, RATES, SINGULAR_AHEAD
from mbref.kernels.named_memory import Indices, Matrix, Vector, opener
from mbref.linear_algebra.elimination import full_pivot, lu_factor, lu_solve
from mbref.linear_algebra.vectors import copy
from mbref.stabilisation.base import Stabilisation
from mbref.stabilisation.projection import STUCK

MOST_DEPENDENT_STEPS = 20  # largest number of Newton steps for the dependent coordinates
# ratio of smallest pivots, present to new partition, above which the present one is kept; 1.1 to 1.5 gave the
# same outcomes; with 1, one stayed whose motion was 2 mm off; with 2, one that passes singular positions went
BETTER = 1.3
SINGULAR_DEPENDENT = 1e-13  # pivot of Φ_u (1, or 1/m) below which Φ_u is singular to rounding


class Options(NamedTuple):
    """Relative pivot of Φ_u below which a new partition is chosen."""

    kept: float = 0.6


class CoordinatePartition(NamedTuple):
    """Number of dependent coordinates; smallest pivot of Φ_u relative to its largest, at the last state, and
    its largest value since the partition was chosen."""

    rank: int = 0
    pivot: float = 0.0
    largest_pivot: float = 0.0


class Scratch(NamedTuple):
    """Memory of the Jacobian by Euler parameters, the factor of its dependent columns, and the partition."""

    jacobian: Annotated[Matrix, "m + nb", "7*nb"]  # [Φ_r Φ_p; 0 2pᵀ]
    dependent: Annotated[Matrix, "7*nb", "7*nb"]  # Φ_u of the active rows, factored
    residual: Annotated[Vector, "7*nb"]
    row_order: Annotated[Indices, "m + nb"]  # active rows first
    column_order: Annotated[Indices, "7*nb"]  # dependent coordinates first
    exchanges: Annotated[Indices, "7*nb"]  # column exchanges of the factorisation
    last_row_order: Annotated[Indices, "m + nb"]
    last_column_order: Annotated[Indices, "7*nb"]
    partition: CoordinatePartition


options_of, scratch_of = opener(Options), opener(Scratch)


@kernel
def jacobian_by_euler_parameters(q, equations, a):
    """Compute [Φ_r Φ_p; 0 2pᵀ] (m + nb, 7 nb) at the state of the last evaluation; Φ_p = 2 Φ_π' L."""
    bodies, blocks = equations.scene.row_bodies, equations.system.blocks
    m, nb = bodies.shape[0], q.shape[0] // 7
    a[:] = 0.0
    for row in range(m):
        for side in range(bodies.shape[1]):
            b = bodies[row, side]
            if b < nb:
                i, j = 7 * b, 6 * side
                for k in range(3):
                    a[row, i + k] = blocks[row, j + k]
                r1, r2, r3 = 2 * blocks[row, j + 3], 2 * blocks[row, j + 4], 2 * blocks[row, j + 5]
                w, x, y, z = q[i + 3], q[i + 4], q[i + 5], q[i + 6]
                a[row, i + 3] = -x * r1 - y * r2 - z * r3
                a[row, i + 4] = w * r1 - z * r2 + y * r3
                a[row, i + 5] = z * r1 + w * r2 - x * r3
                a[row, i + 6] = -y * r1 + x * r2 + w * r3
    for b in range(nb):
        for k in range(3, 7):
            a[m + b, 7 * b + k] = 2.0 * q[7 * b + k]


@kernel
def choose_coordinates(memory):
    """Choose the partition at ``memory.state``, the state of the last evaluation."""
    q, scratch, system = memory.state.coordinates, scratch_of(memory.chart), memory.equations.system
    a = scratch.jacobian
    jacobian_by_euler_parameters(q, memory.equations, a)
    system.counts.factorisations += 1
    rank = full_pivot(
        a, a.shape[0], a.shape[1], scratch.row_order, scratch.column_order, system.settings.rank_tolerance
    )
    scratch.partition.rank = rank
    memory.loop.clock.y_size = 2 * (q.shape[0] - rank)
    scratch.partition.largest_pivot = 0.0


@kernel
def gather_independent(y, memory):
    """Copy the independent coordinates and their rates of ``memory.state`` into y; return the length of y."""
    state, scratch = memory.state, scratch_of(memory.chart)
    order, rank = scratch.column_order, scratch.partition.rank
    k = order.shape[0] - rank
    for i in range(k):
        y[i] = state.coordinates[order[rank + i]]
        y[k + i] = state.coordinate_rates[order[rank + i]]
    return 2 * k


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
    scratch = scratch_of(memory.chart)
    a, lu, rank = scratch.jacobian, scratch.dependent, scratch.partition.rank
    rows, columns = scratch.row_order, scratch.column_order
    jacobian_by_euler_parameters(memory.state.coordinates, memory.equations, a)
    for i in range(rank):
        for j in range(rank):
            lu[i, j] = a[rows[i], columns[j]]
    memory.equations.system.counts.factorisations += 1
    if not lu_factor(lu, rank, scratch.exchanges, SINGULAR_DEPENDENT):
        return False
    smallest, greatest = abs(lu[0, 0]), abs(lu[0, 0])
    for i in range(rank):
        smallest, greatest = min(smallest, abs(lu[i, i])), max(greatest, abs(lu[i, i]))
    scratch.partition.pivot = smallest / greatest
    return True


@kernel
def find_violation(memory):
    """Compute Φ and pᵀp - 1 of the active rows into the residual; return the largest."""
    q, phi, scratch = memory.state.coordinates, memory.equations.rows.phi, scratch_of(memory.chart)
    m, rank, size, b = phi.shape[0], scratch.partition.rank, 0.0, scratch.residual
    for i in range(rank):
        row = scratch.row_order[i]
        if row < m:
            b[i] = phi[row]
        else:
            j = 7 * (row - m) + 3
            w, x, y, z = q[j], q[j + 1], q[j + 2], q[j + 3]
            b[i] = w * w + x * x + y * y + z * z - 1.0
        if not abs(b[i]) <= size:
            size = abs(b[i])
    return size


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
    tolerance = system.settings.newton_tolerance
    predict_dependent(t, memory)
    for i in range(order.shape[0] - rank):
        state.coordinates[order[rank + i]] = y[i]
    for _ in range(MOST_DEPENDENT_STEPS):
        evaluate(t, state.coordinates, state.velocities, memory.equations)
        violation = find_violation(memory)
        if not factorise_dependent(memory):
            return NOT_CONVERGED
        if violation <= tolerance or before <= violation <= STUCK * tolerance:
            return OK
        before = violation
        system.counts.newton += 1
        lu_solve(scratch.dependent, rank, scratch.exchanges, b)
        for i in range(rank):
            state.coordinates[order[i]] -= b[i]
    return NOT_CONVERGED


@kernel
def solve_dependent_rates(y, memory):
    """Compute the dependent rates of y (Eq. 14) and v of all bodies into ``memory.state``, with the last
    factor of Φ_u."""
    scratch, nu, q_rate = scratch_of(memory.chart), memory.equations.rows.nu, memory.state.coordinate_rates
    order, rank, a, b = scratch.column_order, scratch.partition.rank, scratch.jacobian, scratch.residual
    free = order.shape[0] - rank
    for i in range(rank):
        row = scratch.row_order[i]
        b[i] = nu[row] if row < nu.shape[0] else 0.0
        for k in range(free):
            b[i] -= a[row, order[rank + k]] * y[free + k]
    lu_solve(scratch.dependent, rank, scratch.exchanges, b)
    for i in range(rank):
        q_rate[order[i]] = b[i]
    for k in range(free):
        q_rate[order[rank + k]] = y[free + k]
    velocities_of_rates(memory.state)


@kernel
def velocities_of_rates(state):
    """Compute v from q': r' and ω' = 2 L p'."""
    q, q_rate, v = state.coordinates, state.coordinate_rates, state.velocities
    for body in range(q.shape[0] // 7):
        i, j = 7 * body, 6 * body
        for k in range(3):
            v[j + k] = q_rate[i + k]
        w, x, y, z = q[i + 3], q[i + 4], q[i + 5], q[i + 6]
        dw, dx, dy, dz = q_rate[i + 3], q_rate[i + 4], q_rate[i + 5], q_rate[i + 6]
        v[j + 3] = 2.0 * (-x * dw + w * dx + z * dy - y * dz)
        v[j + 4] = 2.0 * (-y * dw - z * dx + w * dy + x * dz)
        v[j + 5] = 2.0 * (-z * dw + y * dx - x * dy + w * dz)


@kernel
def second_rates(acceleration, state):
    """Compute q'' from the accelerations: r'' and p'' = ½ Lᵀ ω̇' - ¼ (ω'·ω') p."""
    q, v, second = state.coordinates, state.velocities, state.coordinate_second
    coordinate_rates(q, acceleration, second)
    for body in range(q.shape[0] // 7):
        j = 6 * body
        square = 0.25 * (v[j + 3] * v[j + 3] + v[j + 4] * v[j + 4] + v[j + 5] * v[j + 5])
        for k in range(3, 7):
            second[7 * body + k] -= square * q[7 * body + k]


@exchangeable(RATES)
def rates(t, y, y_rate, memory):
    status = solve_dependent_coordinates(t, y, memory)
    if status != OK:
        return status
    solve_dependent_rates(y, memory)
    state, equations, scratch = memory.state, memory.equations, scratch_of(memory.chart)
    assemble_system(t, state.coordinates, state.velocities, equations)
    status = memory.kernels.accelerate(equations.system)
    second_rates(equations.system.acceleration, state)
    order, rank = scratch.column_order, scratch.partition.rank
    free = order.shape[0] - rank
    for i in range(free):
        y_rate[i] = y[free + i]
        y_rate[free + i] = state.coordinate_second[order[rank + i]]
    return status


@exchangeable(ACCEPT)
def accept(t, y, memory):
    status = solve_dependent_coordinates(t, y, memory)
    if status != OK:
        return status
    solve_dependent_rates(y, memory)
    copy_state(memory.state, memory.previous)
    memory.watch.accepted_time = t
    partition = scratch_of(memory.chart).partition
    partition.largest_pivot = max(partition.largest_pivot, partition.pivot)
    if partition.pivot < options_of(memory.chart_options).kept * partition.largest_pivot:
        rank = partition.rank
        replaced = replace_partition(memory)
        if partition.rank < rank:
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
    rank = partition.rank
    copy(scratch.row_order, scratch.last_row_order)
    copy(scratch.column_order, scratch.last_column_order)
    choose_coordinates(memory)
    if partition.rank != rank:
        return True
    factorise_dependent(memory)
    if pivot < BETTER * partition.pivot:
        return True
    copy(scratch.last_row_order, scratch.row_order)
    copy(scratch.last_column_order, scratch.column_order)
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
