"""Passing singular positions: step over the window in which the motion is ill-determined.

Where the rank of Φ_q drops, the component of the acceleration along the vanishing singular vector is
spoilt by rounding and by the violation of the stages, both divided by the distance to the singular
position; an adaptive integrator then shortens its step and ends up sitting inside.  So, where the chart
watches the smallest pivot of Φ_q relative to the largest it has had (``layout.Watch``):

- a step ends at the edge of the window, where that ratio is WINDOW;
- the window is crossed in one leap: the state is extrapolated by the Hermite polynomial through earlier
  states and rates, and projected on the other side, where Newton's method finds the smooth branch,
  because branches cross at an angle.
"""

from __future__ import annotations

from mbref.kernels.compilation import kernel
from mbref.linear_algebra.vectors import copy

WINDOW = 1e-3  # relative pivot at the edge: rounding of 1e-16 costs 1e-13 there
NEAR = 0.05  # below it the relative pivot is taken to fall linearly
NODES = 4  # states of a leap, at least APART times its length apart
APART = 2.0  # the extrapolation then magnifies rounding 14-fold; at 0.5 it was a thousandfold
FAR = 1e300


@kernel
def relative_pivot(watch):
    """Smallest pivot of Φ_q over the largest it has had; 1 where the chart does not watch it."""
    reference = watch.reference_pivot
    return watch.smallest_pivot / reference if reference > 0.0 else 1.0


@kernel
def remember_state(taken, y, y_rate, memory):
    """Row taken mod KEPT of the history := t, relative pivot, y, y'."""
    history = memory.loop.history
    row, n = taken % history.time.shape[0], y.shape[0]
    history.time[row] = memory.loop.clock.time
    history.pivot[row] = relative_pivot(memory.watch)
    copy(y, history.y[row, :n])
    copy(y_rate, history.y_rate[row, :n])


@kernel
def pivot_slope(history, taken):
    """How fast the relative pivot falls (1/s), from its last two values; 0 where no window is near."""
    kept, time, pivot = history.time.shape[0], history.time, history.pivot
    now, before = taken % kept, (taken - 1) % kept
    if taken == 0 or pivot[now] > NEAR or time[now] == time[before]:
        return 0.0
    return max(0.0, (pivot[before] - pivot[now]) / (time[now] - time[before]))


@kernel
def step_to_edge(history, taken):
    """The step that ends just inside the window ahead, or nine tenths of the way; FAR where it is far."""
    slope, pivot = pivot_slope(history, taken), history.pivot[taken % history.time.shape[0]]
    if slope == 0.0 or pivot <= WINDOW:
        return FAR
    return (pivot - max(0.9 * WINDOW, 0.1 * pivot)) / slope  # the slope of a long step is a rough one


@kernel
def has_fallen_in(history, taken, watch):
    """Whether a step ends deep in a window that was not near before it."""
    return history.pivot[taken % history.time.shape[0]] > NEAR and relative_pivot(watch) < 0.5 * WINDOW


@kernel
def leap_length(history, taken):
    """The step across the window that the last state stands in, to its far edge; 0 for none."""
    slope, pivot = pivot_slope(history, taken), history.pivot[taken % history.time.shape[0]]
    if slope == 0.0 or pivot > WINDOW:
        return 0.0
    return 2.0 * (pivot + WINDOW) / slope  # the slope is known to a factor of two


@kernel
def choose_nodes(history, taken, spacing):
    """Choose up to NODES states as nodes, the last first, at least ``spacing`` (s) apart; their number."""
    kept, time, nodes = history.time.shape[0], history.time, history.nodes
    nodes[0] = taken % kept
    found, latest = 1, time[taken % kept]
    for back in range(1, min(taken, kept - 1) + 1):
        row = (taken - back) % kept
        if found < NODES and latest - time[row] >= spacing:
            nodes[found] = row
            found += 1
            latest = time[row]
    return found
