"""Whether a passage is determined: a twin that begins with velocities a little faster ends at the same place.

The state before a singular position is known to the run's tolerance alone, and the passage may magnify its
error.  Drivers that prescribe the whole motion leave nothing to magnify.
"""

from __future__ import annotations

from mbref.kernels.compilation import kernel
from mbref.kernels.layout import OK
from mbref.linear_algebra.vectors import copy, larger
from mbref.taylor.passage import size_of
from mbref.taylor.saved_state import restore_state

LEAST_CHANGE = 1e-9  # of the velocities of a twin
MAGNIFIED, APART = 100.0, 1e-2  # lengths by which twins end apart: over the change, and whatever it is
CLOSER = 0.1  # the same, over as many singular positions as the twin did not count
FASTER = 10.0  # the same of velocities, over the fastest


@kernel
def twin_agrees(rtol, memory):
    """Whether a twin of the passage, changed by a relative tolerance, comes to where the series begins now.

    Nearer, where it counts another number of singular positions: a step may pass two.
    """
    run, landing, terms = memory.run, memory.crossing_end, memory.series.terms
    passed, change = run.equations.system.counts.crossings, max(rtol, LEAST_CHANGE)
    for order in range(2):
        copy(terms[order], landing[order])
    if not follow_twin(change, run.loop.clock.time, memory):
        return False
    places, rates, variables = 0.0, 0.0, memory.solver.pivot_columns.shape[0]
    for i in range(variables):
        places = larger(places, terms[0, i] - landing[0, i])
        rates = larger(rates, terms[1, i] - landing[1, i])
    near = min(MAGNIFIED * change, APART)
    if run.equations.system.counts.crossings != passed:
        near *= CLOSER
    return places <= near and rates <= FASTER * near * size_of(landing, 1, variables)


@kernel
def follow_twin(change, until, memory):
    """Go on to a time (s) from the beginning of the passage, velocities changed: whether that is possible."""
    run, clock, counts = memory.run, memory.run.loop.clock, memory.run.equations.system.counts
    restore_state(memory.crossing_start, run)
    for i in range(run.state.velocities.shape[0]):
        run.state.velocities[i] *= 1.0 + change
    clock.sample, memory.progress.end = run.loop.times.shape[0], until  # no samples of its own
    status = memory.kernels.begin(memory)
    while status == OK and clock.time < until and counts.steps < run.control.most_steps:
        status = memory.kernels.step(memory)
    return status == OK and clock.time >= until
