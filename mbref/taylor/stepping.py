"""Steps of a Taylor method, each judged at its end, and kernels that take many steps in one call.

At the end of a step the rows are violated by the error of the series, which is corrected, and the
accelerations of the equations differ from the series.  If either exceeds what the tolerance explains, or rows
have become dependent, the step is repeated with a smaller length. So only a series that continues across a
singular position crosses it.
"""

from __future__ import annotations

from numpy import isfinite

from mbref.equations.functions import end_of_pieces, select_pieces
from mbref.kernels.compilation import INT, entry, exchangeable, kernel
from mbref.kernels.layout import NOT_FINITE, OK, SINGULAR_AHEAD
from mbref.linear_algebra.vectors import larger
from mbref.stepping.loop import DONE, PAUSED, STEP_TOO_SMALL, TOO_MANY_STEPS, UNDECIDED
from mbref.taylor.coefficients import largest_used
from mbref.taylor.crossing.acceptance import crossing_tolerance, judge_branch, step_tolerance
from mbref.taylor.crossing.detection import ends_deep, save_pivots, time_to_singular_position
from mbref.taylor.crossing.location import count_crossings
from mbref.taylor.crossing.rounding_pole import remove_pole, time_of_pole
from mbref.taylor.crossing.start import is_turned
from mbref.taylor.crossing.steps_across import cross_briefly, is_full, switches_branch
from mbref.taylor.crossing.thresholds import MIN_GAIN, ROUNDED_MOTION, VIOLATION_FLOOR
from mbref.taylor.layout import BEGIN, EXPAND, SAVE_SERIES, SERIES, TAKE_STEP
from mbref.taylor.loads import expand_functions, part_behind_no_length
from mbref.taylor.mode import is_accurate
from mbref.taylor.partition import least_pivot
from mbref.taylor.pose_maps import read_variables
from mbref.taylor.samples import evaluate_series, keep_sample, put_angles, put_terms
from mbref.taylor.saved_state import save_series
from mbref.taylor.series import turns_back_in
from mbref.taylor.simd import WIDTH, load, store
from mbref.taylor.step_length import first_lengths, longest_step, next_length
from mbref.taylor.turning import begin_turns, follow_turns, turning_speed

ROW_ROUNDING = 1e-12  # violation of a row, in units of the scene, that rounding may leave
LOST_ROWS = 100.0  # violation of rows at the end of a step, relative to the tolerance
LOST_MOTION = 30.0  # error of accelerations times the square of the step, relative to tolerance × order²
# error of accelerations by rounding at the start of a step, relative to squared speed / length
ROUGH_START = 1e-4
ROUGH_BEFORE = 1e-7  # before a singular position, where the step that crosses it increases the error
MOTION_ROUNDING = 1e-9  # error by rounding, relative to accelerations times the square of the step


@exchangeable(EXPAND)
def expand_from(t, memory):
    """Correct the state at time t and expand it, functions of time by their pieces at the start of the step;
    return OK or the failure status."""
    select_pieces(memory.run.loop.clock.time, memory.run.equations)
    expand_functions(t, memory)
    status = memory.kernels.correct(memory)
    if status == OK:
        memory.kernels.terms(memory)
    return status


@exchangeable(SAVE_SERIES)
def save_series_without_pole(memory):
    """Save the series that starts here; its rounding pole is removed unless the removal makes steps short.

    Very near to a singular position rounding may dominate all but a few orders.
    """
    save_series(memory)
    pole = time_of_pole(memory)
    if pole != 0.0:
        tolerance = step_tolerance(memory)
        reached = longest_step(tolerance, memory)
        remove_pole(pole, memory)
        if not longest_step(tolerance, memory) > MIN_GAIN * reached:
            save_series(memory)
    return OK


@kernel
def save_start(memory):
    """Save the series and the pivots at the start of the step."""
    save_pivots(memory)
    memory.kernels.save_series(memory)


@kernel
def error_of_motion(h, memory):
    """Return the largest difference between the accelerations of the new series and of the old one, and the
    larger of 1 and the largest acceleration, both times the square of the step (s)."""
    state, terms, off, size = memory.state, memory.series.terms, 0.0, 1.0
    for i in range(memory.solver.pivot_columns.shape[0]):
        off = larger(off, (2.0 * terms[2, i] - state[2, i]) * h * h)
        size = larger(size, state[2, i] * h * h)
    return off, size


