"""The watch for singular positions: which steps may pass one.

Where the rank of Φ_q drops, a pivot of its rows falls to zero and rises again.  The pivots are those of unit
rows in columns of unit length (``equations.units``), so that masses have no part in them; the projection has
them at hand after every step (``layout.Watch``).  Close to a singular position the component of the
acceleration along the vanishing singular vector is spoilt by rounding and by the violation of the stages,
both divided by the distance, and a step over it may land on a branch that the motion does not reach.  Such a
step is not taken; the Taylor series of ``mbref.taylor`` takes its place.
"""

from __future__ import annotations

from numpy import sqrt

from mbref.equations.coordinates import expand, fastest_turn
from mbref.equations.evaluation import evaluate
from mbref.equations.loads import remember_angles
from mbref.kernels.compilation import kernel
from mbref.linear_algebra.elimination import determinant
from mbref.linear_algebra.sparse_cholesky import assemble_gradients, find_squared_pivots
from mbref.linear_algebra.vectors import copy
from mbref.stabilisation.projection import ALPHA, factorise_constraints

WINDOW = 0.1  # relative pivot below which a singular position is near
ON_IT = 1e-7  # relative pivot of a run that begins on one: its first step leaves it
SHARP = 3.0  # times a pivot's fall in the time of a step: a larger pivot has not vanished inside
STEEP = 2.0  # largest fall of a pivot a rad: where it could vanish inside a step, determinants are compared
LONG = 0.5  # rad that a body turns in a step inside which pivots are looked at
SHARPLY, FINE = 0.5, 5  # a pivot's change in a step, as a ratio, inside which as many parts are looked at
SMALLEST = 1e-4  # pivot of a row below which it is as good as redundant, and is not compared


@kernel
def relative_pivot(watch):
    """Smallest pivot of Φ_q over the largest it has had; 1 where the chart does not watch it."""
    reference = watch.reference_pivot
    return watch.smallest_pivot / reference if reference > 0.0 else 1.0


@kernel
def is_near(memory):
    """Whether a singular position is near where pivots were last watched."""
    return memory.control.closed_loops > 0.0 and relative_pivot(memory.watch) <= WINDOW


@kernel
def starts_near(memory):
    """Whether a run begins beside a singular position, but not on it."""
    begins = memory.equations.system.counts.steps == 0
    return begins and is_near(memory) and relative_pivot(memory.watch) > ON_IT


@kernel
def comes_near(memory):
    """Whether a step ends near a singular position, and nearer than it began."""
    return is_near(memory) and memory.watch.smallest_pivot < memory.watch.past_pivot


@kernel
def remember_state(taken, y, y_rate, memory):
    """Row taken mod KEPT of the history := t, pivots, y, y'."""
    history = memory.loop.history
    row, n = taken % history.time.shape[0], y.shape[0]
    memory.watch.past_pivot = memory.watch.smallest_pivot
    history.time[row] = memory.loop.clock.time
    copy(memory.pivots, history.pivots[row])
    copy(y, history.y[row, :n])
    copy(y_rate, history.y_rate[row, :n])


@kernel
def may_have_passed(h, memory):
    """Whether a pivot may have vanished inside a step of h seconds that ends where pivots were last watched.

    So it is where its values at both ends add up to less than what it falls, as fast as in the step before.
    """
    history, taken = memory.loop.history, memory.equations.system.counts.steps
    if memory.control.closed_loops == 0.0 or taken == memory.loop.clock.restart:
        return False
    kept = history.time.shape[0]
    now, before = taken % kept, (taken - 1) % kept
    width = history.time[now] - history.time[before]
    for k in range(memory.pivots.shape[0]):
        start, end = history.pivots[now, k], memory.pivots[k]
        fall = (history.pivots[before, k] - start) / width * h
        if start > SMALLEST and start + end < SHARP * fall:
            return True
    return False


@kernel
def has_passed(y, memory):
    """Whether a pivot has vanished inside the last step, y being the state at its end.

    Inside a long step, and one in which a pivot changes much, the pivots are those at places in between, by
    Hermite's cubic polynomial.
    """
    history, clock, state = memory.loop.history, memory.loop.clock, memory.state
    taken, kept, inside = memory.equations.system.counts.steps, history.time.shape[0], history.inside
    if memory.control.closed_loops == 0.0 or memory.watch.reference_pivot == 0.0 or taken == clock.restart:
        return False
    now, before = taken % kept, (taken - 1) % kept
    turn = fastest_turn(state.velocities) * (history.time[now] - history.time[before])
    pieces = int(turn / LONG) + 1
    if changes_much(history.pivots[before], history.pivots[now]):
        pieces = max(pieces, FINE)
    pieces = min(pieces, inside.shape[0] - 1)
    can_turn = memory.loop.gradients.product.shape[0] > 0
    can_turn = can_turn and least_sum(history.pivots[before], history.pivots[now]) < STEEP * turn
    if pieces == 1 and not can_turn:
        return False
    copy(history.pivots[before], inside[0])
    copy(history.pivots[now], inside[pieces])
    changes = False
    remember_gradient(before, memory)
    for i in range(1, pieces):
        put_pivots_inside(i, i / pieces, before, now, memory)
        changes = changes_sign(memory) or changes
    put_gradient(clock.time, y, memory)
    return changes_sign(memory) or changes or falls_and_rises(pieces, inside)


