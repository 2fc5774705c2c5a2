"""The watch for singular positions: which steps may pass one.

Where the rank of Φ_q drops, a pivot of its rows falls to zero and rises again.  The pivots are those of unit
rows in columns of unit length (``equations.units``), so that masses have no part in them; the projection has
them at hand after every step (``layout.Watch``).  Close to a singular position the component of the
acceleration along the vanishing singular vector is spoilt by rounding and by the violation of the stages,
both divided by the distance, and a step over it may land on a branch that the motion does not reach.  Such a
step is not taken; the Taylor series of ``mbref.taylor`` takes its place.
"""

from __future__ import annotations

from mbref.kernels.compilation import kernel
from mbref.linear_algebra.vectors import copy

WINDOW = 0.1  # relative pivot below which a singular position is near
ON_IT = 1e-7  # relative pivot of a run that begins on one: its first step leaves it
SHARP = 3.0  # times a pivot's fall in the time of a step: a larger pivot has not vanished inside
SMALLEST = 1e-4  # pivot of a row below which it is as good as redundant, and is not compared


@kernel
def relative_pivot(watch):
    """Smallest pivot of Φ_q over the largest it has had; 1 where the chart does not watch it."""
    reference = watch.reference_pivot
    return watch.smallest_pivot / reference if reference > 0.0 else 1.0


@kernel
def is_near(memory):
    """Whether a singular position is near where pivots were last watched."""
    return memory.control.closed_loops > 0.0 and relative_pivot(memory.watch) <= WINDOW


@kernel
def starts_near(memory):
    """Whether a run begins beside a singular position, but not on it."""
    begins = memory.equations.system.counts.steps == 0
    return begins and is_near(memory) and relative_pivot(memory.watch) > ON_IT


@kernel
def comes_near(memory):
    """Whether a step ends near a singular position, and nearer than it began."""
    return is_near(memory) and memory.watch.smallest_pivot < memory.watch.past_pivot


@kernel
def remember_state(taken, y, y_rate, memory):
    """Row taken mod KEPT of the history := t, pivots, y, y'."""
    history = memory.loop.history
    row, n = taken % history.time.shape[0], y.shape[0]
    memory.watch.past_pivot = memory.watch.smallest_pivot
    history.time[row] = memory.loop.clock.time
    copy(memory.pivots, history.pivots[row])
    copy(y, history.y[row, :n])
    copy(y_rate, history.y_rate[row, :n])


@kernel
def may_have_passed(h, memory):
    """Whether a pivot may have vanished inside a step of h seconds that ends where pivots were last watched.

    So it is where its values at both ends add up to less than what it falls, as fast as in the step before.
    """
    history, taken = memory.loop.history, memory.equations.system.counts.steps
    if memory.control.closed_loops == 0.0 or taken == memory.loop.clock.restart:
        return False
    kept = history.time.shape[0]
    now, before = taken % kept, (taken - 1) % kept
    width = history.time[now] - history.time[before]
    for k in range(memory.pivots.shape[0]):
        start, end = history.pivots[now, k], memory.pivots[k]
        fall = (history.pivots[before, k] - start) / width * h
        if start > SMALLEST and start + end < SHARP * fall:
            return True
    return False
