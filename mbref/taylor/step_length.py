"""Lengths of steps: as long as the last terms of the series allow, and adapted near singular positions.

Lengths follow À.  Jorba and M.  Zou (Experimental Mathematics 14, 2005).
"""

from __future__ import annotations

from numpy import exp, log

from mbref.kernels.compilation import kernel
from mbref.stepping.loop import share
from mbref.taylor.coefficients import largest_used
from mbref.taylor.crossing.acceptance import crossing_tolerance, step_tolerance
from mbref.taylor.crossing.detection import ends_deep, time_to_singular_position
from mbref.taylor.crossing.thresholds import (
    CROSSING_MARGIN,
    CROSSING_START,
    LOOSER_RATES,
    MIN_PIVOT_RATIO,
    OVERSHOOT,
)
from mbref.taylor.loads import time_to_no_length
from mbref.taylor.mode import is_accurate

SHORTER = 0.7  # length of the next attempt / length of the failed attempt


@kernel
def longest_step(tolerance, memory):
    """Return the step (s) at which the last two terms of the series are as large as the tolerance.

    The terms of the rates must also be that small, relative to the largest rate if that is above 1.
    High-accuracy steps have a larger tolerance of rates, and near a singular position rates are ignored. A
    step ends shortly after a position at which a spring has zero length.
    """
    step, control, is_first = memory.step, memory.run.control, memory.run.equations.system.counts.steps == 0
    h = control.largest_step
    shortest, of_rates = log(h), tolerance * max(1.0, largest_used(1, memory))
    if is_accurate(memory):
        of_rates *= LOOSER_RATES
    is_far = memory.distance.start_pivot >= CROSSING_START * memory.distance.largest_pivot
    for k in range(step.last_order - 1, min(step.last_order + 1, memory.mode.order) + 1):
        size = largest_used(k, memory)
        if size > 0.0:
            shortest = min(shortest, log(tolerance / size) / k)
            if is_far or not is_accurate(memory):
                shortest = min(shortest, log(of_rates / (k * size)) / (k - 1))
    h = min(exp(shortest), OVERSHOOT * time_to_no_length(memory))
    return min(h, control.first_step) if is_first and control.first_step > 0.0 else h


@kernel
def first_lengths(left, memory):
    """Return the longest step (s) by the tolerance, and the longest step that crosses; both are at most the
    remaining time."""
    step = memory.step
    if not is_accurate(memory):
        part = share(memory.run.loop.clock.length, memory.run)
        regular = min(longest_step(part * step_tolerance(memory), memory), left)
        return regular, regular
    tight, loose = step_tolerance(memory), crossing_tolerance(memory)
    regular = min(longest_step(tight, memory), left)
    across = regular if loose == tight else min(longest_step(loose, memory), left)
    ahead = step.time_to_pole if step.time_to_pole > 0.0 else memory.distance.time_to_crossing
    memory.distance.time_to_crossing = 0.0
    is_deep = regular > (1.0 - MIN_PIVOT_RATIO) * ahead and regular < left
    if across < CROSSING_MARGIN * ahead and is_deep:
        regular = across = ahead - CROSSING_START * across
    return regular, across


@kernel
def next_length(h, regular, memory):
    """Return the length (s) of the attempt after an attempt of h seconds.

    The step ends clearly after the singular position that the attempt approached or crossed, if the terms of
    the series above rounding allow this length. If not, the step ends before the position.
    """
    step = memory.step
    near = step.crossed or ends_deep(memory)
    if step.used_order == step.last_order and near and h > regular:
        across = OVERSHOOT * time_to_singular_position(h, memory)
        step.used_order = order_of_least_term(across, memory)
        return across
    step.used_order = step.last_order
    return regular if h > regular else h * SHORTER


@kernel
def order_of_least_term(h, memory):
    """Return the order, below the last, of the smallest term at a distance h (s): later terms are
    rounding."""
    best, least, power = 2, 1e300, h
    for k in range(2, memory.step.last_order):
        power *= h
        size = largest_used(k, memory) * power
        if size < least:
            best, least = k, size
    return best
