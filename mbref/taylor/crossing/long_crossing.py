"""Long crossings: high-accuracy steps across singular positions until the distance is large enough, confirmed
by a perturbed run.

A long crossing follows if a short crossing (``short_crossing``) cannot show that the motion is determined.
The order of the steps is lower here, because lower orders amplify rounding less. Unless drivers prescribe the
whole motion, a perturbed run repeats the crossing (``uniqueness``).
"""

from __future__ import annotations

from mbref.kernels.compilation import FLOAT, INT, entry, kernel
from mbref.kernels.layout import OK
from mbref.stepping.loop import DONE, PAUSED, TOO_MANY_STEPS, UNDECIDED
from mbref.taylor.crossing.thresholds import LONG_CROSSING_ORDER, PIVOT_CLEAR
from mbref.taylor.crossing.uniqueness import perturbed_run_agrees
from mbref.taylor.layout import SERIES
from mbref.taylor.mode import set_high_accuracy, set_regular
from mbref.taylor.partition import freedoms, least_pivot
from mbref.taylor.samples import put_state_at, put_terms
from mbref.taylor.saved_state import restore_state, save_state
from mbref.taylor.step_start import save_series


@entry(INT(SERIES))
def begin_crossing(memory):
    """Start high-accuracy steps at the present state; return OK."""
    start_crossing(memory)
    return OK


@kernel
def start_crossing(memory):
    """Start a crossing by high-accuracy steps at the present state."""
    mode, distance = memory.mode, memory.distance
    set_high_accuracy(memory)
    mode.order = min(mode.order, LONG_CROSSING_ORDER)
    distance.start_pivot, distance.clearance, distance.is_clear = 1.0, 0.0, 0
    save_state(memory.run, memory.crossing_start)


@entry(INT(SERIES))
def cross_position(memory):
    """Begin a series at the present state, and cross the first singular position ahead
    (``continue_crossing``)."""
    start_crossing(memory)
    status = memory.kernels.begin(memory)
    memory.distance.entry_pivot = least_pivot(memory)
    return step_until_clear(memory) if status == OK else status


@entry(INT(SERIES))
def continue_crossing(memory):
    """Cross the next singular position, which is recorded, or continue until no singular position is near.

    Return PAUSED, DONE at the end, or the failure status.  ``distance.is_clear``
    is set when regular steps can follow: the least pivot is large enough, and not smaller than a step ago.
    """
    return step_until_clear(memory)


@kernel
def step_until_clear(memory):
    """Take the steps of ``continue_crossing``."""
    clock, counts, progress = memory.run.loop.clock, memory.run.equations.system.counts, memory.progress
    crossings = counts.crossings
    while counts.steps < memory.run.control.most_steps:
        status = memory.kernels.step(memory)
        if status != OK:
            put_terms(memory.series.past, memory)
            return status
        if counts.crossings != crossings:
            memory.kernels.record(memory)
        put_terms(memory.series.terms, memory)
        if clock.time >= progress.end:
            return DONE
        judge_clearance(memory)
        if memory.distance.is_clear or counts.crossings != crossings:
            return PAUSED
    return TOO_MANY_STEPS


@kernel
def judge_clearance(memory):
    """Decide whether regular steps can follow."""
    distance, clock, before = memory.distance, memory.run.loop.clock, memory.distance.clearance
    distance.clearance = least_pivot(memory) / (PIVOT_CLEAR * distance.largest_pivot)
    distance.is_clear = distance.clearance >= max(before, 1.0) and clock.time >= clock.attempt_end


@entry(INT(INT, SERIES))
def end_crossing(status, memory):
    """Return to regular steps after a crossing that ended with a status.

    Return PAUSED, DONE or the failure status; UNDECIDED if a perturbed run ends at another state. Steps of
    the perturbed run are not counted.
    """
    run, counts = memory.run, memory.run.equations.system.counts
    if status == PAUSED or status == DONE:  # noqa: SIM109 - no containers in kernels
        steps, rejected, factorisations = counts.steps, counts.rejected, counts.factorisations
        save_state(run, memory.crossing_result)
        if freedoms(memory) > 0 and not perturbed_run_agrees(run.control.rtol, memory):
            status = UNDECIDED
        restore_state(memory.crossing_result, run)
        counts.steps, counts.rejected, counts.factorisations = steps, rejected, factorisations
        memory.progress.end = run.loop.times[run.loop.times.shape[0] - 1]
    elif status != TOO_MANY_STEPS:
        status = UNDECIDED
    set_regular(memory)
    return status


@entry(INT(FLOAT, SERIES))
def put_state_along(h, memory):
    """Put the state at a distance h (s) from the start of the present series into memory; return OK."""
    save_series(memory)
    put_state_at(h, memory)
    return OK
