"""The chart of all coordinates with accelerations and projection from one sparse factor of S + I/α.

The iteration is that of ALF-dual, for accelerations as for corrections: positions by Newton's method and
velocities in one go, each change the least in the metric of M, which redundant rows do not disturb.
Near a singular position the last of as many pivots as there are independent rows, in order of size, falls
with the distance, so that ``singular`` can step over it.  A redundant row has a pivot of α^(-1/2); where two
rows exchange their roles, the larger of their pivots is still about α^(-1/4).
"""

from __future__ import annotations

from dataclasses import replace

from numpy import sqrt

from mbref.compiled import exchangeable, kernel
from mbref.evaluation import evaluate, right_hand_side, violation_rate
from mbref.problem import opened, planned
from mbref.sparse.factor import (
    assemble,
    factorise,
    memories,
    part,
    solve,
    sorted_pivots,
    subtract_product,
    times_transpose,
)
from mbref.sparse.plan import COLUMN, ROW
from mbref.stabilisation.base import Stabilisation
from mbref.stabilisation.baumgarte import BAUMGARTE
from mbref.stabilisation.full import copy_state, flush, write_rates
from mbref.stabilisation.none import NONE
from mbref.stabilisation.projection import GOOD_REDUCTION, MOST_ITERATIONS, PROJECTION, displace, largest
from mbref.tables import (
    ACCELERATION,
    ACCEPT,
    COLUMNS,
    DENSE_VECTORS,
    ENTER,
    EVALUATIONS,
    FACTORISATIONS,
    FORCE,
    FORMULATION_OPTIONS,
    GENERIC_RANK,
    INVERSE_ROOT,
    JACOBIAN,
    MASS,
    MEMO,
    MULTIPLIERS,
    NEWTON,
    NEWTON_TOLERANCE,
    NOT_CONVERGED,
    OK,
    PHI,
    PHI_RATE,
    RATES,
    REFERENCE_PIVOT,
    RHS,
    ROWS,
    SCRATCH,
    SINGULAR,
    SMALLEST_PIVOT,
    STATE,
    STEP_X,
)

INDEPENDENT = 5.0  # times α^(-1/4): the pivot from which on a row counts as independent


@kernel
def factor(plan, work, settings, counts):
    """L at the state last evaluated; whether it could be had."""
    memory, inverse_root = work[SCRATCH][0], work[COLUMNS][INVERSE_ROOT]
    d, l, diagonal, _, _, _, _, root, _ = memories(plan, memory)
    counts[FACTORISATIONS] += 1
    assemble(plan, work[JACOBIAN], inverse_root, settings[FORMULATION_OPTIONS], d, l, diagonal, root)
    return factorise(plan, l)


@kernel
def watch_pivots(plan, work, settings):
    """Keep the largest rank seen, the smallest of so many pivots now, and the largest that has been."""
    memo = work[MEMO][0]
    _, l, diagonal, pivots, _, _, _, _, _ = memories(plan, work[SCRATCH][0])
    sorted_pivots(plan, l, diagonal, pivots)
    independent, rank = INDEPENDENT * settings[FORMULATION_OPTIONS] ** -0.25, 0
    for k in range(pivots.shape[0]):
        if pivots[k] > independent:
            rank += 1
    if rank > memo[GENERIC_RANK]:
        memo[GENERIC_RANK] = rank
        memo[REFERENCE_PIVOT] = 0.0
    generic = int(memo[GENERIC_RANK])
    memo[SMALLEST_PIVOT] = pivots[pivots.shape[0] - generic] if generic > 0 else 0.0
    memo[REFERENCE_PIVOT] = max(memo[REFERENCE_PIVOT], memo[SMALLEST_PIVOT])


@kernel
def settle(plan, work, settings, target, multipliers):
    """Change ``target`` (n,) by the least in the metric of M that makes Φ_q target grow by b of the memory.

    ``multipliers`` (m,) become the sums of -Δλ in the rows that move.  Returns OK or NOT_CONVERGED.
    """
    d, l, _, _, b, step, total, root, x = memories(plan, work[SCRATCH][0])
    row, epsilon = part(plan, ROW), settings[FORMULATION_OPTIONS + 1]
    total[:] = 0.0
    status, change = NOT_CONVERGED, 0.0
    for _ in range(int(settings[FORMULATION_OPTIONS + 2])):
        step[:] = b
        solve(plan, l, step)
        times_transpose(plan, d, step, x)
        last, change = change, add_scaled(plan, root, x, target)
        for i in range(row.shape[0]):
            total[i] -= step[i]
        if change <= epsilon or (last > 0.0 and change * change <= epsilon * last):
            status = OK
            break
        subtract_product(plan, d, x, b)
    for i in range(row.shape[0]):
        multipliers[row[i]] = total[i]
    return status


