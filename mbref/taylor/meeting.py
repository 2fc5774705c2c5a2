"""A series near a singular position without its rounding: the motion that meets it, for one that misses it.

Rounding puts a state on a motion that misses the singular position by a gap g.  At a time d from it, with a
least pivot p, that motion differs from the one that meets it by (g / p) d / (d - t) in the direction in which
the rows fail there.  The terms of this difference, (g / p) / d^k, grow faster than those of the motion, so
that the last ones tell it.  Without it a step may be many times as long as d.
"""

from __future__ import annotations

from mbref.kernels.compilation import kernel
from mbref.taylor.passage import BEFORE, size_in_use
from mbref.taylor.simd import WIDTH, load, store

LEAST_ORDER = 10
PURE = 1e-3  # relative difference of two ratios of terms that show rounding alone
MISSED = 3e-16  # gap, of unit rows, that rounding explains
LEFT = 0.25  # of the growth of rounding over two orders: terms that grow faster are rounding
TOLD = 3  # last orders that are spent on telling the difference, and one
LEAST_TOP = 4


@kernel
def time_to_meet(memory):
    """The time (s) to the singular position that the series in use misses by rounding; 0 where it misses none
    or its last terms show anything else.  Negative times are of a position behind."""
    progress, past = memory.progress, memory.series.past
    order, is_near = progress.order, progress.past_pivot < BEFORE * progress.largest_pivot
    if order < LEAST_ORDER or not (progress.passing or is_near):
        return 0.0
    i = place_of_largest(order, memory)
    last, before = past[order, i], past[order - 1, i]
    if last == 0.0 or not abs(before * before - last * past[order - 2, i]) <= PURE * before * before:
        return 0.0
    distance, miss = before / last, abs(last)
    for _ in range(order):
        miss *= abs(distance)
    return distance if miss * progress.past_pivot <= MISSED else 0.0


@kernel
def meet(distance, memory):
    """Have the series in use meet a singular position at a distance (s): without its miss, and up to the last
    order that is not rounding (``progress.top``)."""
    progress = memory.progress
    subtract_miss(distance, memory)
    progress.top = last_order(distance, memory)
    progress.cut, progress.meets = progress.top, distance


@kernel
def place_of_largest(order, memory):
    """The variable whose term of an order is the largest."""
    place, past = 0, memory.series.past
    for i in range(1, memory.solver.pivot_columns.shape[0]):
        if abs(past[order, i]) > abs(past[order, place]):
            place = i
    return place


@kernel
def subtract_miss(distance, memory):
    """Subtract terms of the ratio 1 / distance that end with the last ones."""
    series, order, factor = memory.series, memory.progress.order, 1.0
    past, variable, angles = series.past, series.variable, series.past_angles
    lanes = past.shape[1]
    for k in range(order - 1, -1, -1):
        of_angles, factor = factor, factor * distance
        for j in range(0, memory.solver.pivot_columns.shape[0], WIDTH):
            missed = factor * (load(variable, j) * load(past, order * lanes + j))
            store(load(past, k * lanes + j) - missed, past, k * lanes + j)
        for s in range(angles.shape[0]):
            if k < order - 1:  # angles have no last order
                angles[s, k] -= of_angles * angles[s, order - 1]


@kernel
def last_order(distance, memory):
    """The last order whose terms do not grow as fast as rounding."""
    k, growth = memory.progress.order - TOLD, LEFT / (distance * distance)
    size, one_less = size_in_use(k, memory), size_in_use(k - 1, memory)
    while k > LEAST_TOP:
        two_less = size_in_use(k - 2, memory)
        if not size > growth * two_less:
            break
        k, size, one_less = k - 1, one_less, two_less
    return k
