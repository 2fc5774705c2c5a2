"""Location of the zero or the minimum of the determinant of the gradients inside a step."""

from __future__ import annotations

from numpy import exp

from mbref.kernels.compilation import kernel
from mbref.taylor.crossing.determinants import (
    gradient_determinant_at_end,
    log_determinant_at_start,
    save_start_determinant,
)
from mbref.taylor.crossing.thresholds import (
    BISECTIONS,
    INTERPOLATIONS,
    LOCATION_ERROR,
    PAIR_DEPTH,
    PAIR_OFFSET,
    POLE_BRACKET,
    SECTIONS,
)
from mbref.taylor.samples import evaluate_series

GOLDEN = 0.6180339887498949  # ratio of the golden section
NEGATIVE = -1e300  # stands for the logarithm of a negative determinant


@kernel
def find_crossings(h, memory):
    """Return the times (s, from its start) of one or two singular positions in a step of h seconds.

    The second time is negative if the step contains only one singular position.  The determinant vanishes at
    a singular position, and changes its sign unless branches of several loops cross at once.
    """
    save_start_determinant(memory)
    change = sign_change(h, memory)
    return (change, -1.0) if change >= 0.0 else find_pair(h, memory)


@kernel
def count_crossings(h, memory):
    """Return the number of singular positions in a step of h seconds that crosses, and save their times."""
    step = memory.step
    step.first_crossing, step.second_crossing = find_crossings(h, memory)
    return 2 if step.second_crossing >= 0.0 else 1


@kernel
def find_pair(h, memory):
    """Return the times (s) of two sign changes in a step with equal signs at its ends, otherwise the time of
    the minimum and -1.

    Between two singular positions of different loops the determinant has the other sign.
    """
    unit, lowest = log_determinant_at_start(memory), time_of_minimum(h, SECTIONS, memory)
    for offset in (-PAIR_OFFSET * h, PAIR_OFFSET * h):
        between = lowest + offset
        if 0.0 < between < h and value_at(between, unit, memory) < -PAIR_DEPTH:
            first = bisect(0.0, between, unit, memory)
            return first, bisect(h, between, unit, memory)
    return lowest, -1.0


@kernel
def bisect(positive, negative, unit, memory):
    """Return the time (s) of the sign change between two times, at the second of which the sign is
    negative."""
    for _ in range(BISECTIONS):
        middle = 0.5 * (positive + negative)
        if value_at(middle, unit, memory) < 0.0:
            negative = middle
        else:
            positive = middle
    return 0.5 * (positive + negative)


@kernel
def sign_change(h, memory):
    """Return the time (s) of the sign change inside a step of h seconds; -1 if the signs at its ends are
    equal.

    The method is inverse quadratic interpolation (R. P. Brent, Computer J. 14, 1971), and bisection where
    interpolation is slow: at the multiple root of several loops.  The search starts at the rounding pole, if
    the series had one.  The search ends if the next estimate differs by less than LOCATION_ERROR of the step.
    """
    unit, (negative, size) = log_determinant_at_start(memory), gradient_determinant_at_end(memory)
    start, end, middle, changed = 0.0, h, -h, h
    before, after = 1.0, signed(negative, size - unit)
    if not after < 0.0:
        return -1.0
    replaced, value_there = start, before
    pole = memory.step.time_to_pole
    if 0.0 < pole < (1.0 - POLE_BRACKET) * h:
        low, high = (1.0 - POLE_BRACKET) * pole, (1.0 + POLE_BRACKET) * pole
        at_low, at_high = value_at(low, unit, memory), value_at(high, unit, memory)
        if at_low > 0.0 > at_high:
            start, before, end, after = low, at_low, high, at_high
    for k in range(INTERPOLATIONS + BISECTIONS):
        last, before_last = middle, changed
        middle = 0.5 * (start + end)
        if k < INTERPOLATIONS:
            middle = interpolated(start, before, end, after, replaced, value_there)
        changed = abs(middle - last)
        if changed == 0.0 or changed * min(1.0, changed / before_last) <= LOCATION_ERROR * h:
            break
        value = value_at(middle, unit, memory)
        if value < 0.0:
            replaced, value_there, end, after = end, after, middle, value
        else:
            replaced, value_there, start, before = start, before, middle, value
    return middle


@kernel
def interpolated(a, at_a, b, at_b, c, at_c):
    """Return the zero between a and b, of values with different signs, by inverse quadratic interpolation
    through c; by linear interpolation if the result leaves the interval."""
    place = (a * at_b - b * at_a) / (at_b - at_a)
    if at_c in (at_a, at_b):
        return place
    of_a, of_b, of_c = at_b * at_c * (at_b - at_c), at_c * at_a * (at_c - at_a), at_a * at_b * (at_a - at_b)
    quadratic = -(a * of_a + b * of_b + c * of_c) / ((at_a - at_b) * (at_b - at_c) * (at_c - at_a))
    return quadratic if a < quadratic < b else place


@kernel
def value_at(h, unit, memory):
    """Return the determinant at a time h (s) of the step, relative to a determinant whose logarithm is
    ``unit``."""
    evaluate_series(h, memory)
    negative, size = memory.kernels.determinant(memory.state, memory)
    return signed(negative, size - unit)


@kernel
def signed(negative, logarithm):
    """Return a number by its sign and the logarithm of its size."""
    return -exp(logarithm) if negative else exp(logarithm)


@kernel
def time_of_minimum(h, sections, memory):
    """Return the time (s) of the smallest determinant in a step of h seconds, by golden section; the first
    time found with a negative determinant ends the search."""
    start, end = 0.0, h
    one, other = h - GOLDEN * h, GOLDEN * h
    before, after = logarithm_at(one, memory), logarithm_at(other, memory)
    for _ in range(sections):
        if min(before, after) == NEGATIVE:
            return one if before == NEGATIVE else other
        if before < after:
            end, other, after = other, one, before
            one = end - GOLDEN * (end - start)
            before = logarithm_at(one, memory)
        else:
            start, one, before = one, other, after
            other = start + GOLDEN * (end - start)
            after = logarithm_at(other, memory)
    return 0.5 * (start + end)


@kernel
def logarithm_at(h, memory):
    """Return the logarithm of the determinant at a time h (s) of the step; NEGATIVE for a negative
    determinant."""
    evaluate_series(h, memory)
    negative, size = memory.kernels.determinant(memory.state, memory)
    return NEGATIVE if negative else size
