"""Long crossings: exact steps over singular positions until clear of them, confirmed by a second run.

They take their turn where a brief crossing (``mbref.taylor.brief``) does not show that the motion is
determined.  The order of the exact steps is lower here, because lower orders magnify rounding less.  Unless
drivers prescribe the whole motion, the crossing is repeated from velocities that are a little larger
(``mbref.taylor.twin``): where both end apart, the motion is not determined.
"""

from __future__ import annotations

from mbref.kernels.compilation import FLOAT, INT, entry, kernel
from mbref.kernels.layout import OK
from mbref.simulation.stepping import DONE, PAUSED, TOO_MANY_STEPS, UNDECIDED
from mbref.taylor.brief import record_crossings, step_exactly, step_usually
from mbref.taylor.layout import SERIES
from mbref.taylor.partition import freedoms
from mbref.taylor.passage import AHEAD, least_pivot
from mbref.taylor.samples import put_state_at, put_terms
from mbref.taylor.saved_state import restore_state, save_state
from mbref.taylor.stepping import keep_terms
from mbref.taylor.twin import twin_agrees

ORDER = 16  # of the series, at most
CLEAR = 3.0  # least pivots over that of ``AHEAD``: from there on usual steps go on


@entry(INT(SERIES))
def begin_crossing(memory):
    """Have exact steps begin at the present state: OK."""
    begin_exact_steps(memory)
    return OK


@kernel
def begin_exact_steps(memory):
    """Have a crossing begin at the present state, by exact steps."""
    progress = memory.progress
    step_exactly(memory)
    progress.order, progress.clearance, progress.is_clear = min(progress.order, ORDER), 0.0, 0
    save_state(memory.run, memory.crossing_start)


@entry(INT(SERIES))
def cross(memory):
    """Begin a series at the present state, and cross the first singular position ahead (``go_on``)."""
    begin_exact_steps(memory)
    status = memory.kernels.begin(memory)
    memory.progress.entered = least_pivot(memory)
    return step_on(memory) if status == OK else status


@entry(INT(SERIES))
def go_on(memory):
    """Cross the next singular position, which is recorded, or step clear of all of them: PAUSED; DONE at the
    end, else the reason why the motion cannot be followed.

    ``progress.is_clear`` says whether usual steps go on from here: the series is as clear as they need, and
    no nearer to a singular position than a step ago.
    """
    return step_on(memory)


@kernel
def step_on(memory):
    """The steps of ``go_on``."""
    clock, counts, progress = memory.run.loop.clock, memory.run.equations.system.counts, memory.progress
    passed = counts.crossings
    while counts.steps < memory.run.control.most_steps:
        status = memory.kernels.step(memory)
        if status != OK:
            put_terms(memory.series.past, memory)
            return status
        if counts.crossings != passed:
            record_crossings(memory)
        put_terms(memory.series.terms, memory)
        if clock.time >= progress.end:
            return DONE
        judge_clearance(memory)
        if progress.is_clear or counts.crossings != passed:
            return PAUSED
    return TOO_MANY_STEPS


@kernel
def judge_clearance(memory):
    """Find whether usual steps may go on."""
    progress, clock = memory.progress, memory.run.loop.clock
    before = progress.clearance
    progress.clearance = least_pivot(memory) / (CLEAR * AHEAD * progress.largest_pivot)
    progress.is_clear = progress.clearance >= max(before, 1.0) and clock.time >= clock.passage


@entry(INT(INT, SERIES))
def end_crossing(status, memory):
    """Have usual steps follow a crossing that ended with a status: PAUSED or DONE, else the reason why the
    motion cannot be followed.

    UNDECIDED where a second run of the crossing ends elsewhere; steps of that run are not counted.
    """
    run, counts = memory.run, memory.run.equations.system.counts
    if status == PAUSED or status == DONE:  # noqa: SIM109 - no containers in kernels
        steps, rejected, factorisations = counts.steps, counts.rejected, counts.factorisations
        save_state(run, memory.landed)
        if freedoms(memory) > 0 and not twin_agrees(run.control.rtol, memory):
            status = UNDECIDED
        restore_state(memory.landed, run)
        counts.steps, counts.rejected, counts.factorisations = steps, rejected, factorisations
        memory.progress.end = run.loop.times[run.loop.times.shape[0] - 1]
    elif status != TOO_MANY_STEPS:
        status = UNDECIDED
    step_usually(memory)
    return status


@entry(INT(FLOAT, SERIES))
def look_along(h, memory):
    """Put the state at a distance h (s) from where the series now begins into memory: OK."""
    keep_terms(memory)
    memory.progress.cut = memory.progress.order
    put_state_at(h, memory)
    return OK
