"""Passing singular positions: step over the window where the motion is ill-determined.

Where the rank of Φ_q drops, the component of the acceleration along the vanishing singular vector is
spoilt by rounding and by the violation of the stages, both divided by the distance to the singular
position; an adaptive integrator then shortens its step and ends up sitting inside.  So, where the chart
watches the smallest pivot of Φ_q relative to the largest it has had (``MEMO``):

- a step ends at the edge of the window, where that ratio is WINDOW;
- the window is crossed in one leap: the state is extrapolated by the Hermite polynomial through earlier
  states and rates, and projected on the other side, where Newton's method finds the smooth branch,
  because branches cross at an angle.
"""

from __future__ import annotations

from mbref.kernels.compilation import kernel
from mbref.kernels.layout import MEMO, REFERENCE_PIVOT, SMALLEST_PIVOT
from mbref.linear_algebra.vectors import copy

WINDOW = 1e-3  # relative pivot at the edge: rounding of 1e-16 costs 1e-13 there
NEAR = 0.05  # below it the relative pivot is taken to fall linearly
KEPT = 48  # states kept; a leap uses NODES of them, at least APART times its length apart
NODES = 4
APART = 2.0  # the extrapolation then magnifies rounding 14-fold; at 0.5 it was a thousandfold
NEVER = 1e300


@kernel
def relative_pivot(work):
    """Smallest pivot of Φ_q over the largest it has had; 1 where the chart does not watch it."""
    reference = work[MEMO][0, REFERENCE_PIVOT]
    return work[MEMO][0, SMALLEST_PIVOT] / reference if reference > 0.0 else 1.0


@kernel
def keep_state(history, taken, t, pivot, y, y_rate):
    """Row taken mod KEPT of ``history`` := t, relative pivot, y, y'."""
    row, n = taken % KEPT, y.shape[0]
    history[row, 0] = t
    history[row, 1] = pivot
    copy(y, history[row, 2 : 2 + n])
    copy(y_rate, history[row, 2 + n : 2 + 2 * n])


@kernel
def pivot_slope(history, taken):
    """How fast the relative pivot falls (1/s), from its last two values; 0 where no window is near."""
    now, before = taken % KEPT, (taken - 1) % KEPT
    if taken == 0 or history[now, 1] > NEAR or history[now, 0] == history[before, 0]:
        return 0.0
    return max(0.0, (history[before, 1] - history[now, 1]) / (history[now, 0] - history[before, 0]))


@kernel
def to_edge(history, taken):
    """The step that ends just inside the window ahead, or nine tenths of the way; NEVER where it is far."""
    slope, pivot = pivot_slope(history, taken), history[taken % KEPT, 1]
    if slope == 0.0 or pivot <= WINDOW:
        return NEVER
    return (pivot - max(0.9 * WINDOW, 0.1 * pivot)) / slope  # the slope of a long step is a rough one


@kernel
def has_fallen_in(history, taken, work):
    """Whether a step ends deep in a window that was not near before it."""
    return history[taken % KEPT, 1] > NEAR and relative_pivot(work) < 0.5 * WINDOW


@kernel
def leap_length(history, taken):
    """The step across the window that the last state stands in, to its far edge; 0 for none."""
    slope, pivot = pivot_slope(history, taken), history[taken % KEPT, 1]
    if slope == 0.0 or pivot > WINDOW:
        return 0.0
    return 2.0 * (pivot + WINDOW) / slope  # the slope is known to a factor of two


@kernel
def choose_nodes(history, taken, spacing, nodes):
    """Rows of up to NODES kept states, the last first, at least ``spacing`` apart; their number."""
    nodes[0] = taken % KEPT
    found, latest = 1, history[taken % KEPT, 0]
    for back in range(1, min(taken, KEPT - 1) + 1):
        row = (taken - back) % KEPT
        if found < NODES and latest - history[row, 0] >= spacing:
            nodes[found] = row
            found += 1
            latest = history[row, 0]
    return found


@kernel
def extrapolate(history, nodes, found, t, y, y_rate, table):
    """y(t) and y'(t) of the Hermite polynomial through the nodes, by divided differences."""
    n, size = y.shape[0], 2 * found
    for i in range(n):
        for k in range(found):
            row = nodes[k]
            for twin in range(2):
                table[0, 2 * k + twin] = history[row, 0]
                table[1, 2 * k + twin] = history[row, 2 + i]
        for order in range(1, size):
            for k in range(size - 1, order - 1, -1):
                width = table[0, k] - table[0, k - order]
                if width == 0.0:
                    table[1, k] = history[nodes[k // 2], 2 + n + i]
                else:
                    table[1, k] = (table[1, k] - table[1, k - 1]) / width
        value, rate = table[1, size - 1], 0.0
        for k in range(size - 2, -1, -1):
            rate = rate * (t - table[0, k]) + value
            value = value * (t - table[0, k]) + table[1, k]
        y[i], y_rate[i] = value, rate
