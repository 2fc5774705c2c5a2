"""Where a step crosses a singular position: the determinant of the constraint gradients at its beginning and
at another time changes its sign there (``mbref.taylor.overlap``)."""

from __future__ import annotations

from numpy import exp, log

from mbref.kernels.compilation import kernel
from mbref.taylor.overlap import (
    has_one_motion,
    keep_gradient,
    motions_oppose,
    overlap,
    overlap_at_end,
    rates_oppose,
    remember_gradient,
    size_at_start,
)
from mbref.taylor.partition import freedoms, is_undriven
from mbref.taylor.samples import evaluate_series
from mbref.taylor.turning import turns_back

GOLDEN, SECTIONS = 0.6180339887498949, 70  # of the search for the least determinant
NEGATIVE = -1e300  # less than all logarithms
FEW = 12  # sections, after which a determinant that vanishes is less than 1e-4 of those at the ends
LEVEL = log(0.5)  # of a determinant over the larger of those at the ends
INTERPOLATIONS, HALVINGS = 12, 45  # of the search for its change of sign
ASIDE = 1e-5  # of a step, from where its determinant is least: the sign there tells two changes of it
SEPARATE = 1e-11  # of the determinant where it began, between two changes: less is rounding of one place
STRAIGHT = 4  # most parts of a step in which rates turn by less than a right angle, or do not turn back
MET = 1e-6  # part of the time to a singular position by which it may be off where a series meets it
CLOSE = 1e-13  # of a step, by which two estimates of the change would differ at its end


@kernel
def changes_sign(h, parts, memory):
    """Whether the determinant of the gradients at both ends of a step of h seconds is negative.

    A long step is looked at in parts, because rows that turn by a right angle change the sign too, and two
    changes leave it.
    """
    changes, square = False, freedoms(memory) == 0
    if has_one_motion(memory):
        if parts == 1:
            return motions_oppose(memory)
        if parts <= STRAIGHT and is_undriven(memory) and not turns_back(memory.series.terms, memory):
            return rates_oppose(memory)
    remember_gradient(memory)
    for part in range(1, parts):
        evaluate_series(h * part / parts, memory)
        negative, _ = overlap(memory.state, memory)
        changes = changes or negative
        if not square:
            keep_gradient(memory)
    negative, _ = overlap_at_end(memory) if square else overlap(memory.series.terms, memory)
    if parts > 1:
        evaluate_series(h, memory)
    return changes or negative


@kernel
def find_crossings(h, memory):
    """The times (s, from its beginning) at which a step of h seconds that crossed met singular positions:
    the second is negative where it met one.

    The determinant vanishes there, with a change of sign unless branches of several loops cross at once.
    """
    remember_gradient(memory)
    change = sign_change(h, memory)
    return (change, -1.0) if change >= 0.0 else two_changes(h, memory)


@kernel
def count_crossings(h, memory):
    """How many singular positions a step of h seconds met that crossed, one or two of different loops; keeps
    the times at which it did (``progress.first``, ``progress.second``)."""
    progress = memory.progress
    progress.first, progress.second = find_crossings(h, memory)
    return 2 if progress.second >= 0.0 else 1


@kernel
def two_changes(h, memory):
    """The same as ``find_crossings``, of a step at whose ends the determinant has the same sign: between two
    changes it has the other one."""
    unit, least = size_at_start(memory), least_between(h, SECTIONS, memory)
    for aside in (-ASIDE * h, ASIDE * h):
        between = least + aside
        if 0.0 < between < h and value_at(between, unit, memory) < -SEPARATE:
            first = change_between(0.0, between, unit, memory)
            return first, change_between(h, between, unit, memory)
    return least, -1.0


@kernel
def change_between(outside, inside, unit, memory):
    """The time (s) between two at which the determinant changes its sign; it is negative inside."""
    for _ in range(HALVINGS):
        middle = 0.5 * (outside + inside)
        if value_at(middle, unit, memory) < 0.0:
            inside = middle
        else:
            outside = middle
    return 0.5 * (outside + inside)


