"""Kernels that Python calls in a run by Taylor series: the start of a series, and many steps in one call."""

from __future__ import annotations

from mbref.kernels.compilation import INT, entry
from mbref.kernels.layout import OK, SINGULAR_AHEAD
from mbref.stepping.loop import DONE, PAUSED, TOO_MANY_STEPS
from mbref.taylor.crossing.short_crossing import cross_briefly, is_full, switches_branch
from mbref.taylor.layout import SERIES
from mbref.taylor.samples import put_angles, put_terms
from mbref.taylor.stepping import begin_once


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
    return PAUSED
