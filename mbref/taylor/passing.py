"""The kernels of a passage: from a run to the series and back, over singular positions and clear of them."""

from __future__ import annotations

from mbref.equations.coordinates import copy_state, expand
from mbref.kernels.compilation import FLOAT, INT, entry, kernel
from mbref.kernels.layout import MEMORY, OK
from mbref.linear_algebra.vectors import copy
from mbref.simulation.singular_crossing import WINDOW, relative_pivot
from mbref.simulation.stepping import (
    DONE,
    PAUSED,
    SINGULAR_AHEAD,
    TOO_MANY_STEPS,
    UNDECIDED,
    advance_steps,
    share,
)
from mbref.stabilisation.projection import put_active
from mbref.taylor.brief import (
    crosses,
    is_full,
    may_be_brief,
    parts_at,
    pass_briefly,
    step_exactly,
    step_usually,
)
from mbref.taylor.layout import SERIES
from mbref.taylor.partition import freedoms
from mbref.taylor.passage import AHEAD, least_pivot
from mbref.taylor.samples import project_state, put_state_at, put_terms
from mbref.taylor.saved_state import save_state
from mbref.taylor.stepping import keep_terms
from mbref.taylor.twin import LEAST_CHANGE, twin_agrees

LEAVE = 1.5  # windows: the pivot from which on steps of the run are taken again
CLEAR = 3.0  # of the pivot of ``AHEAD``: the same for a run in series
SHARE = 0.05  # of rtol + atol: the tolerance of a step that is clear of singular positions
CLEARLY = 2.0  # the clearance from which on steps of a run do not take a pivot that rises for one that fell
MOST_STEPS = 20  # behind a brief passage, until steps of the run go on


@entry(INT(MEMORY, SERIES))
def take_over(source, memory):
    """Take the state of a run, where a passage begins, over into the series: OK."""
    take(source, memory)
    return OK


@kernel
def take(source, memory):
    """The state, time and samples of a run, and where its passage begins."""
    hand_over(source, memory.run)
    times = memory.run.loop.times
    memory.run.watch.reference_pivot = source.watch.reference_pivot
    memory.progress.end = times[times.shape[0] - 1]
    save_state(memory.run, memory.crossing_start)


@entry(INT(INT, MEMORY, SERIES))
def advance_over(status, source, memory):
    """Advance a run in steps, by brief passages over singular positions, from where it is PAUSED, or has one
    ahead: DONE at the end, or why it ended.

    PAUSED after the number of steps or of singular positions per call, SINGULAR_AHEAD, the run as it was,
    where a passage cannot be brief.
    """
    while True:
        if status == SINGULAR_AHEAD:
            status = pass_over(source, memory)
        if status != PAUSED or is_full(memory):
            return status
        status = advance_steps(source)
        if status != SINGULAR_AHEAD:
            return status


@kernel
def pass_over(source, memory):
    """Take a run in steps over the singular position ahead, and clear of it: PAUSED; DONE at the end.

    Of a run by projection, whose state is in y, and into which the state behind is put.
    SINGULAR_AHEAD, the run as it was, where the passage cannot be a brief one.
    """
    control, progress, clock = source.control, memory.progress, source.loop.clock
    counts, passed = source.equations.system.counts, progress.passed
    expand(source.loop.y, source.active, source.state)
    take(source, memory)
    progress.usual = SHARE * (control.rtol + control.atol) * share(clock.length, source)
    progress.change, status = max(control.rtol, LEAST_CHANGE), SINGULAR_AHEAD
    step_exactly(memory)
    is_open = not parts_at(counts.crossings + 1, memory) and memory.kernels.begin(memory) == OK
    if is_open and may_be_brief(memory) and crosses(memory):
        step_usually(memory)
        status = step_clear(memory)
        step_exactly(memory)
    if status == SINGULAR_AHEAD:
        progress.passed = passed
    else:
        hand_over(memory.run, source)
    if status == PAUSED:
        clock.y_size = put_active(clock.time, source.loop.y, source)
        clock.restart = counts.steps
    return status


@kernel
def step_clear(memory):
    """Step on until steps of the run go on: PAUSED; DONE at the end, else SINGULAR_AHEAD."""
    clock, progress, counts = memory.run.loop.clock, memory.progress, memory.run.equations.system.counts
    progress.clearance, progress.is_clear = 0.0, 0
    for _ in range(MOST_STEPS):
        if clock.time >= progress.end:
            return DONE
        if progress.is_clear and progress.clearance >= CLEARLY:
            return PAUSED
        status = memory.kernels.step(memory)
        if status == OK:
            judge_clearance(memory)
        elif status != SINGULAR_AHEAD or parts_at(counts.crossings + 1, memory) or not pass_briefly(memory):
            return SINGULAR_AHEAD
    return SINGULAR_AHEAD


