"""Projection of positions and velocities onto the constraints after every accepted step.

The projection is mass-orthogonal: the correction is the least in the metric of M (Bayo & Ledesma, Nonlinear
Dynamics 9, 1996). Positions are corrected by Newton's method, velocities with the factor of the last Newton
step.  Rows between velocities alone, as of a wheel that does not slip, are left out where positions are
corrected; a further factor then includes them.  Only active coordinates are integrated
(``equations.active_coordinates``).  Near a singular position the pivots are sorted by size, largest first.
With r independent rows, the r-th pivot falls with the distance from the singular position;
``stepping.watch`` monitors this pivot.  A redundant row has a pivot of α^(-1/2); where two rows exchange
their roles, the larger of their pivots is still about α^(-1/4).
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from numpy import inf, sqrt

from mbref.equations.coordinates import contract, displace, expand, normalise
from mbref.equations.evaluation import assemble_system, evaluate, violation_rate
from mbref.kernels.compilation import exchangeable, inlined, kernel
from mbref.kernels.layout import ACCEPT, ENTER, LINK, NOT_CONVERGED, OK, RATES, SINGULAR
from mbref.kernels.named_memory import Matrix, Vector, opener
from mbref.linear_algebra.minimum_norm import ALPHA, LEAST_ITERATIONS, solve_fixed_iterations
from mbref.linear_algebra.sparse_cholesky import find_squared_pivots, of_row, regularised_factor
from mbref.linear_algebra.vectors import copy, flush_denormals, largest, sort
from mbref.stabilisation.all_coordinates import rates as rates_of_all_rows
from mbref.stabilisation.all_coordinates import write_rates
from mbref.stabilisation.base import Stabilisation

INDEPENDENT = (5.0 * ALPHA**-0.25) ** 2  # squared pivot above which a row counts as independent
DEPENDENT = 3e-3  # pivot below which a row clearly depends on other rows
CLEAR = 0.05  # pivot above which a row is clearly independent
LEAST_REFERENCE = 0.05  # least value with which the smallest pivot is compared
MOST_CORRECTIONS = 10  # largest number of Newton steps of a correction
# violation, and its reduction by a step, below which the factor is used again
SMALL, GOOD_REDUCTION = 1e-8, 1e-2
BENT = 1e-6  # last correction / distance from a singular position, below which the factor is used again
MOVED = 30.0  # last correction in roundings, above which rows and factor are computed again
# rad; so that two bodies turn by less than a right angle, at which gradients would be opposite
LARGEST_TURN = 0.75
# squared pivot × tolerance of a step above which accelerations are solved for once: their rounding, about
# 1e-15 over the squared pivot, is then a thousandth of the tolerance
ROUNDED = 1e-12
FACTOR_FAILED = -1.0  # returned by a Newton step instead of the violation


class Scratch(NamedTuple):
    """Corrections of positions: (δr, δπ') for each body and the change of coordinates; blocks of rows that
    are left out."""

    correction: Annotated[Vector, "n"]
    change: Annotated[Vector, "7*nb"]
    blocks: Annotated[Matrix, "m", "width"]


scratch_of = opener(Scratch)


@exchangeable(ENTER)
def enter(t, y, memory):
    """Copy the active entries of ``memory.state`` into y, and monitor the pivots; return the number of
    entries."""
    state, active = memory.state, memory.active
    evaluate(t, state.coordinates, state.velocities, memory.equations)
    if factorise_constraints(memory):
        watch_pivots(memory)
        memory.watch.past_pivot = memory.watch.smallest_pivot
        keep_end(memory)
    contract(state.coordinates, state.velocities, active, y)
    return active.coordinates.shape[0] + active.velocities.shape[0]


@inlined
def factorise_constraints(memory):
    """Factorise S + I/α at the state of the last evaluation; return False if no factor exists."""
    equations, system = memory.equations, memory.equations.system
    system.counts.factorisations += 1
    return regularised_factor(memory.factor, system.blocks.reshape(-1), equations.scene.metric_root, ALPHA)


@kernel
def factorise_positions(memory):
    """Factorise S + I/α without rows between velocities alone, which do not restrict positions; return False
    if no factor exists."""
    velocity_rows, blocks = memory.equations.scene.velocity_rows, memory.equations.system.blocks
    if velocity_rows.shape[0] == 0:
        return factorise_constraints(memory)
    kept = scratch_of(memory.chart).blocks
    for row in velocity_rows:
        copy(blocks[row], kept[row])
        blocks[row] = 0.0
    positive = factorise_constraints(memory)
    for row in velocity_rows:
        copy(kept[row], blocks[row])
    return positive


@kernel
def keep_end(memory):
    """Save the gradient and the pivots of the last factor, for the start of the next step."""
    ends = memory.loop.ends
    copy(memory.factor.d, ends.gradient)
    for k in range(ends.squared_pivots.shape[0]):
        ends.squared_pivots[k] = memory.pivots[k] ** 2


@inlined
def watch_pivots(memory):
    """Record the pivots of the last factor."""
    find_squared_pivots(memory.factor)
    watch(memory.factor.squared_pivots, memory.pivots, memory.watch)


@inlined
def watch(squares, pivots, record):
    """Record the pivots, the largest rank so far, the smallest pivot of independent rows, and its largest
    value so far."""
    rank, smallest = 0, 1.0
    for k in range(squares.shape[0]):
        square = squares[k]
        pivots[k] = sqrt(square)
        if square > INDEPENDENT:
            rank += 1
            smallest = min(smallest, square)
    if rank > record.generic_rank:
        record.generic_rank = rank
        record.reference_pivot = 0.0
    generic = record.generic_rank
    if rank < generic:
        sort(squares)
        smallest = squares[squares.shape[0] - generic]
    record.smallest_pivot = sqrt(smallest) if generic > 0 else 0.0
    record.reference_pivot = max(record.reference_pivot, record.smallest_pivot, LEAST_REFERENCE)


@inlined
def remove_violation(violation, iterations, factor, target):
    """Change ``target`` (n,) by the least change that removes the violation (m,) of every row."""
    row = factor.symbolic.row
    for i in range(row.shape[0]):
        factor.residual[i] = -of_row(violation, row[i])
    solve_fixed_iterations(factor, iterations, target)


@kernel
def newton_step(t, before, memory):
    """Make one step of Newton's method for Φ(q, t) = 0 in ``memory.state``; return the largest |Φ| before the
    step.

    The last factor is used again while the violation ``before`` was small and decreases well. Positions whose
    violation is rounding are not changed, so that the evaluated rows belong to the positions.
    """
    state, equations, scratch = memory.state, memory.equations, scratch_of(memory.chart)
    evaluate(t, state.coordinates, state.velocities, equations)
    violation, settings = largest(equations.rows.phi), equations.system.settings
    stale = before > SMALL or (violation > settings.newton_tolerance and violation > GOOD_REDUCTION * before)
    stale = stale or largest(scratch.correction) ** 2 > BENT * before
    if stale and not factorise_positions(memory):
        return FACTOR_FAILED
    scratch.correction[:] = 0.0
    if not violation <= settings.rounding:
        correct_positions(memory)
    return violation


@inlined
def correct_positions(memory):
    """Remove Φ by changing the coordinates in ``memory.state``, with the last factor."""
    scratch = scratch_of(memory.chart)
    remove_violation(memory.equations.rows.phi, 1, memory.factor, scratch.correction)
    displace(memory.state.coordinates, scratch.correction, scratch.change)


@kernel
def project_positions(t, memory):
    """Repeat Newton steps until the violation is rounding.

    Return OK, SINGULAR if no factor exists, or NOT_CONVERGED.
    """
    system, before = memory.equations.system, inf
    tolerance, stuck = system.settings.newton_tolerance, system.settings.stuck
    for _ in range(MOST_CORRECTIONS):
        system.counts.newton += 1
        violation = newton_step(t, before, memory)
        if violation < 0.0:
            return SINGULAR
        if violation <= tolerance or before <= violation <= stuck:
            return OK
        before = violation
    return OK if before <= stuck else NOT_CONVERGED


@exchangeable(ACCEPT)
def accept(t, y, memory):
    state = memory.state
    expand(y, memory.active, state)
    normalise(state.coordinates)
    status = project_positions(t, memory)
    if status != OK or not follow_last_correction(t, memory):
        return SINGULAR if status == OK else status
    watch_pivots(memory)
    project_velocities(memory)
    contract(state.coordinates, state.velocities, memory.active, y)
    flush_denormals(y)
    return OK


@kernel
def follow_last_correction(t, memory):
    """Compute rows and factor again if the last correction moved positions by more than rounding.

    This happens if the violation is rounding, but a light body next to a heavy body moves much farther than
    rounding. With rows between velocities alone, the factor is of all rows now. Return False if no factor
    exists.
    """
    equations, state = memory.equations, memory.state
    moved = largest(scratch_of(memory.chart).correction) > MOVED * equations.system.settings.rounding
    if not moved and equations.scene.velocity_rows.shape[0] == 0:
        return True
    evaluate(t, state.coordinates, state.velocities, equations)
    return factorise_constraints(memory)


@inlined
def project_velocities(memory):
    """Remove Φ' = Φ_q v - ν by the least change of v, with the last factor."""
    velocities, equations = memory.state.velocities, memory.equations
    violation_rate(velocities, equations)
    remove_violation(equations.rows.phi_rate, LEAST_ITERATIONS, memory.factor, velocities)


@exchangeable(RATES)
def rates(t, y, y_rate, memory):
    """Compute y' by the rows that were independent at the start of the step.

    Rows depend on other rows only if the constraints are satisfied. A stage of a step violates them slightly.
    At such a stage a dependent row contradicts the other rows, so the dependent row is left out.
    """
    state, equations = memory.state, memory.equations
    expand(y, memory.active, state)
    assemble_system(t, state.coordinates, state.velocities, equations)
    settings, some = equations.system.settings, depend_on_others(memory)
    independent, clear = settings.independent, settings.clear_pivot
    settings.clear_pivot = min(clear, pivot_by_tolerance(memory))
    if some:
        leave_out_dependent_rows(memory)
        settings.independent = 1
    status = memory.kernels.accelerate(equations.system)
    if some:
        put_back_dependent_rows(memory)
        settings.independent = independent
    settings.clear_pivot = clear
    write_rates(y_rate, memory)
    return status


@inlined
def pivot_by_tolerance(memory):
    """Return the squared pivot above which rounding of accelerations is far below the tolerance of a step; 1
    if steps have a fixed length instead of a tolerance."""
    control = memory.control
    if control.fixed_step > 0.0:
        return 1.0
    tolerance = memory.loop.clock.share * min(control.rtol, control.atol)
    return ROUNDED / max(tolerance, ROUNDED)


@kernel
def depend_on_others(memory):
    """Return whether as many rows as at any state before clearly depended on other rows at the last projected
    state.

    Near a singular position more rows seem dependent. For a motion that may have started at a singular
    position, the number is unknown.
    """
    pivots, watched, independent = memory.pivots, memory.watch, 0
    if not watched.regular:
        return False
    for k in range(pivots.shape[0]):
        if pivots[k] > DEPENDENT:
            independent += 1
            if pivots[k] < CLEAR:
                return False
    return independent < pivots.shape[0] and independent == watched.generic_rank


@kernel
def leave_out_dependent_rows(memory):
    """Set dependent rows to zero, and save their blocks."""
    pivots, row, system = memory.pivots, memory.factor.symbolic.row, memory.equations.system
    kept = scratch_of(memory.chart).blocks
    for k in range(pivots.shape[0]):
        if not pivots[k] > DEPENDENT and row[k] != LINK:
            i = row[k]
            copy(system.blocks[i], kept[i])
            system.blocks[i], system.rhs[i] = 0.0, 0.0
            if system.jacobian.shape[0] > 0:
                system.jacobian[i] = 0.0


@kernel
def put_back_dependent_rows(memory):
    """Restore the blocks of dropped rows; an evaluation writes the blocks that change."""
    pivots, row, system = memory.pivots, memory.factor.symbolic.row, memory.equations.system
    kept = scratch_of(memory.chart).blocks
    for k in range(pivots.shape[0]):
        if not pivots[k] > DEPENDENT and row[k] != LINK:
            copy(kept[row[k]], system.blocks[row[k]])


PROJECTION = Stabilisation(
    "projection", enter, rates, rates_of_all_rows, accept, memory=Scratch,
    projects=True, watches_rank=True, largest_turn=LARGEST_TURN,
)  # fmt: skip
