"""The stepping loop: from sample time to sample time, compiled, no Python object inside."""

from __future__ import annotations

from numpy import isfinite, sqrt

from mbref.equations.evaluation import expand
from mbref.equations.loads import remember_angles
from mbref.kernels.arguments import opened
from mbref.kernels.compilation import INDICES, INT, MATRIX, VECTOR, entry, kernel, pointer_to
from mbref.kernels.layout import (
    ACCELERATE,
    ACCELERATION,
    ACCEPT,
    CHANGED,
    COLUMNS,
    COORDINATES,
    CROSSINGS,
    DENSE,
    FIRST_STEP,
    FIXED_STEP,
    FORCED_STEP,
    HANDOVER,
    LARGEST_STEP,
    LARGEST_TURN,
    LAST,
    LAST_TIME,
    LIVE,
    MEMO,
    MOST_STEPS,
    MOVING,
    MULTIPLIERS,
    NOT_CONVERGED,
    NOT_FINITE,
    OK,
    PHI,
    PROBLEM,
    PROPOSE,
    RATES,
    REJECTED,
    ROWS,
    SIZES,
    SMALLEST_STEP,
    STATE,
    STEP,
    STEPS,
    STEPS_PER_CALL,
    TURNING,
    VELOCITIES,
    VIOLATION,
)
from mbref.kernels.pointer_table import array_at, kernel_at
from mbref.linear_algebra.vectors import copy, copy_rows
from mbref.simulation.singular_crossing import (
    APART,
    choose_nodes,
    extrapolate,
    has_fallen_in,
    keep_state,
    leap_length,
    relative_pivot,
    to_edge,
)

# how a call ends; evaluation statuses (SINGULAR, …) end it too
DONE, VIOLATED, STEP_TOO_SMALL, TOO_MANY_STEPS, PAUSED = range(10, 15)
# clock: the state of the loop between calls; length and error ratio of the last step, and its length
# before the sample times cut it
TIME, LENGTH, SUGGESTED, RATIO = range(4)
# place: sample to take next, and the violated row
SAMPLE, ROW = range(2)


@kernel
def take_sample(k, work, sample_q, sample_v, sample_a, sample_m):
    """Record state, accelerations and multipliers as the last evaluation left them."""
    state, columns = work[STATE], work[COLUMNS]
    copy(state[COORDINATES], sample_q[k])
    copy(state[VELOCITIES][: columns.shape[1]], sample_v[k])
    copy(columns[ACCELERATION], sample_a[k])
    copy(work[ROWS][MULTIPLIERS], sample_m[k])


@kernel
def all_finite(values):
    """Whether no entry is infinite or undefined."""
    for value in values:  # noqa: SIM110 - numba compiles no generator expression
        if not isfinite(value):
            return False
    return True


@kernel
def worst_row(work):
    """The row with the largest violation; -1 without rows."""
    phi, worst = work[ROWS][PHI], -1
    for row in range(phi.shape[0]):
        if worst < 0 or abs(phi[row]) > abs(phi[worst]):
            worst = row
    return worst


@kernel
def judge(y, y_rate, place, control, work):
    """Whether a state can be kept: finite, and no row violated beyond what is tolerated."""
    if not (all_finite(y) and all_finite(y_rate)):
        return NOT_FINITE
    place[ROW] = worst_row(work)
    if place[ROW] >= 0 and abs(work[ROWS][PHI, place[ROW]]) > control[VIOLATION]:
        return VIOLATED
    return OK