@kernel
def sign_change(h, memory):
    """The time (s) at which the determinant changes its sign inside a step of h seconds; -1 if it does not.

    By inverse quadratic interpolation (R. P. Brent, Computer J. 14, 1971); where that is slow, because
    several loops are flat at once and the root is a multiple one, by halving.  It ends where the estimate
    that would follow differs by less than CLOSE of the step, changes going on to fall at their last ratio.
    """
    unit, (negative, size) = size_at_start(memory), overlap_at_end(memory)
    start, end, middle, changed = 0.0, h, -h, h
    before, after = 1.0, signed(negative, size - unit)
    if not after < 0.0:
        return -1.0
    replaced, value_there = start, before
    met = memory.progress.meets
    if 0.0 < met < (1.0 - MET) * h:
        low, high = (1.0 - MET) * met, (1.0 + MET) * met
        at_low, at_high = value_at(low, unit, memory), value_at(high, unit, memory)
        if at_low > 0.0 > at_high:
            start, before, end, after = low, at_low, high, at_high
    for k in range(INTERPOLATIONS + HALVINGS):
        last, before_last = middle, changed
        middle = 0.5 * (start + end)
        if k < INTERPOLATIONS:
            middle = interpolated(start, before, end, after, replaced, value_there)
        changed = abs(middle - last)
        if changed * min(1.0, changed / before_last) <= CLOSE * h:
            break
        value = value_at(middle, unit, memory)
        if value < 0.0:
            replaced, value_there, end, after = end, after, middle, value
        else:
            replaced, value_there, start, before = start, before, middle, value
    return middle


@kernel
def interpolated(a, at_a, b, at_b, c, at_c):
    """The place between a and b, where a function has values of different signs, at which it vanishes by
    inverse quadratic interpolation through c, too; by linear interpolation where that is outside."""
    place = (a * at_b - b * at_a) / (at_b - at_a)
    if at_c in (at_a, at_b):
        return place
    of_a, of_b, of_c = at_b * at_c * (at_b - at_c), at_c * at_a * (at_c - at_a), at_a * at_b * (at_a - at_b)
    quadratic = -(a * of_a + b * of_b + c * of_c) / ((at_a - at_b) * (at_b - at_c) * (at_c - at_a))
    return quadratic if a < quadratic < b else place


@kernel
def value_at(h, unit, memory):
    """The determinant at a distance h (s) from the step's beginning, over one of a logarithm."""
    evaluate_series(h, memory)
    negative, size = overlap(memory.state, memory)
    return signed(negative, size - unit)


@kernel
def signed(negative, logarithm):
    """A number by its sign and the logarithm of its size."""
    return -exp(logarithm) if negative else exp(logarithm)


@kernel
def least_between(h, sections, memory):
    """The time (s) inside a step of h seconds at which the determinant is least, by golden section; or the
    first that is looked at where it is negative."""
    start, end = 0.0, h
    one, other = h - GOLDEN * h, GOLDEN * h
    before, after = size_at(one, memory), size_at(other, memory)
    for _ in range(sections):
        if min(before, after) == NEGATIVE:
            return one if before == NEGATIVE else other
        if before < after:
            end, other, after = other, one, before
            one = end - GOLDEN * (end - start)
            before = size_at(one, memory)
        else:
            start, one, before = one, other, after
            other = start + GOLDEN * (end - start)
            after = size_at(other, memory)
    return 0.5 * (start + end)


@kernel
def stays_level(h, largest, memory):
    """Whether the determinant is not near zero at two times inside a step of h seconds, beside the larger of
    those at its ends, by logarithms: one that vanishes twice is, at one of them."""
    return min(size_at(h - GOLDEN * h, memory), size_at(GOLDEN * h, memory)) > largest + LEVEL


@kernel
def size_at(h, memory):
    """The determinant's logarithm at a distance h (s) from the step's beginning; NEGATIVE where that is."""
    evaluate_series(h, memory)
    negative, size = overlap(memory.state, memory)
    return NEGATIVE if negative else size
