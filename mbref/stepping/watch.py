"""Detection of singular positions by a run that monitors the rank of Φ_q: such a run ends at a singular
position.

At a drop of the rank of Φ_q, a pivot of its rows falls to zero and rises again. The pivots belong to unit
rows in columns of unit length (``equations.units``), so that they do not depend on masses; the projection
computes them after every step (``layout.Watch``). A step may end at a singular position. Rows may lose rank
inside a step if a pivot of the product of the gradients at both ends is negative
(``linear_algebra.sparse_lu``).

Where a redundant row has replaced an independent row inside the step, both rows have negative pivots, and the
product of the pivots up to the redundant row is positive. One pass through the elimination tree pairs all
such rows. Where an independent row has no partner, the step is passed in parts, in which pivots change their
sign, since two replacements in one part look like two losses of rank. In a short part the pose at the zero of
the pivot decides: at a singular position fewer nonzero pivots are left than the rank.
"""

from __future__ import annotations

from numpy import sqrt

from mbref.equations.coordinates import coordinate_rates, normalise
from mbref.equations.evaluation import evaluate
from mbref.kernels.compilation import inlined, kernel
from mbref.linear_algebra.sparse_cholesky import assemble_gradients, find_squared_pivots
from mbref.linear_algebra.sparse_lu import factorise_product
from mbref.linear_algebra.vectors import copy, sort
from mbref.stabilisation.projection import factorise_constraints, keep_end

REACHED = 1e-3  # relative pivot below which a step has reached a singular position
# relative pivot inside a step below which it counts as zero, because the pose is interpolated
VANISHED = 1e-2
PRODUCT_ALPHA = 1e8  # penalty: redundant rows get the pivot 1/α, far above rounding
SEARCH, PLACE_ERROR = 30, 1e-9  # evaluations that locate a zero, and error of its place / step
SHORTEST_PART = 1 / 32  # part of a step that is not halved: it separates replacements of loops out of phase


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
    """Return whether the rank drops inside a step of h seconds."""
    ends = memory.loop.ends
    factorise_product(memory.factor, ends.gradient, PRODUCT_ALPHA, ends)
    ends.past_pivots[:] = 1.0
    if not may_lose_rank(memory):
        return False
    put_rates(memory)
    start, length = 0.0, 0.5
    while start < 1.0:
        end = min(1.0, start + length)
        expand_product_at(end, h, memory)
        doubtful = may_lose_rank(memory)
        if doubtful and length > SHORTEST_PART:
            length *= 0.5
        elif doubtful and passes_in_part(start, end, h, memory):
            return True
        else:
            copy(ends.pivots, ends.past_pivots)
            start, length = end, 2.0 * length
    return False


@kernel
def passes_in_part(start, end, h, memory):
    """Return whether the rank drops between two fractions of a step of h seconds, at the zero of a pivot.

    The gradient then belongs to the end of the part again, or to the singular position.
    """
    for k in range(memory.pivots.shape[0]):
        if changes_sign(k, memory) and not is_redundant(k, memory):
            part = zero_of_pivot(k, start, end, h, memory)
            if pivot_at_pose(memory) < VANISHED * memory.watch.reference_pivot:
                keep_position(part, h, memory)
                return True
            expand_product_at(end, h, memory)
    return False


@kernel
def may_lose_rank(memory):
    """Return whether the pivot of an independent row changes its sign, but no redundant partner's pivot.

    The partner is a redundant row further up in the elimination tree: then the rows of the subtree up to the
    partner have kept their rank.
    """
    symbolic, alone = memory.factor.symbolic, memory.loop.ends.alone
    first, row = symbolic.l_start, symbolic.l_row
    alone[:] = 0.0
    for k in range(alone.shape[0]):
        if changes_sign(k, memory):
            if not is_redundant(k, memory):
                alone[k] += 1.0
            elif alone[k] > 0.0:
                alone[k] -= 1.0
        if first[k] + 1 < first[k + 1]:
            alone[row[first[k] + 1]] += alone[k]
        elif alone[k] > 0.0:
            return True
    return False


@inlined
def changes_sign(k, memory):
    """Return whether pivot k of the product has another sign than at the start of the part of the step."""
    ends = memory.loop.ends
    return (ends.pivots[k] < 0.0) != (ends.past_pivots[k] < 0.0)


@inlined
def is_redundant(k, memory):
    """Return whether row k of the factor depends on the rows before it at both ends of the step."""
    least = REACHED * memory.watch.reference_pivot
    return max(memory.pivots[k] ** 2, memory.loop.ends.squared_pivots[k]) <= least * least


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
    """Compute the gradient at the pose at a fraction of a step of h seconds, and its product with the
    gradient at the start."""
    ends, t, equations = memory.loop.ends, memory.loop.clock.time + part * h, memory.equations
    put_pose(part, h, memory)
    evaluate(t, ends.pose, memory.state.velocities, equations)
    assemble_gradients(memory.factor, equations.system.blocks.reshape(-1), equations.scene.metric_root)
    factorise_product(memory.factor, ends.gradient, PRODUCT_ALPHA, ends)


@kernel
def zero_of_pivot(k, start, end, h, memory):
    """Return the fraction of a step of h seconds, between two fractions, at which pivot k changes its sign.

    The method is false position with the Pegasus rule (Dowell & Jarratt, BIT 12, 1972). Afterwards rows and
    gradient belong to the pose at this fraction.
    """
    ends, low, high = memory.loop.ends, start, end
    pivots, at_low, at_high = ends.pivots, ends.past_pivots[k], ends.pivots[k]
    if start == 0.0:
        at_low = ends.squared_pivots[k]
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
    """Return the smallest of as many pivots as there are independent rows, at the pose of the last
    evaluation."""
    factor, rank = memory.factor, memory.watch.generic_rank
    factorise_constraints(memory)
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
