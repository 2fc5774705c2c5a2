"""Projection of positions and velocities onto the constraints after every accepted step.

Mass-orthogonal: the correction is the least in the metric of M (Bayo & Ledesma, Nonlinear Dynamics 9,
1996): positions by Newton's method, velocities with the same factor.  Only coordinates that can move are
integrated (``sparse.moving``, ``sparse.held``).  Near a singular position the last of as many pivots as there
are independent rows, in order of size, falls with the distance, so that ``singular`` can step over it.  A
redundant row has a pivot of α^(-1/2); where two rows exchange their roles, the larger of their pivots is
still about α^(-1/4).
"""

from __future__ import annotations

from numpy import sqrt

from mbref.equations.evaluation import contract, coordinate_rates, evaluate, expand, violation_rate
from mbref.formulations.augmented_lagrangian import correct, factor
from mbref.kernels.arguments import opened, planned
from mbref.kernels.compilation import exchangeable, inlined
from mbref.kernels.layout import (
    ACCEPT,
    COLUMNS,
    COORDINATES,
    DENSE_VECTORS,
    ENTER,
    GENERIC_RANK,
    LIVE,
    MEMO,
    MOVING,
    NEWTON,
    NEWTON_TOLERANCE,
    NOT_CONVERGED,
    OK,
    PHI,
    PHI_RATE,
    REFERENCE_PIVOT,
    ROWS,
    SCRATCH,
    SINGULAR,
    SMALLEST_PIVOT,
    STATE,
    STEP_X,
    TURNING,
    VELOCITIES,
)
from mbref.linear_algebra.sparse_cholesky import memories, part, squared_pivots
from mbref.linear_algebra.symbolic_factorisation import ROW
from mbref.linear_algebra.vectors import larger, sort
from mbref.stabilisation.all_coordinates import flush, normalise, rates
from mbref.stabilisation.base import Stabilisation

ALPHA = 1e10  # of the iteration
REPEATED, ALONE = 1, 2  # iterations of a correction that Newton's method repeats, and of one made once
INDEPENDENT = (5.0 * ALPHA**-0.25) ** 2  # the squared pivot from which on a row counts as independent
MOST_ITERATIONS = 10
ROUNDING = 1e3  # tolerances: what is left where iterations no longer reduce it
SMALL, GOOD_REDUCTION = 1e-8, 1e-2  # a factor is kept while violations are so small and shrink so fast
LARGEST_TURN = 2.5  # rad: less than half a turn, after which the next singular position may come
CHANGE = 0  # row of DENSE_VECTORS


@exchangeable(ENTER)
def enter(t, y, problem):
    """The entries that move, from ``work[STATE]`` into y; their number."""
    ints, floats, work, _pivots, _settings, counts = opened(problem)
    plan, live, state = planned(problem), ints[LIVE], work[STATE]
    q, v = state[COORDINATES], state[VELOCITIES][: work[COLUMNS].shape[1]]
    evaluate(t, q, v, ints, floats, work)
    if factor(plan, work, ALPHA, counts):
        watch_pivots(plan, work)
    contract(q, v, live, y)
    return live[0, MOVING] + live[0, TURNING]


@inlined
def watch_pivots(plan, work):
    """Watch the pivots of the last factor."""
    _, l, diagonal, squares, _, _, _, _, _ = memories(plan, work[SCRATCH][0])
    squared_pivots(plan, l, diagonal, squares)
    watch(squares, work[MEMO][0])


@inlined
def watch(squares, memo):
    """Keep the largest rank seen, the smallest of so many pivots now, and the largest that has been."""
    rank, smallest = 0, 1.0
    for square in squares:
        if square > INDEPENDENT:
            rank += 1
            smallest = min(smallest, square)
    if rank > memo[GENERIC_RANK]:
        memo[GENERIC_RANK] = rank
        memo[REFERENCE_PIVOT] = 0.0
    generic = int(memo[GENERIC_RANK])
    if rank < generic:
        sort(squares)
        smallest = squares[squares.shape[0] - generic]
    memo[SMALLEST_PIVOT] = sqrt(smallest) if generic > 0 else 0.0
    memo[REFERENCE_PIVOT] = max(memo[REFERENCE_PIVOT], memo[SMALLEST_PIVOT])


@inlined
def displace(q, x, change):
    """Move coordinates by (δr, δπ') per body: p + ½ Lᵀ δπ', back to unit length."""
    coordinate_rates(q, x, change)
    for k in range(q.shape[0]):
        q[k] += change[k]
    normalise(q)


@inlined
def largest(values):
    """The largest magnitude of a vector; undefined where an entry is."""
    size = 0.0
    for value in values:
        size = larger(size, value)
    return size


@inlined
def cancel(which, iterations, plan, work, target):
    """Change ``target`` by the least that takes row ``which`` of ROWS away."""
    rows, row = work[ROWS], part(plan, ROW)
    _, _, _, _, b, _, _, _, _ = memories(plan, work[SCRATCH][0])
    for i in range(row.shape[0]):
        b[i] = -rows[which, row[i]]
    correct(plan, work, iterations, target)


@inlined
def project_positions(t, q, v, plan, ints, floats, work, settings, counts):
    """Newton's method for Φ(q, t) = 0; leaves a factor that serves at q, and its status."""
    rows, x, change = work[ROWS], work[COLUMNS][STEP_X], work[DENSE_VECTORS][CHANGE]
    tolerance = settings[NEWTON_TOLERANCE]
    evaluate(t, q, v, ints, floats, work)  # which does not depend on the length of Euler parameters
    normalise(q)
    if not factor(plan, work, ALPHA, counts):
        return SINGULAR
    violation = largest(rows[PHI])
    for _ in range(MOST_ITERATIONS):
        counts[NEWTON] += 1
        x[:] = 0.0
        cancel(PHI, REPEATED, plan, work, x)
        displace(q, x, change)
        if violation <= tolerance:
            return OK
        evaluate(t, q, v, ints, floats, work)
        before, violation = violation, largest(rows[PHI])
        if before > SMALL or (violation > tolerance and not violation <= GOOD_REDUCTION * before):
            if violation <= ROUNDING * tolerance and not violation < before:
                return OK  # what is left is rounding
            if not factor(plan, work, ALPHA, counts):
                return SINGULAR
    return OK if violation <= ROUNDING * tolerance else NOT_CONVERGED


@inlined
def project(t, y, problem):
    """Project y; OK, SINGULAR or NOT_CONVERGED."""
    ints, floats, work, _pivots, settings, counts = opened(problem)
    plan, live, state = planned(problem), ints[LIVE], work[STATE]
    expand(y, live, state)
    q, v = state[COORDINATES], state[VELOCITIES][: work[COLUMNS].shape[1]]
    status = project_positions(t, q, v, plan, ints, floats, work, settings, counts)
    if status != OK:
        return status
    watch_pivots(plan, work)
    violation_rate(ints, work, v)
    cancel(PHI_RATE, ALONE, plan, work, v)
    contract(q, v, live, y)
    flush(y)
    return OK


@exchangeable(ACCEPT)
def accept(t, y, problem):
    return project(t, y, problem)


PROJECTION = Stabilisation(
    "projection", "Bayo & Ledesma 1996", enter, rates, rates, rates, accept, largest_turn=LARGEST_TURN
)
