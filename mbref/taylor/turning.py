"""Full turns along a series: angles and quaternions are computed before a body may turn by a right angle.

A pose shows an angle up to full turns, and a quaternion up to its sign. The right one is nearest to the last
computed one, if no body has turned by a right angle since then. A bound of the rotation, from the rates of
the variables, says when both must be computed again: once in many short steps, and several times in a long
step.
"""

from __future__ import annotations

from numpy import sqrt

from mbref.equations.loads import remember_angles
from mbref.kernels.compilation import kernel
from mbref.taylor.samples import evaluate_series, put_quaternion
from mbref.taylor.simd import WIDTH, load, max_abs

MOST_TURN = 1.5  # rad; largest rotation of a body between computed angles: less than π/2
MARGIN = 1.25  # largest rate inside a step / larger rate at its ends, for smooth series


@kernel
def begin_turns(memory):
    """Compute the angles at the state in ``frames``, where a series begins, and the weights that bound
    rotations.

    With R' = Σ w_i z'_i of a body's rotation matrix, its rate is |R'| / √2 ≤ n max |w_i| |z'_i| / √2 with its
    n variables; the weight of a variable is the largest n |w_i| / √2 of all bodies.
    """
    poses, weights, squares = memory.polynomials.poses, memory.turns.weights, memory.turns.squares
    weights[:] = 0.0
    for b in range(memory.run.equations.frames.rotation.shape[0] - 1):
        squares[:] = 0.0
        for e in range(poses.start[12 * b + 3], poses.start[12 * b + 12]):
            squares[poses.variable[e]] += poses.weight[e] * poses.weight[e]
        count = 0
        for i in range(squares.shape[0]):
            count += squares[i] > 0.0
        for i in range(squares.shape[0]):
            weights[i] = max(weights[i], count * sqrt(0.5 * squares[i]))
    remember_angles(memory.run.equations)
    memory.turns.watch.unseen = 0.0


@kernel
def turning_speed(h, memory):
    """Return a bound (rad/s) of the bodies' rates of rotation in the last step, of h seconds."""
    series, weights = memory.series, memory.turns.weights
    lanes, fastest = weights.shape[0], 0.0
    for j in range(0, lanes, WIDTH):
        weight = load(weights, j)
        fastest = max(fastest, max_abs(weight * load(series.past, lanes + j)))
        fastest = max(fastest, max_abs(weight * load(series.terms, lanes + j)))
    if fastest * h <= MOST_TURN:
        return fastest
    return MARGIN * max(fastest_turn_at(series.past, memory), fastest_turn_at(series.terms, memory))


@kernel
def fastest_turn_at(series, memory):
    """Return the largest rate of rotation (rad/s) of a body at the rates series[1] of the variables."""
    poses, largest = memory.polynomials.poses, 0.0
    for b in range(memory.run.equations.frames.rotation.shape[0] - 1):
        square = 0.0
        for p in range(12 * b + 3, 12 * b + 12):
            rate = 0.0
            for e in range(poses.start[p], poses.start[p + 1]):
                rate += poses.weight[e] * series[1, poses.variable[e]]
            square += rate * rate
        largest = max(largest, square)
    return sqrt(0.5 * largest)


@kernel
def follow_turns(start, end, speed, memory):
    """Follow the angles between two distances (s) from the start of the last step, at a bound of the bodies'
    rates (rad/s)."""
    watch, turn = memory.turns.watch, speed * (end - start)
    if watch.unseen + turn <= MOST_TURN:
        watch.unseen += turn
        return
    parts = int(turn / MOST_TURN) + 1
    for part in range(parts):
        see_angles(start + (end - start) * part / parts, memory)
    watch.unseen = turn / parts


@kernel
def see_angles(h, memory):
    """Compute the angles and quaternions at a distance h (s) from the start of the last step."""
    if h == 0.0:
        put_rotations(memory.series.past, memory)
    else:
        evaluate_series(h, memory)
        put_rotations(memory.state, memory)
    remember_angles(memory.run.equations)
    rotation, q = memory.run.equations.frames.rotation, memory.run.state.coordinates
    for b in range(rotation.shape[0] - 1):
        put_quaternion(rotation[b], q[7 * b + 3 : 7 * b + 7])


@kernel
def put_rotations(series, memory):
    """Put the rotation matrices of all bodies at the variables series[0] into ``frames``."""
    poses, rotation = memory.polynomials.poses, memory.run.equations.frames.rotation
    for b in range(rotation.shape[0] - 1):
        for k in range(9):
            p = 12 * b + 3 + k
            value = poses.constant[p]
            for e in range(poses.start[p], poses.start[p + 1]):
                value += poses.weight[e] * series[0, poses.variable[e]]
            rotation[b, k] = value
