"""One evaluation of a scene: frames, constraints, forces, and the accelerations of a formulation."""

from __future__ import annotations

from mbref.equations.loads import forces
from mbref.equations.primitives import constraints
from mbref.kernels.compilation import FLOAT, VECTOR, entry, inlined, kernel
from mbref.kernels.layout import (
    ACCELERATION,
    COLUMNS,
    COORDINATES,
    EVALUATIONS,
    FLOATS,
    FORCE,
    FORMULATION_PIVOTS,
    FRAMES,
    GAMMA,
    INTS,
    INVERSE_ROOT,
    JACOBIAN,
    MASS,
    MOVING,
    MULTIPLIERS,
    NU,
    OMEGA,
    PHI,
    PHI_Q,
    PHI_RATE,
    POSITION,
    POSITION_GAIN,
    RHS,
    ROTATION,
    ROW_BODIES,
    ROWS,
    SCRATCH,
    TURNING,
    VELOCITIES,
    VELOCITY,
    VELOCITY_GAIN,
    WORK,
)


@inlined
def place(q, frames):
    """Positions and rotation matrices of coordinates q; A(p) of p / |p|, so that length does not matter."""
    for b in range(q.shape[0] // 7):
        for k in range(3):
            frames[b, POSITION + k] = q[7 * b + k]
        w, x, y, z = q[7 * b + 3], q[7 * b + 4], q[7 * b + 5], q[7 * b + 6]
        s = 2.0 / (w * w + x * x + y * y + z * z)
        frames[b, ROTATION] = 1.0 - s * (y * y + z * z)
        frames[b, ROTATION + 1] = s * (x * y - w * z)
        frames[b, ROTATION + 2] = s * (x * z + w * y)
        frames[b, ROTATION + 3] = s * (x * y + w * z)
        frames[b, ROTATION + 4] = 1.0 - s * (x * x + z * z)
        frames[b, ROTATION + 5] = s * (y * z - w * x)
        frames[b, ROTATION + 6] = s * (x * z - w * y)
        frames[b, ROTATION + 7] = s * (y * z + w * x)
        frames[b, ROTATION + 8] = 1.0 - s * (x * x + y * y)


@inlined
def move(v, frames):
    """Velocities r' and body-fixed ω' of the velocity vector v."""
    for b in range(v.shape[0] // 6):
        for k in range(3):
            frames[b, VELOCITY + k] = v[6 * b + k]
            frames[b, OMEGA + k] = v[6 * b + 3 + k]


@inlined
def coordinate_rates(q, v, rates):
    """q' of v: r' and p' = ½ Lᵀ ω'."""
    for b in range(q.shape[0] // 7):
        i, j = 7 * b, 6 * b
        for k in range(3):
            rates[i + k] = v[j + k]
        w, x, y, z = q[i + 3], q[i + 4], q[i + 5], q[i + 6]
        a, b_, c = 0.5 * v[j + 3], 0.5 * v[j + 4], 0.5 * v[j + 5]
        rates[i + 3] = -x * a - y * b_ - z * c
        rates[i + 4] = w * a - z * b_ + y * c
        rates[i + 5] = z * a + w * b_ - x * c
        rates[i + 6] = -y * a + x * b_ + w * c


@inlined
def expand(y, live, state):
    """The whole state of y; coordinates that it does not have stay as they are."""
    nq, nv = live[0, MOVING], live[0, TURNING]
    for k in range(nq):
        state[COORDINATES, live[1, k]] = y[k]
    for k in range(nv):
        state[VELOCITIES, live[1, nq + k]] = y[nq + k]


@inlined
def contract(coordinates, velocities, live, y):
    """The entries of y among all coordinates and velocities, or their rates."""
    nq, nv = live[0, MOVING], live[0, TURNING]
    for k in range(nq):
        y[k] = coordinates[live[1, k]]
    for k in range(nv):
        y[nq + k] = velocities[live[1, nq + k]]


@inlined
def violation_rate(ints, work, v):
    """Φ' = Φ_q v - ν of every row."""
    bodies, jacobian, rows = ints[ROW_BODIES], work[JACOBIAN], work[ROWS]
    for row in range(bodies.shape[0]):
        value = -rows[NU, row]
        for side in range(2):
            start = 6 * bodies[row, side]
            if start < v.shape[0]:
                for k in range(6):
                    value += jacobian[row, 6 * side + k] * v[start + k]
        rows[PHI_RATE, row] = value


@kernel
def dense_jacobian(ints, work):
    """The blocks of Φ_q as a matrix (rows, 6 nb)."""
    bodies, jacobian, dense = ints[ROW_BODIES], work[JACOBIAN], work[PHI_Q]
    dense[:] = 0.0
    for row in range(bodies.shape[0]):
        for side in range(2):
            start = 6 * bodies[row, side]
            if start < dense.shape[1]:
                for k in range(6):
                    dense[row, start + k] = jacobian[row, 6 * side + k]


@inlined
def evaluate(t, q, v, ints, floats, work):
    """Φ, Φ_q (blocks), ν, γ and g at (t, q, v)."""
    place(q, work[FRAMES])
    move(v, work[FRAMES])
    constraints(t, ints, floats, work)
    forces(ints, floats, work)


@entry(FLOAT(FLOAT, VECTOR, VECTOR, INTS, FLOATS, WORK))
def evaluate_all(t, q, v, ints, floats, work):
    """``evaluate`` with Φ', for Python; returns t."""
    evaluate(t, q, v, ints, floats, work)
    violation_rate(ints, work, v)
    return t


@inlined
def right_hand_side(v, ints, work, settings):
    """That of Φ_q q̈ = γ, less the feedback of Eq. 9 where a stabilisation asks for it."""
    rows = work[ROWS]
    for row in range(rows.shape[1]):
        rows[RHS, row] = rows[GAMMA, row]
    if settings[VELOCITY_GAIN] != 0.0 or settings[POSITION_GAIN] != 0.0:
        violation_rate(ints, work, v)
        for row in range(rows.shape[1]):
            rows[RHS, row] -= settings[VELOCITY_GAIN] * rows[PHI_RATE, row]
            rows[RHS, row] -= settings[POSITION_GAIN] * rows[PHI, row]


@kernel
def accelerations(accelerate, t, q, v, ints, floats, work, pivots, settings, counts):
    """Accelerations and multipliers of the formulation ``accelerate`` at (t, q, v); its status."""
    counts[EVALUATIONS] += 1
    evaluate(t, q, v, ints, floats, work)
    dense_jacobian(ints, work)
    right_hand_side(v, ints, work, settings)
    rows, columns = work[ROWS], work[COLUMNS]
    return accelerate(
        columns[MASS], columns[INVERSE_ROOT], work[PHI_Q], columns[FORCE], rows[RHS], settings,
        work[SCRATCH][0], pivots[FORMULATION_PIVOTS], counts, columns[ACCELERATION], rows[MULTIPLIERS],
    )  # fmt: skip
