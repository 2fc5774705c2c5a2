"""Motions that drivers prescribe, followed by series through singular positions.

Where no freedom is left, a step ends where the rows say, whatever the series lost: errors do not add up, and
a series of a loose tolerance serves as a prediction.  G has as many independent rows as variables: its
determinant, the product of the pivots, changes its sign where branches cross.  A stride that may come to a
singular position is taken again by exact steps, which judge it (``mbref.taylor.passage``).
"""

from __future__ import annotations

from numpy import exp, isfinite, log

from mbref.kernels.compilation import INT, entry, kernel
from mbref.kernels.layout import OK, SINGULAR_AHEAD
from mbref.linear_algebra.vectors import larger
from mbref.simulation.stepping import DONE, PAUSED, STEP_TOO_SMALL, TOO_MANY_STEPS, UNDECIDED
from mbref.taylor.advance import begin_once
from mbref.taylor.brief import is_full, record_crossings
from mbref.taylor.crossing import changes_sign
from mbref.taylor.layout import SERIES
from mbref.taylor.passage import (
    AHEAD,
    LONG,
    MOST_PARTS,
    NEAR,
    STEEPEST,
    VANISHING,
    changes_signs,
    distance_ahead,
    inside,
    is_near,
    keeps_signs,
    least_pivot,
    moved_in,
    size_in_use,
    vanishes_inside,
)
from mbref.taylor.samples import evaluate_series, keep_sample, put_terms
from mbref.taylor.stepping import (
    BEST,
    LOST_MOTION,
    LOST_ROWS,
    SHORTER,
    expand_at,
    longest_step,
    remember_series,
    return_to_start,
)

LOOSE, EXACT = 3e-7, 1e-13  # tolerances of series, far from singular positions and near one
KEEPING = 1e-4  # tolerance of strides' corrections, which keep a factor at which the next series is predicted
SHORT = 0.25  # of a step that crosses: shorter strides towards its beginning are not worth it
ORDER, LEAST_ORDER = 16, 12  # of the series, unless another one is asked for; the least that passes


@entry(INT(SERIES))
def follow_drivers(memory):
    """Begin a series unless one has begun, and advance to the end, or by a number of steps or of singular
    positions: DONE, PAUSED, or why the motion cannot be followed."""
    clock, counts, control = memory.run.loop.clock, memory.run.equations.system.counts, memory.run.control
    progress = memory.progress
    status = begin_once(memory)
    if status != OK:
        return status
    if counts.steps == 0:
        progress.entered, progress.tolerance = least_pivot(memory), KEEPING
    for _ in range(int(control.steps_per_call)):
        if counts.steps >= control.most_steps:
            return TOO_MANY_STEPS
        status = step_exactly(memory) if progress.passing else stride(memory)
        if status != OK and status != SINGULAR_AHEAD:
            put_terms(memory.series.past, memory)
            return status
        if clock.time >= progress.end:
            return DONE
        if is_full(memory):
            return PAUSED
    return PAUSED


@kernel
def step_exactly(memory):
    """One step near a singular position: OK, or UNDECIDED where the motion cannot be followed.

    Strides go on behind it.
    """
    progress = memory.progress
    if memory.kernels.step(memory) != OK:
        return UNDECIDED
    if progress.crossed:
        record_crossings(memory)
    pivot = least_pivot(memory)
    is_behind = progress.crossed or pivot >= progress.past_pivot
    if is_behind and pivot >= AHEAD * progress.largest_pivot:
        progress.passing, progress.tolerance, progress.crossed = 0, KEEPING, 0
        progress.order = progress.usual_order
        progress.past_pivot = 0.0
    return OK


@kernel
def stride(memory):
    """One step of a loose tolerance, and the samples on its way: OK or why there is none.

    SINGULAR_AHEAD, ready for exact steps, where it may come to a singular position.
    """
    control, counts, clock, progress = (
        memory.run.control, memory.run.equations.system.counts, memory.run.loop.clock, memory.progress,
    )  # fmt: skip
    fall = (progress.past_pivot - least_pivot(memory)) / max(clock.length, control.smallest_step)
    remember_series(memory)
    left = progress.end - clock.time
    h = min(reach(memory), left)
    if h * fall > progress.past_pivot:
        return approach(progress.past_pivot / fall, left, memory)
    while True:
        status = land(h, h >= left, memory)
        if status == OK:
            put_samples(h, left, memory)
            return OK
        if status == SINGULAR_AHEAD:
            return approach(distance_ahead(h, memory), left, memory)
        counts.rejected += 1
        h *= SHORTER
        return_to_start(memory)
        if not h >= control.smallest_step:
            return status


