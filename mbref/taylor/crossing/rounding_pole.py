"""Removal of the rounding pole from a series near a singular position.

Rounding moves a state to a motion that passes the singular position at a gap g. Let d be the time to the
singular position and p the least pivot. The motion with rounding differs from the exact motion by (g / p) d /
(d - t) along the direction in which the rows lose rank: a pole at t = d. Its coefficients (g / p) / d^k grow
faster than the coefficients of the motion, so that the last coefficients contain the pole only. After its
removal a step may be many times as long as d.
"""

from __future__ import annotations

from numpy import log

from mbref.kernels.compilation import kernel
from mbref.taylor.coefficients import largest_used
from mbref.taylor.crossing.thresholds import (
    CROSSING_START,
    MAX_GAP,
    MIN_ORDER_LEFT,
    MIN_SERIES_ORDER,
    POLE_GROWTH,
    POLE_ORDERS,
    PURE_POLE,
)
from mbref.taylor.mode import is_accurate
from mbref.taylor.simd import WIDTH, load, store


@kernel
def time_of_pole(memory):
    """Return the time (s) of the pole in the series in use; 0 without a pole.

    The last coefficients must contain a pole only, with a gap that rounding explains. A negative time belongs
    to a position in the past.
    """
    past, order, start_pivot = memory.series.past, memory.mode.order, memory.distance.start_pivot
    is_near = start_pivot < CROSSING_START * memory.distance.largest_pivot
    if order < MIN_SERIES_ORDER or not (is_accurate(memory) or is_near) or start_pivot == 0.0:
        return 0.0
    i = variable_of_largest_term(order, memory)
    last, before = past[order, i], past[order - 1, i]
    if last == 0.0 or before == 0.0:
        return 0.0
    if not abs(1.0 - (last / before) * (past[order - 2, i] / before)) <= PURE_POLE:
        return 0.0
    distance = before / last
    is_rounding = log(abs(last)) + order * log(abs(distance)) <= log(MAX_GAP / start_pivot)
    return distance if is_rounding else 0.0


@kernel
def remove_pole(distance, memory):
    """Subtract the pole at a time (s) from the series in use, and compute its last order above rounding."""
    step = memory.step
    subtract_pole(distance, memory)
    step.last_order = last_order(distance, memory)
    step.used_order, step.time_to_pole = step.last_order, distance


@kernel
def variable_of_largest_term(order, memory):
    """Return the variable whose coefficient of an order is the largest."""
    place, past = 0, memory.series.past
    for i in range(1, memory.solver.pivot_columns.shape[0]):
        if abs(past[order, i]) > abs(past[order, place]):
            place = i
    return place


@kernel
def subtract_pole(distance, memory):
    """Subtract the pole: coefficients with the ratio 1 / distance that agree with the last coefficients of
    the series."""
    series, order, factor = memory.series, memory.mode.order, 1.0
    past, variable, angles = series.past, series.variable, series.past_angles
    lanes = past.shape[1]
    for k in range(order - 1, -1, -1):
        of_angles, factor = factor, factor * distance
        for j in range(0, memory.solver.pivot_columns.shape[0], WIDTH):
            pole = factor * (load(variable, j) * load(past, order * lanes + j))
            store(load(past, k * lanes + j) - pole, past, k * lanes + j)
        for s in range(angles.shape[0]):
            if k < order - 1:  # angles have no last order
                angles[s, k] -= of_angles * angles[s, order - 1]


@kernel
def last_order(distance, memory):
    """Return the last order whose coefficients grow less with the order than rounding does."""
    k, growth = memory.mode.order - POLE_ORDERS, POLE_GROWTH / (distance * distance)
    size, one_less = largest_used(k, memory), largest_used(k - 1, memory)
    while k > MIN_ORDER_LEFT:
        two_less = largest_used(k - 2, memory)
        if not size > growth * two_less:
            break
        k, size, one_less = k - 1, one_less, two_less
    return k
