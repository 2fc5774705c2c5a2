"""Coordinate partitioning: only independent coordinates and their rates are integrated (section 3.2).

Among (r, p) of every body, with the rows Φ and pᵀp - 1, Gaussian elimination with full pivoting finds
the redundant rows and the independent coordinates v (Eqs. 10 and 11).  At every evaluation the dependent
coordinates u follow from Φ(u, v, t) = 0 by Newton–Raphson (Eq. 15), started by u + h u' + ½ h² u'' of the
last accepted step (Eq. 16), and their rates from Φ_u u' = ν - Φ_v v' (Eq. 14).  Φ_p = 2 Φ_π' L.

The partition is kept while the smallest pivot of Φ_u relative to its largest stays above ``kept`` times what
it was when the partition was chosen; then it is chosen anew, and the integrator starts again.  Of 0.1
partitions last near turning points of a coordinate: errors 10 to 1000 times those of 0.6.
"""

from __future__ import annotations

from mbref.equations.evaluation import accelerations, coordinate_rates, evaluate
from mbref.kernels.arguments import opened
from mbref.kernels.compilation import exchangeable, kernel
from mbref.kernels.layout import (
    ACCELERATION,
    ACCEPT,
    CHANGED,
    CHART_PIVOTS,
    COLUMN_ORDER,
    COLUMNS,
    COORDINATE_RATES,
    COORDINATE_SECOND,
    COORDINATES,
    DENSE,
    DENSE_VECTORS,
    ENTER,
    FACTORISATIONS,
    JACOBIAN,
    KEPT_PARTITION,
    LAST,
    LAST_TIME,
    MEMO,
    NEWTON,
    NEWTON_TOLERANCE,
    NOT_CONVERGED,
    NU,
    OK,
    PHI,
    RANK_TOLERANCE,
    RATES,
    REFERENCE_PIVOT,
    ROW_BODIES,
    ROW_ORDER,
    ROWS,
    SIZES,
    SMALLEST_PIVOT,
    STATE,
    VELOCITIES,
)
from mbref.linear_algebra.elimination import full_pivot, lu_factor, lu_solve
from mbref.linear_algebra.vectors import copy_rows
from mbref.stabilisation.base import Stabilisation

MOST_ITERATIONS = 20
OPTIONS = {"kept": 0.6}
SINGULAR_PIVOT = 1e-13


