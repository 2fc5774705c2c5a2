"""Motions that drivers prescribe: predictor steps, corrected by Newton's method on Φ(q, t) = 0.

If drivers prescribe all degrees of freedom, the rows alone determine the state at the end of a step.
Errors do not accumulate, and a series of low accuracy is enough as a predictor.  G is square: its
determinant, the product of the pivots, changes its sign where branches cross.  A predictor step that may
contain a singular position is replaced by high-accuracy steps (``mbref.taylor.crossing``).
"""

from __future__ import annotations

from numpy import exp, inf, isfinite, log

from mbref.kernels.compilation import INT, entry, kernel
from mbref.kernels.layout import OK, SINGULAR_AHEAD
from mbref.stepping.loop import DONE, PAUSED, STEP_TOO_SMALL, TOO_MANY_STEPS, UNDECIDED
from mbref.taylor.coefficients import largest_used
from mbref.taylor.crossing.detection import (
    ends_near_singular,
    time_to_singular_position,
)
from mbref.taylor.crossing.steps_across import is_full
from mbref.taylor.crossing.thresholds import CROSSING_START, PIVOT_AHEAD, PIVOT_NEAR
from mbref.taylor.layout import SERIES
from mbref.taylor.mode import is_accurate, set_high_accuracy, set_predictor
from mbref.taylor.partition import least_pivot
from mbref.taylor.samples import put_angles, put_terms
from mbref.taylor.series_options import ACCURATE_TOLERANCE, PREDICTOR_TOLERANCE
from mbref.taylor.step_length import SHORTER, longest_step
from mbref.taylor.stepping import (
    LOST_MOTION,
    LOST_ROWS,
    begin_once,
    begin_pieces,
    end_of_step,
    end_step,
    error_of_motion,
    expand_at,
    is_last,
    save_start,
)

MIN_PREDICTOR_RATIO = 0.25  # predictor step / crossing step: a shorter one is not taken


@entry(INT(SERIES))
def follow_drivers(memory):
    """Begin a series unless one has begun, and advance to the end, or by the limit of steps or crossings in a
    call.

    Return DONE, PAUSED, or the failure status.
    """
    clock, counts, control = memory.run.loop.clock, memory.run.equations.system.counts, memory.run.control
    progress = memory.progress
    status = begin_once(memory)
    if status != OK:
        return status
    if counts.steps == 0:
        memory.distance.entry_pivot = least_pivot(memory)
        set_predictor(memory)
    for _ in range(int(control.steps_per_call)):
        if counts.steps >= control.most_steps:
            return TOO_MANY_STEPS
        status = take_accurate_step(memory) if is_accurate(memory) else take_predictor_step(memory)
        if status != OK and status != SINGULAR_AHEAD:
            put_terms(memory.series.past, memory)
            put_angles(0.0, memory)
            return status
        if status == OK and clock.time >= progress.end:
            return DONE
        if is_full(memory):
            return PAUSED
    put_terms(memory.series.terms, memory)  # the pace of steps may end the run here
    return PAUSED


@kernel
def take_accurate_step(memory):
    """Take one high-accuracy step; return OK, or UNDECIDED if the motion cannot be followed.

    After the singular position predictor steps follow.
    """
    step = memory.step
    if memory.kernels.step(memory) != OK:
        return UNDECIDED
    if step.crossed:
        memory.kernels.record(memory)
    pivot = least_pivot(memory)
    is_behind = step.crossed or pivot >= memory.distance.start_pivot
    if is_behind and pivot >= PIVOT_AHEAD * memory.distance.largest_pivot:
        set_predictor(memory)
        step.crossed, memory.distance.start_pivot = 0, 0.0
    return OK