@kernel
def add_scaled(plan, root, x, target):
    """target (n,) += root x; the norm of that, relative to the larger of 1 and the norm of the target."""
    column, change, size = part(plan, COLUMN), 0.0, 0.0
    for j in range(x.shape[0]):
        step, k = root[j] * x[j], column[j]
        value = target[k] + step
        target[k] = value
        change += step * step
        size += value * value
    return sqrt(change / max(1.0, size))


@kernel
def accelerations(plan, work, settings, counts):
    """Accelerations and multipliers by ALF-dual at the state last evaluated; their status."""
    rows, columns, column, row = work[ROWS], work[COLUMNS], part(plan, COLUMN), part(plan, ROW)
    mass, force, acceleration = columns[MASS], columns[FORCE], columns[ACCELERATION]
    if not factor(plan, work, settings, counts):
        return SINGULAR
    d, _, _, _, b, _, _, root, x = memories(plan, work[SCRATCH][0])
    for j in range(column.shape[0]):
        k = column[j]
        if not mass[k] > 0.0:
            return SINGULAR
        x[j] = root[j] * force[k]
        acceleration[k] = root[j] * x[j]
    for i in range(row.shape[0]):
        b[i] = rows[RHS, row[i]]
    subtract_product(plan, d, x, b)
    return settle(plan, work, settings, acceleration, rows[MULTIPLIERS])


@exchangeable(RATES)
def rates(accelerate, t, y, y_rate, problem):
    ints, floats, work, _pivots, settings, counts = opened(problem)
    nq, nv = work[STATE].shape[1], work[COLUMNS].shape[1]
    q, v = y[:nq], y[nq : nq + nv]
    counts[EVALUATIONS] += 1
    evaluate(t, q, v, ints, floats, work)
    right_hand_side(v, ints, work, settings)
    status = accelerations(planned(problem), work, settings, counts)
    write_rates(q, v, y_rate, work)
    return status


@exchangeable(ENTER)
def enter(t, y, problem):
    ints, floats, work, _pivots, settings, counts = opened(problem)
    size = copy_state(work[STATE], y)
    nq = work[STATE].shape[1]
    evaluate(t, y[:nq], y[nq:size], ints, floats, work)
    if factor(planned(problem), work, settings, counts):
        watch_pivots(planned(problem), work, settings)
    return size


@exchangeable(ACCEPT)
def accept(t, y, problem):
    ints, floats, work, _pivots, settings, counts = opened(problem)
    plan, nq = planned(problem), work[STATE].shape[1]
    x = work[COLUMNS][STEP_X]
    q, v = y[:nq], y[nq : nq + x.shape[0]]
    status = project_positions(t, q, v, plan, ints, floats, work, settings, counts)
    if status != OK:
        return status
    watch_pivots(plan, work, settings)
    violation_rate(ints, work, v)
    status = cancel(PHI_RATE, plan, work, settings, v)
    flush(y)
    return status


@kernel
def cancel(which, plan, work, settings, target):
    """Change ``target`` by the least that takes row ``which`` of ROWS away; OK or NOT_CONVERGED."""
    rows, row = work[ROWS], part(plan, ROW)
    _, _, _, _, b, _, _, _, _ = memories(plan, work[SCRATCH][0])
    for i in range(row.shape[0]):
        b[i] = -rows[which, row[i]]
    return settle(plan, work, settings, target, rows[RHS])


@kernel
def project_positions(t, q, v, plan, ints, floats, work, settings, counts):
    """Newton's method for Φ(q, t) = 0; leaves a factor that serves at q, and its status."""
    rows, x, change = work[ROWS], work[COLUMNS][STEP_X], work[DENSE_VECTORS][0]
    tolerance = settings[NEWTON_TOLERANCE]
    x[:] = 0.0
    displace(q, x, change)
    evaluate(t, q, v, ints, floats, work)
    if not factor(plan, work, settings, counts):
        return SINGULAR
    violation = largest(rows[PHI])
    for _ in range(MOST_ITERATIONS):
        if violation <= tolerance:
            break
        counts[NEWTON] += 1
        x[:] = 0.0
        cancel(PHI, plan, work, settings, x)
        displace(q, x, change)
        evaluate(t, q, v, ints, floats, work)
        before, violation = violation, largest(rows[PHI])
        if violation > tolerance and not violation <= GOOD_REDUCTION * before:
            if violation <= 1e3 * tolerance and not violation < before:
                break  # what is left is rounding
            if not factor(plan, work, settings, counts):
                return SINGULAR
    return OK if violation <= 1e3 * tolerance else NOT_CONVERGED


CHARTS: dict[str, Stabilisation] = {
    "none": replace(NONE, rates=rates, observe=rates, careful=rates),
    "baumgarte": replace(BAUMGARTE, rates=rates, observe=rates, careful=rates),
    "projection": replace(PROJECTION, enter=enter, rates=rates, observe=rates, careful=rates, accept=accept),
}
