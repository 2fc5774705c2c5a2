"""Projection of positions and velocities onto the constraints after every accepted step.

Mass-orthogonal: the correction is the least in the metric of M (Bayo & Ledesma, Nonlinear Dynamics 9,
1996), M^(-1/2) Dᵀ (D Dᵀ)⁻¹ b with the independent rows of D = Φ_q M^(-1/2): positions by Newton's method,
velocities with the same factors.  A pivoted QR of Dᵀ finds the independent rows, and D Dᵀ = Rᵀ R; while
they stay well apart, D Dᵀ is factored directly, which is less work and has the same pivots.
"""

from __future__ import annotations

from numpy import sqrt

from mbref.compiled import exchangeable, kernel
from mbref.evaluation import coordinate_rates, dense_jacobian, evaluate, violation_rate
from mbref.linalg import cholesky_factor, cholesky_solve, gram, times_columns
from mbref.orthogonal import equilibrate, qr_pivoted
from mbref.problem import opened
from mbref.singular import NEAR
from mbref.stabilisation.base import Stabilisation
from mbref.stabilisation.full import copy_state, flush, normalise, rates
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
    ROW_SCALE,
    ROWS,
    SIZES,
    SMALLEST_PIVOT,
    STATE,
    STEP_X,
)
from mbref.vectors import larger

MOST_ITERATIONS = 10
GOOD_REDUCTION = 1e-2  # the same factor serves while each iteration reduces the violation this much
TAU, NORMS, ROW_WORK = 0, 1, 3  # rows of DENSE_VECTORS during a QR; the norms take two
VALUES, CHANGE = 0, 1  # rows of DENSE_VECTORS during a correction


@kernel
def chosen_rows(work, rank):
    """Memory for the chosen rows of D as columns (n, rank), and for the factors of D Dᵀ (rank, rank)."""
    memory, (m, n) = work[DENSE].reshape(-1), work[PHI_Q].shape
    return (
        memory[: n * rank].reshape((n, rank)),
        memory[n * m : n * m + rank * rank].reshape((rank, rank)),
    )


@kernel
def select(d, order, columns):
    """Rows of D (m, n) in the given order as columns (n, rank)."""
    n, rank = columns.shape
    for j in range(n):
        for i in range(rank):
            columns[j, i] = d[order[i], j]


@kernel
def choose(work, pivots, settings, counts):
    """Choose the independent rows of D by a pivoted QR of Dᵀ, and factor D Dᵀ from R; their number."""
    d, vectors = work[PHI_Q], work[DENSE_VECTORS]
    m, n = d.shape
    b, order = work[DENSE].reshape(-1)[: n * m].reshape((n, m)), pivots[CHART_PIVOTS]
    for i in range(m):
        for j in range(n):
            b[j, i] = d[i, j]
    counts[FACTORISATIONS] += 1
    rank = qr_pivoted(
        b, n, m, order, vectors[TAU], vectors[NORMS : NORMS + 2], vectors[ROW_WORK],
        settings[RANK_TOLERANCE],
    )  # fmt: skip
    columns, r = chosen_rows(work, rank)
    for i in range(rank):
        r[i, i] = 1.0 / (b[i, i] * b[i, i])
        for k in range(i + 1, rank):
            r[i, k] = b[i, k] / b[i, i]
    select(d, order, columns)
    pivots[SIZES, 0] = rank
    watch_pivot(1.0 / sqrt(r[rank - 1, rank - 1]) if rank > 0 else 0.0, rank, work)
    return rank


@kernel
def smallest_pivot(columns, r):
    """The factors of D Dᵀ of the chosen rows; the smallest pivot of their QR, 0 where there is none."""
    rank, largest_inverse = r.shape[0], 1.0
    gram(columns, r)
    if rank == 0 or not cholesky_factor(r, rank, 0.0):
        return 0.0
    for i in range(rank):
        largest_inverse = max(largest_inverse, r[i, i])
    return 1.0 / sqrt(largest_inverse)


@kernel
def scaled_jacobian(ints, work):
    """D at the state last evaluated, in place of Φ_q."""
    dense_jacobian(ints, work)
    d = work[PHI_Q]
    equilibrate(d, work[COLUMNS][INVERSE_ROOT], d, work[ROWS][ROW_SCALE])


