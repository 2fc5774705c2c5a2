"""States of all bodies from a series, at samples and at ends of steps; samples are saved until the steps of a
call have ended."""

from __future__ import annotations

from numpy import sqrt

from mbref.kernels.compilation import inlined, kernel
from mbref.linear_algebra.vectors import copy
from mbref.taylor.mode import is_accurate
from mbref.taylor.simd import WIDTH, load, store


@inlined
def evaluate_series(h, memory):
    """Evaluate all lanes and two derivatives at a distance h (s) from the start of the step (Horner)."""
    past, state = memory.series.past, memory.state
    last, lanes = memory.step.used_order, past.shape[1]
    for j in range(0, lanes, WIDTH):
        value = load(past, last * lanes + j)
        rate = 0.0 * value
        half = rate
        for k in range(last - 1, -1, -1):
            half = rate + h * half
            rate = value + h * rate
            value = load(past, k * lanes + j) + h * value
        store(value, state, j)
        store(rate, state, lanes + j)
        store(2.0 * half, state, 2 * lanes + j)


@kernel
def find_poses(memory):
    """Compute positions and rotation matrices of all bodies, and their derivatives, from ``state``."""
    poses, state, pose = memory.polynomials.poses, memory.state, memory.pose
    for p in range(poses.constant.shape[0]):
        value, rate, second = poses.constant[p], 0.0, 0.0
        for e in range(poses.start[p], poses.start[p + 1]):
            weight, i = poses.weight[e], poses.variable[e]
            value += weight * state[0, i]
            rate += weight * state[1, i]
            second += weight * state[2, i]
        pose[0, p], pose[1, p], pose[2, p] = value, rate, second


@inlined
def put_axial_vector(a, a_rate, out):
    """Compute the axial vector (3,) of the skew part of Aᵀ A', from rotation matrices by rows (9,)."""
    for k in range(3):
        i, j = (k + 2) % 3, (k + 1) % 3
        value = 0.0
        for r in range(3):
            value += a[3 * r + i] * a_rate[3 * r + j] - a[3 * r + j] * a_rate[3 * r + i]
        out[k] = 0.5 * value


@inlined
def put_quaternion(a, p):
    """Compute the unit quaternion of a rotation matrix by rows (9,), with the sign nearer to the previous p
    (4,)."""
    squares = (
        1.0 + a[0] + a[4] + a[8], 1.0 + a[0] - a[4] - a[8],
        1.0 - a[0] + a[4] - a[8], 1.0 - a[0] - a[4] + a[8],
    )  # fmt: skip
    x, y, z = a[7] - a[5], a[2] - a[6], a[3] - a[1]
    xy, yz, zx = a[1] + a[3], a[5] + a[7], a[2] + a[6]
    most = max(squares[0], squares[1], squares[2], squares[3])
    if squares[0] == most:
        found = (squares[0], x, y, z)
    elif squares[1] == most:
        found = (x, squares[1], xy, zx)
    elif squares[2] == most:
        found = (y, xy, squares[2], yz)
    else:
        found = (z, zx, yz, squares[3])
    square, side = 0.0, 0.0
    for value, before in zip(found, (p[0], p[1], p[2], p[3])):  # noqa: B905 - numba has no strict zip
        square += value * value
        side += value * before
    factor = (1.0 if side >= 0.0 else -1.0) / sqrt(square)
    p[0], p[1], p[2], p[3] = factor * found[0], factor * found[1], factor * found[2], factor * found[3]


@kernel
def put_state(memory):
    """Compute coordinates, velocities and accelerations of all bodies from their poses."""
    q, v, pose = memory.run.state.coordinates, memory.run.state.velocities, memory.pose
    acceleration = memory.run.equations.system.acceleration
    for b in range(v.shape[0] // 6):
        place, axes, turning = 12 * b, slice(12 * b + 3, 12 * b + 12), slice(6 * b + 3, 6 * b + 6)
        for k in range(3):
            q[7 * b + k] = pose[0, place + k]
            v[6 * b + k] = pose[1, place + k]
            acceleration[6 * b + k] = pose[2, place + k]
        put_quaternion(pose[0, axes], q[7 * b + 3 : 7 * b + 7])
        put_axial_vector(pose[0, axes], pose[1, axes], v[turning])
        put_axial_vector(pose[0, axes], pose[2, axes], acceleration[turning])


@kernel
def put_state_at(h, memory):
    """Compute coordinates and velocities of all bodies at a distance h (s) from the step's beginning."""
    evaluate_series(h, memory)
    find_poses(memory)
    put_state(memory)


@kernel
def put_terms(series, memory):
    """Compute coordinates and velocities of all bodies where a series begins."""
    state = memory.state
    for i in range(memory.solver.pivot_columns.shape[0]):
        state[0, i], state[1, i] = series[0, i], series[1, i]
    find_poses(memory)
    put_state(memory)


@kernel
def keep_sample(h, memory):
    """Save the variables at the next sample, at a distance h (s) into the step, until samples are completed
    (``mbref.taylor.sample_completion``)."""
    clock, waiting = memory.run.loop.clock, memory.waiting
    evaluate_series(h, memory)
    put_angles(h, memory)
    copy(memory.state.reshape(-1), waiting.state[clock.sample])
    copy(memory.run.equations.angles, waiting.angles[clock.sample])
    copy(memory.run.state.coordinates, waiting.coordinates[clock.sample])
    waiting.exact[clock.sample] = is_accurate(memory)
    clock.sample += 1


@kernel
def put_angles(h, memory):
    """Compute the torsion springs' angles at a distance h (s) from the step's beginning."""
    torsions, past = memory.polynomials.torsions, memory.series.past_angles
    for s in range(past.shape[0]):
        value = 0.0
        for k in range(memory.step.used_order if h != 0.0 else 0, -1, -1):
            value = value * h + past[s, k]
        memory.run.equations.angles[torsions.slot[s]] = value