@kernel
def fastest_turn(work):
    """The largest angular velocity of a body (rad/s)."""
    v, square = work[STATE][VELOCITIES][: work[COLUMNS].shape[1]], 0.0
    for b in range(v.shape[0] // 6):
        a, b_, c = v[6 * b + 3], v[6 * b + 4], v[6 * b + 5]
        square = max(square, a * a + b_ * b_ + c * c)
    return sqrt(square)


@kernel
def keep(t, ints, floats, work):
    """Remember the accepted state, from which charts predict and angles unwrap."""
    copy_rows(work[STATE], work[LAST])
    work[MEMO][0, LAST_TIME] = t
    remember_angles(ints, floats, work)


@kernel
def largest_step(control, work):
    """The step that the user's limit and the fastest turning body allow."""
    fastest = fastest_turn(work)
    h = control[LARGEST_STEP]
    return min(h, control[LARGEST_TURN] / fastest) if fastest > 0.0 else h


@kernel
def chosen(suggested, control, counts):
    """The step to try: the user's first where one is given, else the integrator's."""
    return control[FIRST_STEP] if counts[STEPS] == 0 and control[FIRST_STEP] > 0.0 else suggested


@kernel
def place_inside(t, history, nodes, found, y, y_rate, live, work):
    """The extrapolated state and accelerations at a sample time inside a window, for ``take_sample``."""
    extrapolate(history, nodes, found, t, y, y_rate, work[DENSE])
    expand(y, live, work[STATE])
    nq, acceleration = live[0, MOVING], work[COLUMNS][ACCELERATION]
    for k in range(live[0, TURNING]):
        acceleration[live[1, nq + k]] = y_rate[nq + k]


@kernel
def part_of(interval, h):
    """The step next taken towards the end of an interval: to the end, to the middle of it, or h."""
    if h * (1.0 + 1e-9) >= interval:
        return interval
    return 0.5 * interval if 2.0 * h > interval else h


_step, _propose, _rates = (kernel_at(pointer_to(kind)) for kind in (STEP, PROPOSE, RATES))
_accept, _accelerate = kernel_at(pointer_to(ACCEPT)), kernel_at(pointer_to(ACCELERATE))
_vector, _matrix, _indices = array_at(VECTOR), array_at(MATRIX), array_at(INDICES)


@entry(INT(PROBLEM, PROBLEM))
def march(loop, problem):
    """Advance until the last sample time, a failure, or the number of steps per call; says which.

    ``loop`` is the table of the kernels step, propose, rates, observe, careful, accept and accelerate, then
    of the arrays named below.
    """
    step = _step(loop, 0)
    propose = _propose(loop, 1)
    rates = _rates(loop, 2)
    observe = _rates(loop, 3)
    careful = _rates(loop, 4)
    accept = _accept(loop, 5)
    accelerate = _accelerate(loop, 6)
    times, sample_q, sample_v = _vector(loop, 7), _matrix(loop, 8), _matrix(loop, 9)
    sample_a, sample_m = _matrix(loop, 10), _matrix(loop, 11)
    clock, control, place = _vector(loop, 12), _vector(loop, 13), _indices(loop, 14)
    tolerances, memory, history = _vector(loop, 15), _matrix(loop, 19), _matrix(loop, 20)
    y, y_rate, y_new, nodes = _vector(loop, 16), _vector(loop, 17), _vector(loop, 18), _indices(loop, 21)
    ints, floats, work, pivots, _settings, counts = opened(problem)
    taken = 0
    while True:
        t, size = clock[TIME], pivots[SIZES, 1]
        look = observe if t >= times[place[SAMPLE]] else rates
        status = look(accelerate, t, y[:size], y_rate[:size], problem)
        if status == HANDOVER:
            status = careful(accelerate, t, y[:size], y_rate[:size], problem)
        if status == OK:
            status = judge(y[:size], y_rate[:size], place, control, work)
        if status != OK:
            return status
        keep(t, ints, floats, work)
        while place[SAMPLE] < times.shape[0] and t >= times[place[SAMPLE]]:
            take_sample(place[SAMPLE], work, sample_q, sample_v, sample_a, sample_m)
            place[SAMPLE] += 1
        keep_state(history, counts[STEPS], t, relative_pivot(work), y[:size], y_rate[:size])
        if place[SAMPLE] == times.shape[0]:
            return DONE
        if counts[STEPS] >= control[MOST_STEPS]:
            return TOO_MANY_STEPS
        if taken >= control[STEPS_PER_CALL]:
            return PAUSED
        length = 0.0 if control[FIXED_STEP] > 0.0 else leap_length(history, counts[STEPS])
        if length > 0.0:
            status = leap(
                length, accept, times, sample_q, sample_v, sample_a, sample_m, clock, place,
                y, y_rate, y_new, history, nodes, problem,
            )  # fmt: skip
            memory[:] = 0.0
            if status != OK:
                return status
            if place[SAMPLE] == times.shape[0]:
                return DONE
            taken += 1
            continue
        suggested = propose(
            clock[LENGTH], clock[SUGGESTED], clock[RATIO], y[:size], y_rate[:size],
            memory, control, tolerances,
        )  # fmt: skip
        suggested = chosen(suggested, control, counts)
        status = advance(
            suggested, step, propose, rates, careful, accept, accelerate, times[place[SAMPLE]], clock,
            control, tolerances, y, y_rate, y_new, memory, history, problem,
        )  # fmt: skip
        if status != OK:
            return status
        taken += 1


@kernel
def leap(
    length, accept, times, sample_q, sample_v, sample_a, sample_m, clock, place,
    y, y_rate, y_new, history, nodes, problem,
):  # fmt: skip
    """Cross a window by extrapolation and projection; samples inside it are taken as extrapolated."""
    ints, _floats, work, pivots, _settings, counts = opened(problem)
    t, size = clock[TIME], pivots[SIZES, 1]
    found = choose_nodes(history, counts[STEPS], APART * length, nodes)
    while place[SAMPLE] < times.shape[0] and times[place[SAMPLE]] <= t + length:
        clock[TIME] = times[place[SAMPLE]]
        place_inside(clock[TIME], history, nodes, found, y_new[:size], y_rate[:size], ints[LIVE], work)
        take_sample(place[SAMPLE], work, sample_q, sample_v, sample_a, sample_m)
        place[SAMPLE] += 1
    extrapolate(history, nodes, found, t + length, y_new[:size], y_rate[:size], work[DENSE])
    status = accept(t + length, y_new, problem)
    clock[TIME] = t + length if place[SAMPLE] < times.shape[0] else clock[TIME]
    counts[STEPS] += 1
    counts[CROSSINGS] += 1
    if status == OK:
        copy(y_new, y)
    return status


@kernel
def advance(
    suggested, step, propose, rates, careful, accept, accelerate, target, clock, control, tolerances,
    y, y_rate, y_new, memory, history, problem,
):  # fmt: skip
    """One accepted step towards the target time, as many attempts as it takes."""
    _ints, _floats, work, pivots, _settings, counts = opened(problem)
    t, size, interval = clock[TIME], pivots[SIZES, 1], target - clock[TIME]
    limit = min(largest_step(control, work), to_edge(history, counts[STEPS]))
    suggested = min(max(suggested, control[FORCED_STEP]), limit)
    while True:
        if control[FIXED_STEP] > 0.0:
            h = interval / max(1.0, -(-(interval / control[FIXED_STEP] - 1e-6) // 1.0))
        else:
            h = part_of(interval, suggested)
        ratio = step(
            rates, accelerate, t, h, y[:size], y_rate[:size], y_new[:size], memory, tolerances,
            problem,
        )  # fmt: skip
        if ratio == -float(HANDOVER):  # the chart's own rates leave this step to the careful ones
            ratio = step(
                careful, accelerate, t, h, y[:size], y_rate[:size], y_new[:size], memory, tolerances,
                problem,
            )  # fmt: skip
        now = target if h == interval else t + h
        status = OK if ratio >= 0.0 else (int(-ratio) if ratio < 0.0 else NOT_FINITE)
        if status == OK and h <= control[FORCED_STEP]:
            ratio = min(ratio, 1.0)
        if status == OK and ratio <= 1.0:
            status = accept(now, y_new, problem)
            if status == OK and control[FIXED_STEP] == 0.0 and has_fallen_in(history, counts[STEPS], work):
                status = NOT_CONVERGED
            if status == OK or status == CHANGED:  # noqa: SIM109 - no containers in kernels
                counts[STEPS] += 1
                copy(y_new, y)
                clock[TIME], clock[LENGTH], clock[SUGGESTED], clock[RATIO] = now, h, suggested, ratio
                if status == CHANGED:
                    memory[:] = 0.0
                return OK
        counts[REJECTED] += 1
        if control[FIXED_STEP] > 0.0:
            return status
        verdict = ratio if status == OK else -float(status)
        suggested = propose(h, suggested, verdict, y[:size], y_rate[:size], memory, control, tolerances)
        if status == OK:
            suggested = max(suggested, control[FORCED_STEP])
        if suggested < control[SMALLEST_STEP]:
            return STEP_TOO_SMALL if status == OK else status