@kernel
def factor(ints, work, pivots, settings, counts):
    """The factors at the state last evaluated, of the rows chosen before where they serve; their number."""
    scaled_jacobian(ints, work)
    d, memo, rank = work[PHI_Q], work[MEMO][0], pivots[SIZES, 0]
    if rank == 0 or rank != int(memo[GENERIC_RANK]):
        return choose(work, pivots, settings, counts)
    columns, r = chosen_rows(work, rank)
    select(d, pivots[CHART_PIVOTS], columns)
    counts[FACTORISATIONS] += 1
    smallest = smallest_pivot(columns, r)
    if not smallest > NEAR * memo[REFERENCE_PIVOT]:
        return choose(work, pivots, settings, counts)
    watch_pivot(smallest, rank, work)
    return rank


@kernel
def watch_pivot(pivot, rank, work):
    """Keep the largest rank seen, its smallest pivot now, and the largest that pivot has been."""
    memo = work[MEMO][0]
    if rank > memo[GENERIC_RANK]:
        memo[GENERIC_RANK] = rank
        memo[REFERENCE_PIVOT] = 0.0
    memo[SMALLEST_PIVOT] = pivot if rank == int(memo[GENERIC_RANK]) else 0.0
    memo[REFERENCE_PIVOT] = max(memo[REFERENCE_PIVOT], memo[SMALLEST_PIVOT])


@exchangeable(ENTER)
def enter(t, y, problem):
    ints, floats, work, pivots, settings, counts = opened(problem)
    size = copy_state(work[STATE], y)
    nq, nv = work[STATE].shape[1], work[COLUMNS].shape[1]
    evaluate(t, y[:nq], y[nq : nq + nv], ints, floats, work)
    pivots[SIZES, 0] = 0  # no rows are chosen yet
    factor(ints, work, pivots, settings, counts)
    return size


@kernel
def correction(which, rank, work, pivots):
    """The least M-norm change of r and π', or of velocities, that cancels row ``which`` of ROWS."""
    rows, x, order = work[ROWS], work[COLUMNS][STEP_X], pivots[CHART_PIVOTS]
    values = work[DENSE_VECTORS][VALUES][:rank]
    for i in range(rank):
        values[i] = -rows[which, order[i]] * rows[ROW_SCALE, order[i]]
    columns, r = chosen_rows(work, rank)
    least_change(columns, r, work[COLUMNS][INVERSE_ROOT], values, x)


@kernel
def least_change(columns, r, inverse_root, values, x):
    """x = M^(-1/2) Dᵀ (D Dᵀ)⁻¹ values; overwrites ``values`` (rank,)."""
    cholesky_solve(r, r.shape[0], values)
    times_columns(columns, values, x)
    for j in range(x.shape[0]):
        x[j] *= inverse_root[j]


@kernel
def displace(q, x, change):
    """Move coordinates by (δr, δπ') per body: p + ½ Lᵀ δπ', back to unit length."""
    coordinate_rates(q, x, change)
    for k in range(q.shape[0]):
        q[k] += change[k]
    normalise(q)


@kernel
def largest(values):
    """The largest magnitude of a vector; undefined where an entry is."""
    size = 0.0
    for value in values:
        size = larger(size, value)
    return size


@exchangeable(ACCEPT)
def accept(t, y, problem):
    ints, floats, work, pivots, settings, counts = opened(problem)
    nq = work[STATE].shape[1]
    rows, x, change = work[ROWS], work[COLUMNS][STEP_X], work[DENSE_VECTORS][CHANGE]
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
        displace(q, x, change)
        evaluate(t, q, v, ints, floats, work)
        before, violation = violation, largest(rows[PHI])
        if violation > settings[NEWTON_TOLERANCE] and not violation <= GOOD_REDUCTION * before:
            scaled_jacobian(ints, work)  # perhaps a row left out is redundant no longer
            rank = choose(work, pivots, settings, counts)
    if not violation <= 1e3 * settings[NEWTON_TOLERANCE]:
        return NOT_CONVERGED
    violation_rate(ints, work, v)
    correction(PHI_RATE, rank, work, pivots)
    for k in range(x.shape[0]):
        v[k] += x[k]
    flush(y)
    return OK


PROJECTION = Stabilisation("projection", "Bayo & Ledesma 1996", enter, rates, rates, rates, accept)
