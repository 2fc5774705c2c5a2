"""Detection of singular positions: the decision whether a step of free or driven motion contains a singular
position.

If rows, variables and signs of the pivots are equal at both ends, pivots have vanished twice or never; two
zeros need a distance that is long compared with the pivots. For all other steps the determinant of the
gradients decides (``determinants``). The sign of the determinant is unchanged if branches of several loops
cross at once, or after two crossings. So the determinant is also evaluated at its minimum if pivots change
their signs, and at the place where a linearly falling least pivot vanishes.
"""

from __future__ import annotations

from mbref.kernels.compilation import exchangeable, kernel
from mbref.taylor.coefficients import distance_moved, turns_back
from mbref.taylor.crossing.determinants import (
    gradient_determinant_at_end,
    has_one_null_vector,
    log_determinant_at_start,
    null_vectors_oppose,
    rates_oppose,
    save_gradient,
    save_start_determinant,
)
from mbref.taylor.crossing.location import GOLDEN, logarithm_at, time_of_minimum
from mbref.taylor.crossing.thresholds import (
    CROSSING_START,
    LOG_DIP,
    LOG_DIP_COARSE,
    LOG_LEVEL,
    LOG_ZERO,
    MAX_PARTS,
    MIN_PIVOT_RATIO,
    MONOTONE_PARTS,
    PART_LENGTH,
    PIVOT_AHEAD,
    PIVOT_NEAR,
    PIVOT_SLOPE,
    SECTIONS,
    SECTIONS_COARSE,
)
from mbref.taylor.layout import DETECT
from mbref.taylor.mode import PREDICTOR, is_accurate
from mbref.taylor.partition import freedoms, is_undriven, least_pivot, replaced_pivot, save_start_pivots
from mbref.taylor.samples import evaluate_series


# --- pivots ---------------------------------------------------------------------------------------------
@kernel
def save_pivots(memory):
    """Save the pivots at the start of a step, and whether they fall towards a singular position."""
    distance, before = memory.distance, memory.distance.start_pivot
    save_start_pivots(memory)
    distance.approaching = distance.start_pivot <= before and not memory.step.crossed
    distance.leaving = distance.leaving and distance.start_pivot < PIVOT_AHEAD * distance.largest_pivot


@kernel
def is_near_singular(pivot, memory):
    """Return whether a step with a least pivot at its end starts or ends near a singular position."""
    return min(pivot, memory.distance.start_pivot) < PIVOT_NEAR * memory.distance.largest_pivot


@kernel
def ends_near_singular(pivot, memory):
    """Return whether a step of low accuracy ends near a singular position, and does not leave a singular
    position."""
    leaves = memory.distance.leaving and pivot > memory.distance.start_pivot
    return pivot < PIVOT_AHEAD * memory.distance.largest_pivot and not leaves


@kernel
def ends_deep(memory):
    """Return whether a step ends so much nearer to a singular position than it starts that the next one loses
    accuracy."""
    return least_pivot(memory) < MIN_PIVOT_RATIO * memory.distance.start_pivot


@kernel
def time_to_singular_position(h, memory):
    """Return the time (s) at which the least pivot vanishes by linear extrapolation, from both ends of an
    attempt of h seconds; 0 for an attempt of no length."""
    if h == 0.0:
        return 0.0
    pivot, past = least_pivot(memory), memory.distance.start_pivot
    return h * past / (past + pivot if memory.step.crossed else past - pivot)


@kernel
def keeps_signs(memory):
    """Return whether rows and variables at both ends of the step are equal, and the signs of their pivots."""
    solver = memory.solver
    if memory.partition.partition_id != memory.step.start_partition_id:
        return False
    for k in range(memory.partition.rank):  # noqa: SIM110 - no generators in kernels
        if solver.last[k] * solver.past[k] <= 0.0:
            return False
    return True


@kernel
def changes_signs(memory):
    """Return whether pivots change their signs in the step, or the partition changes more than once."""
    if memory.partition.partition_id == memory.step.start_partition_id:
        return not keeps_signs(memory)
    return replaced_pivot(memory) < 0.0


