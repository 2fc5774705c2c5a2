"""Detection of singular positions by a run that watches the rank of Φ_q: such a run ends there.

Where the rank of Φ_q drops, a pivot of its rows falls to zero and rises again.  The pivots are those of unit
rows in columns of unit length (``equations.units``), so that masses have no part in them; the projection has
them at hand after every step (``layout.Watch``).  A step comes to a singular position where it ends at one.
It passes one where the determinant of the constraint gradients at both of its ends, det(G₁ G₀ᵀ + I/α),
changes its sign.  Several loops that pass one together leave the sign; then several pivots vanish at once.
"""

from __future__ import annotations

from mbref.kernels.compilation import kernel
from mbref.linear_algebra.elimination import determinant
from mbref.linear_algebra.vectors import copy
from mbref.stabilisation.projection import ALPHA, keep_gradient

REACHED = 1e-3  # relative pivot at which a step has come to a singular position: no motion is accurate there
SHARP = 1.2  # falls of a pivot in the time of a step, below which it has vanished and risen inside
SMALLEST = 1e-4  # pivot of a row below which it is as good as redundant, and is not compared


@kernel
def relative_pivot(watch):
    """Smallest pivot of Φ_q over the largest it has had; 1 where the chart does not watch it."""
    reference = watch.reference_pivot
    return watch.smallest_pivot / reference if reference > 0.0 else 1.0


@kernel
def meets_singular_position(h, memory):
    """Whether a step of h seconds, whose end has just been projected, comes to a singular position or passes
    one."""
    watch = memory.watch
    if memory.control.closed_loops == 0.0 or watch.reference_pivot == 0.0:
        return False
    if relative_pivot(watch) <= REACHED and watch.smallest_pivot < watch.past_pivot:
        return True
    compared = memory.loop.gradients.product.shape[0] > 0
    return (compared and changes_sign(memory)) or vanishing_pivots(h, memory) > compared


@kernel
def vanishing_pivots(h, memory):
    """The number of pivots that have vanished inside a step of h seconds: their values at both ends add up to
    what they fall, as fast as in the step before."""
    history, taken = memory.loop.history, memory.equations.system.counts.steps
    if taken == memory.loop.clock.restart:
        return 0
    kept, found = history.time.shape[0], 0
    now, before = taken % kept, (taken - 1) % kept
    width = history.time[now] - history.time[before]
    for k in range(memory.pivots.shape[0]):
        start, end = history.pivots[now, k], memory.pivots[k]
        fall = (history.pivots[before, k] - start) / width * h
        if start > SMALLEST and start + end < SHARP * fall:
            found += 1
    return found


@kernel
def changes_sign(memory):
    """Whether det(G₁ G₀ᵀ + I/α) is negative, G₀ and G₁ being the gradients at both ends of the step.

    It is positive where the rows' span turns by less than a right angle, and changes its sign where the rank
    drops by one in between.
    """
    factor, gradients = memory.factor, memory.loop.gradients
    put_product(factor, gradients)
    negative, _ = determinant(gradients.product, factor.diagonal.shape[0])
    return negative


@kernel
def put_product(factor, gradients):
    """D D₀ᵀ and a part 1/α of the squares of D on its diagonal, D₀ being where the step began.

    It has entries where S and its factor L have theirs, and from the products of the same numbers.
    """
    symbolic, d, d_0, product = factor.symbolic, factor.d, gradients.start, gradients.product
    first, row, start, left, right = (
        symbolic.l_start, symbolic.l_row, symbolic.s_start, symbolic.s_left, symbolic.s_right,
    )  # fmt: skip
    product[:] = 0.0
    for k in range(factor.diagonal.shape[0]):
        for entry in range(first[k], first[k + 1]):
            lower, upper, square = 0.0, 0.0, 0.0
            for p in range(start[entry], start[entry + 1]):
                lower += d[left[p]] * d_0[right[p]]
                upper += d[right[p]] * d_0[left[p]]
                square += d[left[p]] * d[right[p]]
            product[row[entry], k], product[k, row[entry]] = lower, upper
            if row[entry] == k:
                product[k, k] += (square if square > 0.0 else 1.0) / ALPHA


@kernel
def remember_watch(memory):
    """Keep the pivots and the gradient at the end of an accepted step, where the next one begins."""
    watch = memory.watch
    watch.past_pivot = watch.smallest_pivot
    watch.nearest = min(watch.nearest, relative_pivot(watch))
    keep_gradient(memory)


@kernel
def remember_state(taken, y, y_rate, memory):
    """Row taken mod KEPT of the history := t, pivots, y, y'."""
    history = memory.loop.history
    row, n = taken % history.time.shape[0], y.shape[0]
    history.time[row] = memory.loop.clock.time
    copy(memory.pivots, history.pivots[row])
    copy(y, history.y[row, :n])
    copy(y_rate, history.y_rate[row, :n])