@kernel
def starts_rough(memory):
    """Return whether rounding makes the accelerations rough at the end of a step, where the next one has to
    start: they change by the velocity squared times the rounding of the rows over the pivot cubed."""
    pivot, limit = least_pivot(memory), ROUGH_START if memory.step.crossed else ROUGH_BEFORE
    return limit * pivot * pivot * pivot < VIOLATION_FLOOR


@kernel
def judge_step(h, last, memory):
    """Return OK if rows and accelerations at the end of a step differ by no more than the tolerance explains.

    After a position at which a spring has zero length, errors of the accelerations act for the remaining time
    only.
    """
    step, order = memory.step, memory.mode.order
    if not step.violation <= LOST_ROWS * memory.mode.tolerance + ROW_ROUNDING:
        return STEP_TOO_SMALL
    status = judge_branch(h, last, memory)
    if status != OK:
        return status
    if memory.distance.rests_near and is_turned(memory):
        return UNDECIDED
    off, size = error_of_motion(h, memory)
    if not isfinite(off):
        return NOT_FINITE
    part = part_behind_no_length(memory)
    if part > 0.0 and off * part > crossing_tolerance(memory) * largest_used(1, memory) * h:
        return STEP_TOO_SMALL
    lost = LOST_MOTION * order * order * crossing_tolerance(memory)
    if last and is_accurate(memory):
        lost += error_by_rounding(h, memory)
    return OK if off <= lost + MOTION_ROUNDING * size else STEP_TOO_SMALL


@kernel
def error_by_rounding(h, memory):
    """Return the error, times the square of the step (s), of the accelerations of the new series by rounding.

    Rounding moves the state by δ and turns the velocity by δ over the least pivot, which changes the
    accelerations by the velocity squared times δ over the pivot squared. A run that ends near a singular
    position does not need these accelerations: the series of the step gives its last samples.
    """
    pivot, moved = least_pivot(memory), largest_used(1, memory) * h
    shift = memory.step.correction + VIOLATION_FLOOR / pivot
    return ROUNDED_MOTION * shift * (moved / pivot) * (moved / pivot)


@kernel
def expand_at(h, last, memory):
    """Expand at a distance h (s), to order 2 for the last step; return OK or the failure status."""
    mode, terms, state = memory.mode, memory.series.terms, memory.state
    evaluate_series(h, memory)
    lanes, variable = terms.shape[1], memory.series.variable
    for j in range(0, lanes, WIDTH):
        store(load(variable, j) * load(state, j), terms, j)
        store(load(variable, j) * load(state, lanes + j), terms, lanes + j)
    put_angles(h, memory)
    order = mode.order
    mode.order = 2 if last else order
    status = memory.kernels.expand(memory.run.loop.clock.time + h, memory)
    mode.order = order
    return status


@exchangeable(TAKE_STEP)
def take_step(memory):
    """Take one step in as many attempts as it needs, and its samples; return OK or the failure status."""
    clock, counts, state, stop = (
        memory.run.loop.clock, memory.run.equations.system.counts, memory.step, end_of_step(memory),
    )  # fmt: skip
    left = stop - clock.time
    save_start(memory)
    state.start_violation = 0.0
    regular, h = first_lengths(left, memory)
    if turns_back_in(h, memory):
        memory.kernels.multipliers(memory)
        memory.kernels.save_series(memory)
        regular, h = first_lengths(left, memory)
    if 0.0 < state.time_to_pole < h and not is_accurate(memory):
        clock.attempt_end = clock.time + h
        return SINGULAR_AHEAD
    while True:
        ends, last = h >= left, is_last(h, stop, memory)
        status = expand_at(h, last, memory)
        if status == OK:
            status = judge_step(h, ends, memory)
        if status == UNDECIDED and ends and not last and ends_deep(memory):
            status = STEP_TOO_SMALL  # shorter steps have the samples before
        # an end that is deep needs a step as long as one that crosses: shorter ones start in rounding
        if status == OK and (state.crossed or h <= regular or (ends and ends_deep(memory))):
            break
        if status == SINGULAR_AHEAD or (status == UNDECIDED and (state.crossed or h <= regular)):
            clock.attempt_end = clock.time + h
            memory.distance.time_to_crossing = time_to_singular_position(h, memory)
            return status
        counts.rejected += 1
        h = min(next_length(h, regular, memory), left)
        memory.kernels.return_to_start(memory)
        if not h >= memory.run.control.smallest_step:
            return status
    end_step(h, stop, memory)
    put_angles(h, memory)
    counts.crossings += count_crossings(h, memory) if state.crossed else 0
    return begin_pieces(stop, memory)