@kernel
def put_samples(h, left, memory):
    """Keep the samples of a stride of h seconds, and end it."""
    loop, progress = memory.run.loop, memory.progress
    clock, times = loop.clock, loop.times
    now = progress.end if h >= left else clock.time + h
    while clock.sample < times.shape[0] and times[clock.sample] <= now:
        keep_sample(times[clock.sample] - clock.time, memory)
    memory.run.equations.system.counts.steps += 1
    clock.time, clock.length = now, h


@kernel
def reach(memory):
    """The longest stride (s) and, in ``cut``, the order of the series that it takes.

    It is as long as its last two terms, as large as the tolerance, allow.  Near a singular position terms of
    high order are rounding, which grows with the order, so that fewer reach farther.
    """
    progress, control = memory.progress, memory.run.control
    best, progress.cut, largest = 0.0, progress.order, log(control.largest_step)
    fewest = 2 if progress.past_pivot < NEAR * progress.largest_pivot else 4
    for quarters in range(4, fewest - 1, -1):
        order, longest = progress.order * quarters // 4, largest
        for k in range(order - 1, order + 1):
            size = size_in_use(k, memory)
            if size > 0.0:
                longest = min(longest, log(LOOSE / size) / k)
        if longest > best or quarters == 4:
            best, progress.cut = longest, order
    h = exp(best)
    first = control.first_step
    return min(h, first) if memory.run.equations.system.counts.steps == 0 and first > 0.0 else h


@kernel
def land(h, last, memory):
    """Correct where a stride of h seconds ends, judge it and expand there: OK or why it cannot end there."""
    status = expand_at(h, last, memory)
    if status != OK:
        return status
    if may_have_crossed(h, memory):
        return SINGULAR_AHEAD
    is_kept = memory.progress.violation <= LOST_ROWS * LOOSE and goes_on(h, memory)
    return OK if is_kept else STEP_TOO_SMALL


@kernel
def goes_on(h, memory):
    """Whether the new series has the second derivatives of the old one, to the tolerance."""
    progress, state, terms, off = memory.progress, memory.state, memory.series.terms, 0.0
    for i in range(memory.solver.pivot_columns.shape[0]):
        off = larger(off, (2.0 * terms[2, i] - state[2, i]) * h * h)
    return isfinite(off) and off <= LOST_MOTION * progress.order * progress.order * LOOSE


@kernel
def approach(ahead, left, memory):
    """Have exact steps begin where the first one crosses a singular position best: by a stride to there, or
    here where the position, a time ``ahead`` (s), is near.  SINGULAR_AHEAD, or why that cannot be."""
    progress, h = memory.progress, length_before(ahead, memory)
    return_to_start(memory)
    progress.crossed = 0
    if 0.0 < h < left:
        status = land(h, True, memory)
        if status == OK:
            put_samples(h, left, memory)
            ahead -= h
        else:
            return_to_start(memory)
    progress.passing, progress.tolerance, progress.ahead = 1, EXACT, ahead
    progress.order = progress.exact_order
    status = memory.kernels.expand(memory.run.loop.clock.time, memory)
    return SINGULAR_AHEAD if status == OK else status


@kernel
def length_before(ahead, memory):
    """Of a stride (s) to where an exact step crosses a singular position best, by the terms of the present
    series, whose order is lower; 0 where it is short."""
    progress = memory.progress
    across = longest_step(EXACT ** (progress.order / progress.exact_order), memory)
    h = ahead - BEST * across
    return h if h > SHORT * across else 0.0


@kernel
def may_have_crossed(h, memory):
    """Whether a stride of h seconds ends near a singular position, or may have passed one.

    Pivots whose signs stay have vanished twice or never, and twice takes a way that is long beside them: else
    determinants tell.  Two loops that cross one after the other leave the sign at the end, but not those of
    pivots.
    """
    progress, pivot, moved = memory.progress, least_pivot(memory), moved_in(h, memory)
    if not pivot >= AHEAD * progress.largest_pivot:
        return True
    kept, brief = keeps_signs(memory), progress.past_pivot + pivot > STEEPEST * moved
    if brief and kept:
        return False
    looked_at = not (brief or (kept and not is_near(pivot, progress)))
    changes = changes_sign(h, min(int(moved / LONG) + 1, MOST_PARTS), memory)
    if not changes and changes_signs(memory):
        changes = vanishes_inside(h, memory)
    if looked_at and not changes:
        between, ends = inside(h, pivot, memory)
        changes = between - ends < VANISHING
    evaluate_series(h, memory)
    memory.progress.crossed = changes
    return changes