@entry(INT(SERIES))
def begin_here(memory):
    """Have the passage begin at the present state: OK."""
    save_state(memory.run, memory.crossing_start)
    return OK


@kernel
def hand_over(source, target):
    """State, time, samples and counts of a run to another of the same scene."""
    copy_state(source.state, target.state)
    copy(source.equations.angles, target.equations.angles)
    mine, theirs = source.loop.clock, target.loop.clock
    for k in range(theirs.sample, mine.sample):
        copy(source.loop.samples.coordinates[k], target.loop.samples.coordinates[k])
        copy(source.loop.samples.velocities[k], target.loop.samples.velocities[k])
        copy(source.loop.samples.accelerations[k], target.loop.samples.accelerations[k])
        copy(source.loop.samples.multipliers[k], target.loop.samples.multipliers[k])
    theirs.time, theirs.sample, theirs.passage = mine.time, mine.sample, mine.passage
    copy_counts(source.equations.system.counts, target.equations.system.counts)


@kernel
def copy_counts(source, target):
    """All counts of one run to another."""
    target.steps, target.rejected, target.evaluations = source.steps, source.rejected, source.evaluations
    target.factorisations, target.newton = source.factorisations, source.newton
    target.crossings = source.crossings


@entry(INT(SERIES))
def cross(memory):
    """Begin a series at the present state, and step over the first singular position (``pass_on``)."""
    progress = memory.progress
    progress.past_pivot, progress.clearance, progress.is_clear = 1.0, 0.0, 0
    status = memory.kernels.begin(memory)
    progress.entered = least_pivot(memory)
    return step_on(memory) if status == OK else status


@entry(INT(SERIES))
def pass_on(memory):
    """Step over the next singular position, or clear of all of them: PAUSED; DONE at the end.

    ``progress.is_clear`` says whether steps of the run go on from here: the series is as clear as they need,
    and no nearer to a singular position than a step ago.
    """
    return step_on(memory)


@kernel
def step_on(memory):
    """The steps of ``pass_on``; ``crossing`` is the first singular position that the last one passed."""
    clock, counts, progress = memory.run.loop.clock, memory.run.equations.system.counts, memory.progress
    passed = counts.crossings
    while counts.steps < memory.run.control.most_steps:
        status = memory.kernels.step(memory)
        if status != OK:
            put_terms(memory.series.past, memory)
            return status
        if counts.crossings != passed:
            keep_crossing(progress.first, memory)
        if clock.time >= progress.end:
            return DONE
        judge_clearance(memory)
        if progress.is_clear or counts.crossings != passed:
            return PAUSED
    return TOO_MANY_STEPS


@entry(INT(SERIES))
def keep_second_crossing(memory):
    """Keep where the last step crossed for the second time: OK."""
    keep_crossing(memory.progress.second, memory)
    return OK


@kernel
def keep_crossing(h, memory):
    """Keep the state at a distance h (s) from where the last step began; that in memory stays behind it."""
    run, length = memory.run, memory.run.loop.clock.length
    copy_state(run.state, run.previous)
    put_state_at(h, memory)
    save_state(run, memory.crossing)
    copy_state(run.previous, run.state)
    memory.crossing.instant.time -= length - h


@kernel
def judge_clearance(memory):
    """Find whether steps of the run may go on."""
    progress, clock = memory.progress, memory.run.loop.clock
    before = progress.clearance
    progress.clearance = clearance(memory)
    progress.is_clear = progress.clearance >= max(before, 1.0) and clock.time >= clock.passage


@kernel
def clearance(memory):
    """Distance from a singular position, over that from which steps of the run go on: the lesser of two.

    One is by the pivots that steps of the run watch, one by those of series of a loose tolerance.
    """
    run, progress = memory.run, memory.progress
    put_terms(memory.series.terms, memory)
    project_state(run.loop.clock.time, run)
    ahead = CLEAR * AHEAD * progress.largest_pivot
    return min(relative_pivot(run.watch) / (LEAVE * WINDOW), least_pivot(memory) / ahead)


@entry(INT(INT, MEMORY, SERIES))
def give_back(status, target, memory):
    """Hand the run back where the passage ended with a status: PAUSED, DONE, or why it cannot go on.

    UNDECIDED where a twin of the passage ends elsewhere.
    """
    hand_over(memory.run, target)
    if status == TOO_MANY_STEPS:
        return status
    if status != PAUSED and status != DONE:
        return UNDECIDED
    is_determined = freedoms(memory) == 0 or twin_agrees(target.control.rtol, memory)
    return status if is_determined else UNDECIDED


@entry(INT(FLOAT, SERIES))
def look_along(h, memory):
    """Put the state at a distance h (s) from where the series now begins into memory."""
    keep_terms(memory)
    memory.progress.cut = memory.progress.order
    put_state_at(h, memory)
    return OK
