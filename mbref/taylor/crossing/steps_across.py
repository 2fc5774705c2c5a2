"""High-accuracy steps across singular positions: short crossings and long ones.

A short crossing takes a few steps, if the speed bounds the sensitivity of the continuation. If the bound of
``uniqueness`` is too large, or the steps do not cross, the state is restored, and a long crossing follows.

A long crossing takes steps until the distance from singular positions is large enough. The order of its
steps is lower, because lower orders amplify rounding less. Unless drivers prescribe the whole motion, a
perturbed run repeats the crossing (``uniqueness``).
"""

from __future__ import annotations

from mbref.kernels.compilation import FLOAT, INT, entry, exchangeable, kernel
from mbref.kernels.layout import OK
from mbref.linear_algebra.vectors import copy
from mbref.stepping.loop import DONE, PAUSED, TOO_MANY_STEPS, UNDECIDED
from mbref.taylor.crossing.thresholds import LONG_CROSSING_ORDER, MAX_SHORT_STEPS, PIVOT_CLEAR
from mbref.taylor.crossing.uniqueness import (
    energy_in_middle,
    is_bounded,
    keeps_moving,
    kinetic_energy,
    perturbed_run_agrees,
)
from mbref.taylor.layout import RECORD_CROSSINGS, SERIES
from mbref.taylor.mode import set_high_accuracy, set_regular
from mbref.taylor.partition import freedoms, is_undriven, least_pivot
from mbref.taylor.samples import put_angles, put_state_at, put_terms
from mbref.taylor.saved_state import restore_state, restore_variables, save_series, save_state, save_variables


@kernel
def switches_branch(crossing, memory):
    """Return whether another branch than the smooth branch is requested at a crossing, counted from 1."""
    for number in memory.branch_switches:  # noqa: SIM110 - no generators in kernels
        if number == crossing:
            return True
    return False


@kernel
def is_full(memory):
    """Return whether memory has no room for the crossings of another step, at most two."""
    return memory.progress.recorded + 2 > memory.crossings.time.shape[0]


@kernel
def switches_branch_in_pair(before, memory):
    """Return whether the last step crossed twice, after ``before`` crossings, and another branch than the
    smooth branch is requested at one of the crossings."""
    if memory.run.equations.system.counts.crossings < before + 2:
        return False
    return switches_branch(before + 1, memory) or switches_branch(before + 2, memory)


@kernel
def cross_briefly(memory):
    """Cross the singular position ahead of the start of the last step; if that fails, restore the state and
    return False. The crossing fails with a degree of freedom beside drivers, and with more than one."""
    clock, counts = memory.run.loop.clock, memory.run.equations.system.counts
    if freedoms(memory) > is_undriven(memory) or is_full(memory):
        return False
    time, sample, attempt_end = clock.time, clock.sample, clock.attempt_end
    steps, crossings = counts.steps, counts.crossings
    put_angles(0.0, memory)
    unseen = memory.turns.watch.unseen
    save_variables(memory.series.past, memory.run.equations.angles, memory.step_start)
    memory.kernels.return_to_start(memory)
    set_high_accuracy(memory)
    memory.distance.start_pivot = 1.0
    status = memory.kernels.expand(time, memory)
    if time == 0.0:
        status = memory.kernels.judge_start(status, memory)
    has_crossed = status == OK and take_crossing_steps(memory)
    set_regular(memory)
    if not has_crossed:
        clock.time, clock.sample, clock.attempt_end = time, sample, attempt_end
        counts.steps, counts.crossings = steps, crossings
        restore_variables(memory.step_start, memory.series.past, memory.run.equations.angles)
        memory.turns.watch.unseen = unseen
    return has_crossed


@kernel
def take_crossing_steps(memory):
    """Take a few high-accuracy steps until a step crosses; return whether a step crossed and the motion is
    determined."""
    clock, counts, progress = memory.run.loop.clock, memory.run.equations.system.counts, memory.progress
    crossings, is_free = counts.crossings, freedoms(memory) > 0
    first, slower, delay = kinetic_energy(memory.series.terms, memory), 1.0, 0.0
    memory.distance.entry_pivot = least_pivot(memory)
    for _ in range(MAX_SHORT_STEPS):
        if clock.time >= progress.end or memory.kernels.step(memory) != OK:
            return False
        if is_free:
            middle, after = energy_in_middle(memory), kinetic_energy(memory.series.terms, memory)
            if not keeps_moving(min(middle, after), first, memory):
                return False
            delay += clock.length * (slower + 4.0 * first / middle + first / after) / 6.0  # Simpson's rule
            slower = first / after
        if counts.crossings != crossings:
            is_determined = not is_free or is_bounded(delay, memory)
            memory.distance.leaving = is_determined and not switches_branch_in_pair(crossings, memory)
            if memory.distance.leaving:
                memory.kernels.record(memory)
            return memory.distance.leaving
    return False


@exchangeable(RECORD_CROSSINGS)
def record_crossings(memory):
    """Record times and states of the crossings of the last step."""
    record_at(memory.step.first_crossing, memory)
    if memory.step.second_crossing >= 0.0:
        record_at(memory.step.second_crossing, memory)
    return OK


@kernel
def record_at(h, memory):
    """Record time and state at a distance h (s) from the start of the last step."""
    run, crossings, k = memory.run, memory.crossings, memory.progress.recorded
    length = run.loop.clock.length
    put_state_at(h, memory)
    crossings.time[k] = run.loop.clock.time - (length - h)
    copy(run.state.coordinates, crossings.coordinates[k])
    copy(run.state.velocities, crossings.velocities[k])
    memory.progress.recorded = k + 1


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
