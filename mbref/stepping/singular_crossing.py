"""Detection of singular positions by a run that monitors the rank of Φ_q: such a run ends at a singular
position.

At a drop of the rank of Φ_q, a pivot of its rows falls to zero and rises again. The pivots belong to unit
rows in columns of unit length (``equations.units``), so that they do not depend on masses; the projection
computes them after every step (``layout.Watch``). A step may end at a singular position. Rows may lose rank
inside a step if a pivot of the product of the gradients at both ends is negative
(``linear_algebra.sparse_lu``).  The pose at the zero of that pivot decides: at a singular position fewer
nonzero pivots are left than the rank. At a regular position a redundant row has replaced the row whose pivot
vanishes.
"""

from __future__ import annotations

from numpy import sqrt

from mbref.equations.coordinates import coordinate_rates, normalise
from mbref.equations.evaluation import evaluate
from mbref.kernels.compilation import kernel
from mbref.linear_algebra.sparse_cholesky import find_squared_pivots
from mbref.linear_algebra.sparse_lu import factorise_product
from mbref.linear_algebra.vectors import sort
from mbref.stabilisation.projection import factorise_constraints, keep_end

REACHED = 1e-3  # relative pivot below which a step has reached a singular position
# relative pivot inside a step below which it counts as zero, because the pose is interpolated
VANISHED = 1e-2
PRODUCT_ALPHA = 1e8  # penalty: redundant rows get the pivot 1/α, far above rounding
SEARCH, PLACE_ERROR = 30, 1e-9  # evaluations that locate a zero, and error of its place / step


@kernel
def relative_pivot(watch):
    """Return the smallest pivot of Φ_q over its largest value so far; 1 if the chart does not monitor it."""
    reference = watch.reference_pivot
    return watch.smallest_pivot / reference if reference > 0.0 else 1.0


@kernel
def meets_singular_position(h, memory):
    """Return whether a step of h seconds, whose end has just been projected, reaches or passes a singular
    position.

    The place of the singular position in the step and the pose are then in memory.
    """
    watch = memory.watch
    if memory.control.closed_loops == 0.0 or watch.reference_pivot == 0.0:
        return False
    if relative_pivot(watch) <= REACHED and watch.smallest_pivot < watch.past_pivot:
        keep_position(1.0, h, memory)
        return True
    return passes_singular_position(h, memory)


@kernel
def keep_position(part, h, memory):
    """Save the fraction of a step of h seconds and the pose there, at which the run ends."""
    memory.watch.singular_part = part
    put_pose(part, h, memory)


@kernel
def passes_singular_position(h, memory):
    """Return whether the rank drops inside a step of h seconds.

    Rows whose pivots are small at both ends are redundant, and are not examined.
    """
    ends, factor = memory.loop.ends, memory.factor
    factorise_product(factor, ends.gradient, PRODUCT_ALPHA, ends)
    least, looked_at = (REACHED * memory.watch.reference_pivot) ** 2, False
    for k in range(memory.pivots.shape[0]):
        larger = max(memory.pivots[k] ** 2, ends.squared_pivots[k])
        if ends.pivots[k] < 0.0 and larger > least:
            if not looked_at:
                put_rates(memory)
                looked_at = True
            part = zero_of_pivot(k, h, memory)
            if pivot_at_pose(memory) < VANISHED * memory.watch.reference_pivot:
                keep_position(part, h, memory)
                return True
            expand_product_at(1.0, h, memory)
    return False


@kernel
def put_rates(memory):
    """Compute q' at both ends of the step."""
    rates, before, after = memory.loop.ends.rates, memory.previous, memory.state
    coordinate_rates(before.coordinates, before.velocities, rates[0])
    coordinate_rates(after.coordinates, after.velocities, rates[1])


@kernel
def put_pose(part, h, memory):
    """Compute the pose at a fraction of a step of h seconds, by Hermite's cubic polynomial."""
    ends, rest = memory.loop.ends, 1.0 - part
    before, after = memory.previous.coordinates, memory.state.coordinates
    of_before, of_after = (1.0 + 2.0 * part) * rest * rest, (1.0 + 2.0 * rest) * part * part
    of_first, of_last = h * part * rest * rest, h * part * part * rest
    for k in range(before.shape[0]):
        value = of_before * before[k] + of_after * after[k]
        ends.pose[k] = value + of_first * ends.rates[0, k] - of_last * ends.rates[1, k]
    normalise(ends.pose)


@kernel
def expand_product_at(part, h, memory):
    """Compute the factor at the pose at a fraction of a step of h seconds, and its product with the gradient
    at the start."""
    ends, t = memory.loop.ends, memory.loop.clock.time + part * h
    put_pose(part, h, memory)
    evaluate(t, ends.pose, memory.state.velocities, memory.equations)
    factorise_constraints(memory)
    factorise_product(memory.factor, ends.gradient, PRODUCT_ALPHA, ends)


@kernel
def zero_of_pivot(k, h, memory):
    """Return the fraction of a step of h seconds at which pivot k of the product changes its sign.

    The method is false position with the Pegasus rule (Dowell & Jarratt, BIT 12, 1972). Afterwards the factor
    belongs to the pose at this fraction.
    """
    pivots, low, high = memory.loop.ends.pivots, 0.0, 1.0
    at_low, at_high = memory.loop.ends.squared_pivots[k], pivots[k]
    for _ in range(SEARCH):
        part = low + (high - low) * at_low / (at_low - at_high)
        expand_product_at(part, h, memory)
        found = pivots[k]
        if (found < 0.0) == (at_high < 0.0):
            at_low *= at_high / (at_high + found)
        else:
            low, at_low = high, at_high
        high, at_high = part, found
        if abs(high - low) < PLACE_ERROR or found == 0.0:
            break
    return high


@kernel
def pivot_at_pose(memory):
    """Return the smallest of as many pivots as there are independent rows, at the pose of the last factor."""
    factor, rank = memory.factor, memory.watch.generic_rank
    find_squared_pivots(factor)
    squares = factor.squared_pivots
    sort(squares)
    return sqrt(squares[squares.shape[0] - rank]) if rank > 0 else 1.0


@kernel
def remember_watch(memory):
    """Save the pivots and the gradient at the end of an accepted step, at which the next step begins."""
    watch = memory.watch
    watch.past_pivot = watch.smallest_pivot
    watch.nearest = min(watch.nearest, relative_pivot(watch))
    keep_end(memory)