@kernel
def end_of_step(memory):
    """Return the time (s) at which the next step ends at the latest: at the end of the run or of a piece of a
    function of time."""
    return min(memory.progress.end, end_of_pieces(memory.run.equations))


@kernel
def is_last(h, stop, memory):
    """Return whether a step of h seconds ends the run."""
    return h >= stop - memory.run.loop.clock.time and stop >= memory.progress.end


@kernel
def begin_pieces(stop, memory):
    """Expand anew where a step has ended with a piece of a function; return OK or the failure status."""
    t = memory.run.loop.clock.time
    if t < stop or t >= memory.progress.end:
        return OK
    return UNDECIDED if starts_rough(memory) else memory.kernels.expand(t, memory)


@kernel
def end_step(h, stop, memory):
    """Keep the samples of a step of h seconds, follow its turns, and end it, at the time ``stop`` (s) at the
    latest."""
    clock, times = memory.run.loop.clock, memory.run.loop.times
    now = stop if h >= stop - clock.time else clock.time + h
    speed, seen = turning_speed(h, memory), 0.0
    while clock.sample < times.shape[0] and times[clock.sample] <= now:
        at = times[clock.sample] - clock.time
        follow_turns(seen, at, speed, memory)
        keep_sample(at, memory)
        seen = at
    follow_turns(seen, h, speed, memory)
    memory.run.equations.system.counts.steps += 1
    clock.time, clock.length = now, h


@kernel
def begin_once(memory):
    """Begin a series at the present state unless one has begun; return OK or the failure status."""
    if memory.progress.begun:
        return OK
    memory.progress.begun = 1
    return memory.kernels.begin(memory)


@exchangeable(BEGIN)
def begin_series(memory):
    """Choose the partition at the present state and expand there; return OK or the failure status."""
    t = memory.run.loop.clock.time
    select_pieces(t, memory.run.equations)
    read_variables(t, memory)
    begin_turns(memory)
    expand_functions(t, memory)
    memory.kernels.partition(memory)
    memory.step.crossed, memory.distance.leaving, memory.distance.rests_near = 0, 0, 0
    status = memory.kernels.expand(t, memory)
    return status if t > 0.0 else memory.kernels.judge_start(status, memory)


# --- kernels that Python calls --------------------------------------------------------------------------
@entry(INT(SERIES))
def enter_series(memory):
    """Begin a series at the present state; return OK or the failure status."""
    memory.progress.begun = 0
    return begin_once(memory)


@entry(INT(SERIES))
def advance_series(memory):
    """Begin a series unless one has begun, and advance until the end, a failure, or the limit of steps or
    singular positions in a call; return the status.

    The status is SINGULAR_AHEAD if a crossing cannot be short.
    """
    clock, counts = memory.run.loop.clock, memory.run.equations.system.counts
    status = begin_once(memory)
    if status != OK:
        return status
    for _ in range(int(memory.run.control.steps_per_call)):
        if counts.steps >= memory.run.control.most_steps:
            return TOO_MANY_STEPS
        status = memory.kernels.step(memory)
        if status == SINGULAR_AHEAD and cross_briefly(memory):
            status = OK
        if status != OK:
            put_terms(memory.series.past, memory)
            put_angles(0.0, memory)
            return status
        if memory.progress.recorded and switches_branch(counts.crossings, memory):
            return PAUSED
        if clock.time >= memory.progress.end:
            return DONE
        if is_full(memory):
            return PAUSED
    put_terms(memory.series.terms, memory)  # the pace of steps may end the run here
    return PAUSED
