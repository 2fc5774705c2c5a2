"""Samples between the ends of a step: states from the series, multipliers by the formulation.

A run in series keeps the variables while it steps; the rest of its samples is found when it pauses or ends.
"""

from __future__ import annotations

from numpy import sqrt

from mbref.equations.coordinates import contract, copy_state
from mbref.equations.evaluation import add_resting_rows, assemble_system
from mbref.kernels.compilation import INT, entry, inlined, kernel
from mbref.kernels.layout import NOT_CONVERGED, OK
from mbref.linear_algebra.vectors import copy, larger
from mbref.simulation.samples import take_sample as record_sample
from mbref.taylor.layout import SERIES
from mbref.taylor.saved_state import restore_state, save_state
from mbref.taylor.simd import WIDTH, load, store

BESIDE = 0.1  # part of the largest least pivot below which a position is beside a singular one
LOST_MOTION = 30.0  # tolerances, times orders², by which accelerations times the step's square may be off
NOISE = 1e-9  # the same, by rounding
CLEAR = 1e-6  # relative difference of accelerations that contradict each other


@inlined
def evaluate_series(h, memory):
    """All lanes and their first two derivatives at a distance h (s) from the step's beginning (Horner)."""
    past, state = memory.series.past, memory.state
    last, lanes = memory.progress.cut, past.shape[1]
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
    """Positions and rotation matrices of all bodies, and their derivatives, from ``state``."""
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
def turning(a, a_rate, out):
    """The axial vector (3,) of the skew part of Aᵀ A', from rotation matrices by rows (9,)."""
    for k in range(3):
        i, j = (k + 2) % 3, (k + 1) % 3
        value = 0.0
        for r in range(3):
            value += a[3 * r + i] * a_rate[3 * r + j] - a[3 * r + j] * a_rate[3 * r + i]
        out[k] = 0.5 * value