@kernel
def matrix(q, ints, work, a):
    """[Φ_r Φ_p; 0 2pᵀ] at the state last evaluated into a[: m + nb, : 7 nb]."""
    bodies, jacobian = ints[ROW_BODIES], work[JACOBIAN]
    m, nq = bodies.shape[0], q.shape[0]
    a[: m + nq // 7, :nq] = 0.0
    for row in range(m):
        for side in range(2):
            b = bodies[row, side]
            if 7 * b < nq:
                i, j = 7 * b, 6 * side
                for k in range(3):
                    a[row, i + k] = jacobian[row, j + k]
                r1, r2, r3 = 2 * jacobian[row, j + 3], 2 * jacobian[row, j + 4], 2 * jacobian[row, j + 5]
                w, x, y, z = q[i + 3], q[i + 4], q[i + 5], q[i + 6]
                a[row, i + 3] = -x * r1 - y * r2 - z * r3
                a[row, i + 4] = w * r1 - z * r2 + y * r3
                a[row, i + 5] = z * r1 + w * r2 - x * r3
                a[row, i + 6] = -y * r1 + x * r2 + w * r3
    for b in range(nq // 7):
        for k in range(3, 7):
            a[m + b, 7 * b + k] = 2.0 * q[7 * b + k]


@kernel
def choose(ints, work, pivots, settings, counts):
    """Choose the partition at ``work[STATE]``, last evaluated; the number of independent coordinates."""
    q = work[STATE][COORDINATES]
    a = work[DENSE]
    rows, nq = work[ROWS].shape[1] + q.shape[0] // 7, q.shape[0]
    matrix(q, ints, work, a)
    counts[FACTORISATIONS] += 1
    rank = full_pivot(a, rows, nq, pivots[ROW_ORDER], pivots[COLUMN_ORDER], settings[RANK_TOLERANCE])
    pivots[SIZES, 0] = rank
    pivots[SIZES, 1] = 2 * (nq - rank)
    work[MEMO][0, REFERENCE_PIVOT] = 0.0
    return nq - rank


@kernel
def read(y, work, pivots):
    """Copy the independent coordinates and their rates of ``work[STATE]`` into y; the length of y."""
    state, rank, order = work[STATE], pivots[SIZES, 0], pivots[COLUMN_ORDER]
    k = state.shape[1] - rank
    for i in range(k):
        y[i] = state[COORDINATES, order[rank + i]]
        y[k + i] = state[COORDINATE_RATES, order[rank + i]]
    return 2 * k


@exchangeable(ENTER)
def enter(t, y, problem):
    ints, floats, work, pivots, settings, counts = opened(problem)
    state, last = work[STATE], work[LAST]
    q, v = state[COORDINATES], state[VELOCITIES][: work[COLUMNS].shape[1]]
    coordinate_rates(q, v, state[COORDINATE_RATES])
    evaluate(t, q, v, ints, floats, work)
    choose(ints, work, pivots, settings, counts)
    copy_rows(state, last)
    work[MEMO][0, LAST_TIME] = t
    return read(y, work, pivots)


@kernel
def factor(q, ints, work, pivots, counts):
    """LU of Φ_u at the state last evaluated; False where it is singular."""
    a, rank, width = work[DENSE], pivots[SIZES, 0], work[DENSE].shape[1]
    lu = a[width:]
    matrix(q, ints, work, a)
    for i in range(rank):
        for j in range(rank):
            lu[i, j] = a[pivots[ROW_ORDER, i], pivots[COLUMN_ORDER, j]]
    counts[FACTORISATIONS] += 1
    if not lu_factor(lu, rank, pivots[CHART_PIVOTS], SINGULAR_PIVOT):
        return False
    smallest, greatest = abs(lu[0, 0]), abs(lu[0, 0])
    for i in range(rank):
        smallest, greatest = min(smallest, abs(lu[i, i])), max(greatest, abs(lu[i, i]))
    work[MEMO][0, SMALLEST_PIVOT] = smallest / greatest
    return True


@kernel
def residual(q, work, pivots, b):
    """Φ and pᵀp - 1 of the active rows into b; the largest."""
    m, rank, size = work[ROWS].shape[1], pivots[SIZES, 0], 0.0
    for i in range(rank):
        row = pivots[ROW_ORDER, i]
        if row < m:
            b[i] = work[ROWS][PHI, row]
        else:
            j = 7 * (row - m) + 3
            w, x, y, z = q[j], q[j + 1], q[j + 2], q[j + 3]
            b[i] = w * w + x * x + y * y + z * z - 1.0
        if not abs(b[i]) <= size:
            size = abs(b[i])
    return size


@kernel
def solve_positions(t, y, ints, floats, work, pivots, settings, counts):
    """The dependent coordinates of y by Newton–Raphson into ``work[STATE]``, with Φ_u factored there."""
    state, last, order = work[STATE], work[LAST], pivots[COLUMN_ORDER]
    rank, nq = pivots[SIZES, 0], state.shape[1]
    q, v, b = state[COORDINATES], state[VELOCITIES][: work[COLUMNS].shape[1]], work[DENSE_VECTORS][0]
    h = t - work[MEMO][0, LAST_TIME]
    for i in range(rank):
        j = order[i]
        rate, second = last[COORDINATE_RATES, j], last[COORDINATE_SECOND, j]
        q[j] = last[COORDINATES, j] + h * rate + 0.5 * h * h * second
    for i in range(nq - rank):
        q[order[rank + i]] = y[i]
    for _ in range(MOST_ITERATIONS):
        evaluate(t, q, v, ints, floats, work)
        violation = residual(q, work, pivots, b)
        if not factor(q, ints, work, pivots, counts):
            return NOT_CONVERGED
        if violation <= settings[NEWTON_TOLERANCE]:
            return OK
        counts[NEWTON] += 1
        lu_solve(work[DENSE][work[DENSE].shape[1] :], rank, pivots[CHART_PIVOTS], b)
        for i in range(rank):
            q[order[i]] -= b[i]
    return NOT_CONVERGED


@kernel
def solve_velocities(y, work, pivots):
    """The dependent rates of y (Eq. 14) and v of all, into ``work[STATE]``; uses ``factor``."""
    state, order, a, m = work[STATE], pivots[COLUMN_ORDER], work[DENSE], work[ROWS].shape[1]
    rank, nq = pivots[SIZES, 0], state.shape[1]
    q, rates_, v, b = state[COORDINATES], state[COORDINATE_RATES], state[VELOCITIES], work[DENSE_VECTORS][0]
    free = nq - rank
    for i in range(rank):
        row = pivots[ROW_ORDER, i]
        b[i] = work[ROWS][NU, row] if row < m else 0.0
        for k in range(free):
            b[i] -= a[row, order[rank + k]] * y[free + k]
    lu_solve(a[a.shape[1] :], rank, pivots[CHART_PIVOTS], b)
    for i in range(rank):
        rates_[order[i]] = b[i]
    for k in range(free):
        rates_[order[rank + k]] = y[free + k]
    for body in range(nq // 7):  # ω' = 2 L p'
        i, j = 7 * body, 6 * body
        for k in range(3):
            v[j + k] = rates_[i + k]
        w, x, y_, z = q[i + 3], q[i + 4], q[i + 5], q[i + 6]
        dw, dx, dy, dz = rates_[i + 3], rates_[i + 4], rates_[i + 5], rates_[i + 6]
        v[j + 3] = 2.0 * (-x * dw + w * dx + z * dy - y_ * dz)
        v[j + 4] = 2.0 * (-y_ * dw - z * dx + w * dy + x * dz)
        v[j + 5] = 2.0 * (-z * dw + y_ * dx - x * dy + w * dz)


@kernel
def second_rates(work):
    """q'' of the accelerations: r'' and p'' = ½ Lᵀ ω̇' - ¼ (ω'·ω') p."""
    state, acceleration = work[STATE], work[COLUMNS][ACCELERATION]
    q, v, second = state[COORDINATES], state[VELOCITIES], state[COORDINATE_SECOND]
    coordinate_rates(q, acceleration, second)
    for body in range(q.shape[0] // 7):
        j = 6 * body
        square = 0.25 * (v[j + 3] * v[j + 3] + v[j + 4] * v[j + 4] + v[j + 5] * v[j + 5])
        for k in range(3, 7):
            second[7 * body + k] -= square * q[7 * body + k]


@exchangeable(RATES)
def rates(accelerate, t, y, y_rate, problem):
    ints, floats, work, pivots, settings, counts = opened(problem)
    status = solve_positions(t, y, ints, floats, work, pivots, settings, counts)
    if status != OK:
        return status
    solve_velocities(y, work, pivots)
    state, order, rank = work[STATE], pivots[COLUMN_ORDER], pivots[SIZES, 0]
    q, v = state[COORDINATES], state[VELOCITIES][: work[COLUMNS].shape[1]]
    status = accelerations(accelerate, t, q, v, ints, floats, work, pivots, settings, counts)
    second_rates(work)
    free = state.shape[1] - rank
    for i in range(free):
        y_rate[i] = y[free + i]
        y_rate[free + i] = state[COORDINATE_SECOND, order[rank + i]]
    return status


@exchangeable(ACCEPT)
def accept(t, y, problem):
    ints, floats, work, pivots, settings, counts = opened(problem)
    status = solve_positions(t, y, ints, floats, work, pivots, settings, counts)
    if status != OK:
        return status
    solve_velocities(y, work, pivots)
    copy_rows(work[STATE], work[LAST])
    work[MEMO][0, LAST_TIME] = t
    memo = work[MEMO]
    if memo[0, REFERENCE_PIVOT] == 0.0:
        memo[0, REFERENCE_PIVOT] = memo[0, SMALLEST_PIVOT]
    if memo[0, SMALLEST_PIVOT] < settings[KEPT_PARTITION] * memo[0, REFERENCE_PIVOT]:
        choose(ints, work, pivots, settings, counts)
        read(y, work, pivots)
        return CHANGED
    return OK


PARTITIONING = Stabilisation("partitioning", "Eqs. 10-16", enter, rates, rates, rates, accept, OPTIONS)