# --- the decision ---------------------------------------------------------------------------------------
@exchangeable(DETECT)
def contains_singular_position(h, pivot, memory):
    """Return whether a step of h seconds, with a least pivot at its end, contains a singular position."""
    if memory.run.control.closed_loops == 0.0:
        return False
    start, moved, kept = memory.distance.start_pivot, distance_moved(h, memory), keeps_signs(memory)
    is_short = start + pivot > PIVOT_SLOPE * moved
    if (is_short and kept) or start + replaced_pivot(memory) > PIVOT_SLOPE * moved:
        return False
    if determinant_changes_sign(h, min(int(moved / PART_LENGTH) + 1, MAX_PARTS), memory):
        return True
    if changes_signs(memory) and vanishes_inside(h, memory):
        return True
    if is_short or (kept and not is_near_singular(pivot, memory)):
        return False
    if memory.mode.kind != PREDICTOR and turns_back(memory.series.terms, memory):
        return False
    return dips_to_zero(h, pivot, memory)


@kernel
def determinant_changes_sign(h, parts, memory):
    """Return whether the determinant of the gradients at both ends of a step of h seconds is negative.

    A long step is judged in parts, because rows that turn by a right angle also change the sign, and two
    changes cancel.
    """
    changes, square = False, freedoms(memory) == 0
    if has_one_null_vector(memory):
        if parts == 1:
            return null_vectors_oppose(memory)
        if parts <= MONOTONE_PARTS and is_undriven(memory) and not turns_back(memory.series.terms, memory):
            return rates_oppose(memory)
    save_start_determinant(memory)
    for part in range(1, parts):
        evaluate_series(h * part / parts, memory)
        negative, _ = memory.kernels.determinant(memory.state, memory)
        changes = changes or negative
        if not square:
            save_gradient(memory)
    if square:
        negative, _ = gradient_determinant_at_end(memory)
    else:
        negative, _ = memory.kernels.determinant(memory.series.terms, memory)
    if parts > 1:
        evaluate_series(h, memory)
    return changes or negative


@kernel
def vanishes_inside(h, memory):
    """Return whether the determinant vanishes inside a step of h seconds, or changes its sign twice."""
    less, more = end_logarithms(memory)
    vanishes = not stays_level(h, more, memory)
    if vanishes:
        lowest = time_of_minimum(h, SECTIONS_COARSE, memory)
        vanishes = logarithm_at(lowest, memory) < LOG_DIP_COARSE + less
    if vanishes:
        vanishes = logarithm_at(time_of_minimum(h, SECTIONS, memory), memory) < LOG_ZERO + less
    evaluate_series(h, memory)
    return vanishes


@kernel
def stays_level(h, largest, memory):
    """Return whether the determinant is large at two times inside a step of h seconds.

    ``largest`` is the logarithm of the larger determinant at the two ends of the step.  A determinant that
    vanishes twice inside the step is small at one of the two times.
    """
    first = logarithm_at(h - GOLDEN * h, memory)
    return min(first, logarithm_at(GOLDEN * h, memory)) > largest + LOG_LEVEL


@kernel
def dips_to_zero(h, pivot, memory):
    """Return whether the determinant vanishes at the place, in a step of h seconds, where a linear least
    pivot vanishes.

    A high-accuracy step that starts far away spans the position; for such a step the minimum itself is
    evaluated.
    """
    start, (ends, _) = memory.distance.start_pivot, end_logarithms(memory)
    vanishes = logarithm_at(h * start / (start + pivot), memory) - ends < LOG_DIP
    is_far = is_accurate(memory) and start >= CROSSING_START * memory.distance.largest_pivot
    if vanishes and is_far:
        vanishes = logarithm_at(time_of_minimum(h, SECTIONS, memory), memory) < LOG_ZERO + ends
    evaluate_series(h, memory)
    return vanishes


@kernel
def end_logarithms(memory):
    """Return the logarithms of the determinant at the ends of a step: the smaller and the larger
    logarithm."""
    save_start_determinant(memory)
    _, behind = gradient_determinant_at_end(memory)
    before = log_determinant_at_start(memory)
    return min(before, behind), max(before, behind)