@kernel
def take_predictor_step(memory):
    """Take one predictor step and its samples; return OK or the failure status.

    The status is SINGULAR_AHEAD, and memory is ready for high-accuracy steps, if the step may come to a
    singular position.
    """
    control, counts, clock = memory.run.control, memory.run.equations.system.counts, memory.run.loop.clock
    fall = (memory.distance.start_pivot - least_pivot(memory)) / max(clock.length, control.smallest_step)
    save_start(memory)
    stop = end_of_step(memory)
    left = stop - clock.time
    h = min(longest_predictor_step(memory), left)
    if h * fall > memory.distance.start_pivot:
        return start_accurate_steps(memory.distance.start_pivot / fall, stop, memory)
    while True:
        status = attempt_predictor_step(h, is_last(h, stop, memory), memory)
        if status == OK:
            end_step(h, stop, memory)
            return begin_pieces(stop, memory)
        if status == SINGULAR_AHEAD:
            return start_accurate_steps(time_to_singular_position(h, memory), stop, memory)
        counts.rejected += 1
        h *= SHORTER
        memory.kernels.return_to_start(memory)
        if not h >= control.smallest_step:
            return status


@kernel
def longest_predictor_step(memory):
    """Return the longest predictor step (s), and save the order of the series that it evaluates.

    The last two terms of the series are then as large as the tolerance. Near a singular position terms of
    high order are rounding, which grows with the order, so that fewer terms allow a longer step.
    """
    step, control, full = memory.step, memory.run.control, memory.mode.order
    best, step.used_order, largest = -inf, full, log(control.largest_step)
    fewest = 2 if memory.distance.start_pivot < PIVOT_NEAR * memory.distance.largest_pivot else 4
    for quarters in range(4, fewest - 1, -1):
        order, longest = full * quarters // 4, largest
        for k in range(order - 1, order + 1):
            size = largest_used(k, memory)
            if size > 0.0:
                longest = min(longest, log(PREDICTOR_TOLERANCE / size) / k)
        if longest > best:
            best, step.used_order = longest, order
    h, first = exp(best), control.first_step
    return min(h, first) if memory.run.equations.system.counts.steps == 0 and first > 0.0 else h


@kernel
def attempt_predictor_step(h, last, memory):
    """Correct the end of a predictor step of h seconds, judge the step, and expand the series at its end.

    Return OK, SINGULAR_AHEAD if the step contains a singular position or ends near a singular position, or
    the failure status.
    """
    status = expand_at(h, last, memory)
    if status != OK:
        return status
    pivot = least_pivot(memory)
    memory.step.crossed = memory.kernels.detect(h, pivot, memory)
    if memory.step.crossed or ends_near_singular(pivot, memory):
        return SINGULAR_AHEAD
    off, order = error_of_motion(h, memory)[0], memory.mode.order
    is_continued = isfinite(off) and off <= LOST_MOTION * order * order * PREDICTOR_TOLERANCE
    is_accepted = is_continued and memory.step.violation <= LOST_ROWS * PREDICTOR_TOLERANCE
    return OK if is_accepted else STEP_TOO_SMALL


@kernel
def start_accurate_steps(ahead, stop, memory):
    """Start high-accuracy steps before a singular position, a time ``ahead`` (s) away.

    If the singular position is far, first take a predictor step to the distance from which one step crosses
    the position.  Return SINGULAR_AHEAD or the failure status.
    """
    h = length_before(ahead, memory)
    memory.kernels.return_to_start(memory)
    memory.step.crossed = 0
    if 0.0 < h < stop - memory.run.loop.clock.time:
        if attempt_predictor_step(h, True, memory) == OK:
            end_step(h, stop, memory)
            ahead -= h
        else:
            memory.kernels.return_to_start(memory)
            memory.step.crossed = 0
    set_high_accuracy(memory)
    memory.distance.time_to_crossing = ahead
    status = memory.kernels.expand(memory.run.loop.clock.time, memory)
    return SINGULAR_AHEAD if status == OK else status


@kernel
def length_before(ahead, memory):
    """Return the length (s) of a predictor step to the distance from which a high-accuracy step crosses best.

    The length follows from the terms of the present series, whose order is lower. The result is 0 if the step
    would be short.
    """
    order, accurate_order = memory.mode.order, memory.options.accurate_order
    across = longest_step(ACCURATE_TOLERANCE ** (order / accurate_order), memory)
    h = ahead - CROSSING_START * across
    return h if h > MIN_PREDICTOR_RATIO * across else 0.0