@inlined
def put_quaternion(a, p):
    """The unit quaternion of a rotation matrix by rows (9,), on the side of the one that p (4,) was."""
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
    """Coordinates, velocities and accelerations of all bodies from their poses."""
    q, v, pose = memory.run.state.coordinates, memory.run.state.velocities, memory.pose
    acceleration = memory.run.equations.system.acceleration
    for b in range(v.shape[0] // 6):
        place, axes = 12 * b, slice(12 * b + 3, 12 * b + 12)
        for k in range(3):
            q[7 * b + k] = pose[0, place + k]
            v[6 * b + k] = pose[1, place + k]
            acceleration[6 * b + k] = pose[2, place + k]
        put_quaternion(pose[0, axes], q[7 * b + 3 : 7 * b + 7])
        turning(pose[0, axes], pose[1, axes], v[6 * b + 3 : 6 * b + 6])
        turning(pose[0, axes], pose[2, axes], acceleration[6 * b + 3 : 6 * b + 6])


@kernel
def put_state_at(h, memory):
    """Coordinates and velocities of all bodies at a distance h (s) from the step's beginning."""
    evaluate_series(h, memory)
    find_poses(memory)
    put_state(memory)


@kernel
def put_terms(series, memory):
    """Coordinates and velocities of all bodies where a series begins."""
    state = memory.state
    for i in range(memory.solver.pivot_columns.shape[0]):
        state[0, i], state[1, i] = series[0, i], series[1, i]
    find_poses(memory)
    put_state(memory)


@kernel
def rows_times(vector, equations, out):
    """Φ_q times a vector (n,)."""
    bodies, blocks = equations.scene.row_bodies, equations.system.blocks
    for row in range(out.shape[0]):
        value = 0.0
        for side in range(2):
            start = 6 * bodies[row, side]
            if start < vector.shape[0]:
                for k in range(6):
                    value += blocks[row, 6 * side + k] * vector[start + k]
        out[row] = value


@kernel
def explained(a, b, length, lost):
    """Whether two accelerations differ by no more than a step of that length may have ``lost``."""
    size, difference = 0.0, 0.0
    for k in range(a.shape[0]):
        size = larger(size, b[k])
        difference = larger(difference, a[k] - b[k])
    return difference * length * length <= LOST_MOTION * lost + CLEAR * size * length * length


@inlined
def lost_motion(progress):
    """The accelerations, times the step's square, by which the tolerance of a step explains a difference."""
    return LOST_MOTION * progress.order * progress.order * progress.tolerance + NOISE


@kernel
def project_state(t, run):
    """The state brought onto the constraints; as it is where that does not converge."""
    state, y = run.state, run.loop.y[: run.loop.clock.y_size]
    copy_state(state, run.previous)
    contract(state.coordinates, state.velocities, run.active, y)
    if run.kernels.accept(t, y, run) != OK:
        copy_state(run.previous, state)


@kernel
def accelerate(t, run):
    """Accelerations and multipliers at the state in memory by the formulation: OK or why there are none."""
    loop, kernels = run.loop, run.kernels
    y, y_rate = loop.y[: loop.clock.y_size], loop.y_rate[: loop.clock.y_size]
    contract(run.state.coordinates, run.state.velocities, run.active, y)
    return kernels.rates_with_outputs(t, y, y_rate, run)


@kernel
def balance_forces(t, acceleration, run):
    """Multipliers that balance the forces at accelerations (n,), which the formulation finds again from
    their rows: OK or why there are none."""
    assemble_system(t, run.state.coordinates, run.state.velocities, run.equations)
    rows_times(acceleration, run.equations, run.equations.system.rhs)
    status = run.kernels.accelerate(run.equations.system)
    add_resting_rows(t, run.factor.static, run.equations)
    return status


@kernel
def take_sample(h, length, memory):
    """Record a sample at a distance h (s) into a step: OK or why there is none.

    It waits for accelerations and multipliers unless the step crosses, or there is no room.
    """
    clock, waiting = memory.run.loop.clock, memory.waiting
    evaluate_series(h, memory)
    put_angles(h, memory)
    place = clock.sample - memory.progress.taken
    if place >= waiting.length.shape[0] or memory.progress.crossed:
        if place < waiting.length.shape[0]:
            waiting.length[place] = 0.0
        return complete_sample(length, lost_motion(memory.progress), memory.progress.passing, memory)
    keep_sample(place, length, memory)
    clock.sample += 1
    return OK


@inlined
def keep_sample(place, length, memory):
    """Have a sample wait at a place with the state in memory, of a step of that length."""
    waiting = memory.waiting
    copy(memory.state.reshape(-1), waiting.state[place])
    copy(memory.angles, waiting.angles[place])
    waiting.length[place], waiting.lost[place] = length, lost_motion(memory.progress)
    waiting.passing[place] = memory.progress.passing


@entry(INT(SERIES))
def complete_samples(memory):
    """Find accelerations and multipliers of the samples that wait: OK, or why one has none, which is then the
    first that is not taken."""
    clock, progress, waiting = memory.run.loop.clock, memory.progress, memory.waiting
    first, end = progress.taken, clock.sample
    progress.taken = end
    save_state(memory.run, memory.before_samples)
    for place in range(min(end - first, waiting.length.shape[0])):
        if waiting.length[place] > 0.0:
            clock.sample = first + place
            status = complete_waiting(place, memory)
            if status != OK:
                clock.time = memory.run.loop.times[first + place]
                return status
    restore_state(memory.before_samples, memory.run)
    return OK


@kernel
def complete_waiting(place, memory):
    """Find accelerations and multipliers of the sample that waits at a place: OK or why there are none."""
    waiting, slot = memory.waiting, memory.polynomials.torsions.slot
    copy(waiting.state[place], memory.state.reshape(-1))
    for s in range(slot.shape[0]):
        memory.run.equations.angles[slot[s]] = waiting.angles[place, s]
    return complete_sample(waiting.length[place], waiting.lost[place], waiting.passing[place], memory)


@kernel
def complete_sample(length, lost, passing, memory):
    """Record the sample whose variables are in memory, of a step of that length: OK or why there is none.

    Accelerations are the formulation's, but beside a singular position, where the state determines them ill,
    the series', unless they are those of a stride; multipliers balance the forces of either.  There the exact
    series of a passage give the state too: a projection would divide their rounding by the distance.
    NOT_CONVERGED where the series' accelerations contradict the formulation's.
    """
    run, samples, k = memory.run, memory.run.loop.samples, memory.run.loop.clock.sample
    system, watch = run.equations.system, run.watch
    find_poses(memory)
    put_state(memory)
    copy(system.acceleration, samples.accelerations[k])
    project_state(run.loop.times[k], run)
    is_exact = passing or not memory.progress.striding
    beside = is_exact and watch.smallest_pivot < BESIDE * watch.reference_pivot
    if beside:
        if passing:
            put_state(memory)
        status = balance_forces(run.loop.times[k], samples.accelerations[k], run)
    else:
        status = accelerate(run.loop.times[k], run)
    if status == OK and not explained(system.acceleration, samples.accelerations[k], length, lost):
        status = NOT_CONVERGED
    if status == OK:
        record_sample(run)
    return status


@kernel
def take_sample_of_series(memory):
    """Record the sample that was refused with the accelerations of the series: OK."""
    run = memory.run
    copy(run.loop.samples.accelerations[run.loop.clock.sample], run.equations.system.acceleration)
    record_sample(run)
    return OK


@kernel
def put_angles(h, memory):
    """The torsion springs' angles at a distance h (s) from the step's beginning, for the formulation."""
    torsions, past = memory.polynomials.torsions, memory.series.past_angles
    for s in range(past.shape[0]):
        value = 0.0
        for k in range(memory.progress.cut, -1, -1):
            value = value * h + past[s, k]
        memory.run.equations.angles[torsions.slot[s]] = value
        memory.angles[s] = value
