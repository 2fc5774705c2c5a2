"""Projection of positions and velocities onto the constraints after every accepted step.

Mass-orthogonal: the correction is the least in the metric of M (Bayo & Ledesma, Nonlinear Dynamics 9,
1996).  Positions by Newton's method with D = Φ_q M^(-1/2), least-norm steps from a pivoted QR of Dᵀ, which
leaves redundant rows out; velocities with the same factors.
"""

from __future__ import annotations

from numpy import cos, sin, sqrt

from mbref.compiled import exchangeable, kernel
from mbref.evaluation import dense_jacobian, evaluate, violation_rate
from mbref.orthogonal import equilibrate, minimum_norm, qr_pivoted
from mbref.stabilisation.base import Stabilisation
from mbref.stabilisation.full import copy_state, normalise, rates
from mbref.tables import (
    ACCEPT,
    CHART_PIVOTS,
    COLUMNS,
    DENSE,
    DENSE_VECTORS,
    ENTER,
    FACTORISATIONS,
    GENERIC_RANK,
    INVERSE_ROOT,
    MEMO,
    NEWTON,
    NEWTON_TOLERANCE,
    NOT_CONVERGED,
    OK,
    PHI,
    PHI_Q,
    PHI_RATE,
    RANK_TOLERANCE,
    REFERENCE_PIVOT,
    RHS,
    ROW_SCALE,
    ROWS,
    SMALLEST_PIVOT,
    STATE,
    STEP_X,
)

MOST_ITERATIONS = 10
GOOD_REDUCTION = 1e-2  # the same factors serve while each iteration reduces the violation this much
TAU, NORMS, ROW_WORK = 0, 1, 3  # rows of DENSE_VECTORS; the norms take two


@kernel
def factor(ints, work, pivots, settings, counts):
    """Pivoted QR of Dᵀ at the state last evaluated; the rank."""
    dense_jacobian(ints, work)
    jacobian, rows = work[PHI_Q], work[ROWS]
    m, n = jacobian.shape
    equilibrate(jacobian, work[COLUMNS][INVERSE_ROOT], jacobian, rows[ROW_SCALE])
    b, vectors = work[DENSE], work[DENSE_VECTORS]
    for i in range(m):
        for j in range(n):
            b[j, i] = jacobian[i, j]
    counts[FACTORISATIONS] += 1
    rank = qr_pivoted(
        b, n, m, pivots[CHART_PIVOTS], vectors[TAU], vectors[NORMS : NORMS + 2], vectors[ROW_WORK],
        settings[RANK_TOLERANCE],
    )  # fmt: skip
    watch_pivot(rank, work)
    return rank


@kernel
def watch_pivot(rank, work):
    """Keep the largest rank seen, its last pivot now, and the largest that pivot has been."""
    memo = work[MEMO][0]
    if rank > memo[GENERIC_RANK]:
        memo[GENERIC_RANK] = rank
        memo[REFERENCE_PIVOT] = 0.0
    generic = int(memo[GENERIC_RANK])
    memo[SMALLEST_PIVOT] = abs(work[DENSE][generic - 1, generic - 1]) if 0 < generic == rank else 0.0
    memo[REFERENCE_PIVOT] = max(memo[REFERENCE_PIVOT], memo[SMALLEST_PIVOT])


@exchangeable(ENTER)
def enter(t, y, ints, floats, work, pivots, settings, counts):
    size = copy_state(work[STATE], y)
    nq, nv = work[STATE].shape[1], work[COLUMNS].shape[1]
    evaluate(t, y[:nq], y[nq : nq + nv], ints, floats, work)
    factor(ints, work, pivots, settings, counts)
    return size


@kernel
def correction(which, rank, work, pivots):
    """The least M-norm change of r and π', or of velocities, that cancels row ``which`` of ROWS."""
    rows, x, inverse_root = work[ROWS], work[COLUMNS][STEP_X], work[COLUMNS][INVERSE_ROOT]
    for i in range(rows.shape[1]):
        rows[RHS, i] = -rows[which, i] * rows[ROW_SCALE, i]
    n = x.shape[0]
    minimum_norm(work[DENSE], n, rank, pivots[CHART_PIVOTS], work[DENSE_VECTORS][TAU], rows[RHS], x)
    for j in range(n):
        x[j] *= inverse_root[j]


@kernel
def displace(q, x):
    """Move coordinates by (δr, δπ') per body: p becomes p times the rotation of vector δπ'."""
    for b in range(q.shape[0] // 7):
        i, j = 7 * b, 6 * b
        for k in range(3):
            q[i + k] += x[j + k]
        a, b_, c = x[j + 3], x[j + 4], x[j + 5]
        angle = sqrt(a * a + b_ * b_ + c * c)
        s = 0.5 if angle < 1e-6 else sin(0.5 * angle) / angle
        e0, e1, e2, e3 = cos(0.5 * angle), s * a, s * b_, s * c
        w, x_, y, z = q[i + 3], q[i + 4], q[i + 5], q[i + 6]
        q[i + 3] = w * e0 - x_ * e1 - y * e2 - z * e3
        q[i + 4] = w * e1 + x_ * e0 + y * e3 - z * e2
        q[i + 5] = w * e2 - x_ * e3 + y * e0 + z * e1
        q[i + 6] = w * e3 + x_ * e2 - y * e1 + z * e0
    normalise(q)


@kernel
def largest(values):
    """The largest magnitude of a vector."""
    size = 0.0
    for value in values:
        if not abs(value) <= size:
            size = abs(value)
    return size


@exchangeable(ACCEPT)
def accept(t, y, ints, floats, work, pivots, settings, counts):
    nq = work[STATE].shape[1]
    rows, x = work[ROWS], work[COLUMNS][STEP_X]
    q, v = y[:nq], y[nq : nq + x.shape[0]]
    normalise(q)
    evaluate(t, q, v, ints, floats, work)
    violation = largest(rows[PHI])
    rank = factor(ints, work, pivots, settings, counts)
    for _ in range(MOST_ITERATIONS):
        if violation <= settings[NEWTON_TOLERANCE]:
            break
        counts[NEWTON] += 1
        correction(PHI, rank, work, pivots)
        displace(q, x)
        evaluate(t, q, v, ints, floats, work)
        before, violation = violation, largest(rows[PHI])
        if violation > settings[NEWTON_TOLERANCE] and not violation <= GOOD_REDUCTION * before:
            rank = factor(ints, work, pivots, settings, counts)
    if not violation <= 1e3 * settings[NEWTON_TOLERANCE]:
        return NOT_CONVERGED
    violation_rate(ints, work, v)
    correction(PHI_RATE, rank, work, pivots)
    for k in range(x.shape[0]):
        v[k] += x[k]
    return OK


PROJECTION = Stabilisation("projection", "Bayo & Ledesma 1996", enter, rates, accept)