@kernel
def least_sum(before, now):
    """The least of the sums of a pivot at both ends of a step."""
    least = 2.0
    for k in range(now.shape[0]):
        if min(before[k], now[k]) > SMALLEST:
            least = min(least, before[k] + now[k])
    return least


@kernel
def remember_gradient(before, memory):
    """Keep D of a row of the history, where there is room."""
    loop = memory.loop
    if loop.gradients.product.shape[0] > 0:
        start = loop.y_new[: loop.clock.y_size]
        copy(loop.history.y[before, : loop.clock.y_size], start)
        put_gradient(loop.history.time[before], start, memory)
        copy(memory.factor.d, loop.gradients.start)


@kernel
def changes_sign(memory):
    """Whether det(G₁ G₀ᵀ + I/α) is negative, of the last gradient and of the kept one, which it replaces.

    It is positive where the rows' span turns by less than a right angle, and changes its sign where the rank
    drops by one in between.
    """
    factor, gradients = memory.factor, memory.loop.gradients
    if gradients.product.shape[0] == 0:
        return False
    put_product(factor, gradients)
    copy(factor.d, gradients.start)
    negative, _ = determinant(gradients.product, factor.diagonal.shape[0])
    return negative


@kernel
def put_gradient(t, y, memory):
    """D of the factor at time t and state y."""
    state, equations = memory.state, memory.equations
    expand(y, memory.active, state)
    evaluate(t, state.coordinates, state.velocities, equations)
    assemble_gradients(memory.factor, equations.system.blocks.reshape(-1), equations.scene.metric_root)


@kernel
def put_product(factor, gradients):
    """D D₀ᵀ and a part 1/α of the squares of D on its diagonal, D₀ being where the step began.

    It has entries where S and its factor L have theirs, and from the products of the same numbers.
    """
    symbolic, d, d_0, product = factor.symbolic, factor.d, gradients.start, gradients.product
    first, row, start, left, right = (
        symbolic.l_start, symbolic.l_row, symbolic.s_start, symbolic.s_left, symbolic.s_right,
    )  # fmt: skip
    product[:] = 0.0
    for k in range(factor.diagonal.shape[0]):
        for entry in range(first[k], first[k + 1]):
            lower, upper, square = 0.0, 0.0, 0.0
            for p in range(start[entry], start[entry + 1]):
                lower += d[left[p]] * d_0[right[p]]
                upper += d[right[p]] * d_0[left[p]]
                square += d[left[p]] * d[right[p]]
            product[row[entry], k], product[k, row[entry]] = lower, upper
            if row[entry] == k:
                product[k, k] += (square if square > 0.0 else 1.0) / ALPHA


@kernel
def changes_much(before, now):
    """Whether a pivot falls or rises by more than SHARPLY between the ends of a step."""
    for k in range(now.shape[0]):
        least, most = min(before[k], now[k]), max(before[k], now[k])
        if most > SMALLEST and least < SHARPLY * most:
            return True
    return False


@kernel
def put_pivots_inside(i, part, before, now, memory):
    """The pivots at a part of a step, between two rows of the history, into row i of those inside."""
    history, state, factor = memory.loop.history, memory.state, memory.factor
    y, width = memory.loop.y_new[: memory.loop.clock.y_size], history.time[now] - history.time[before]
    rest = 1.0 - part
    for k in range(y.shape[0]):
        start, end = history.y[before, k], history.y[now, k]
        leaving = width * history.y_rate[before, k] - (end - start)
        arriving = (end - start) - width * history.y_rate[now, k]
        y[k] = rest * start + part * end + part * rest * (rest * leaving + part * arriving)
    expand(y, memory.active, state)
    t = history.time[before] + part * width
    evaluate(t, state.coordinates, state.velocities, memory.equations)
    copy(history.pivots[before], history.inside[i])
    if factorise_constraints(memory):
        find_squared_pivots(factor)
        for k in range(factor.squared_pivots.shape[0]):
            history.inside[i, k] = sqrt(factor.squared_pivots[k])


@kernel
def falls_and_rises(pieces, inside):
    """Whether a pivot vanishes between two of the equidistant places, as fast as it falls or rises beside."""
    for k in range(inside.shape[1]):
        for i in range(pieces):
            first, second, fall = inside[i, k], inside[i + 1, k], 0.0
            if i > 0:
                fall = inside[i - 1, k] - first
            if i + 2 <= pieces:
                fall = max(fall, inside[i + 2, k] - second)
            if min(first, second) > SMALLEST and first + second < SHARP * fall:
                return True
    return False


@kernel
def step_back(memory):
    """The state before the last step, with the time of that step's end as that of the passage."""
    history, clock, state = memory.loop.history, memory.loop.clock, memory.state
    before = (memory.equations.system.counts.steps - 1) % history.time.shape[0]
    clock.passage, clock.time = clock.time, history.time[before]
    y = memory.loop.y[: clock.y_size]
    copy(history.y[before, : clock.y_size], y)
    expand(y, memory.active, state)
    evaluate(clock.time, state.coordinates, state.velocities, memory.equations)
    remember_angles(memory.equations)
