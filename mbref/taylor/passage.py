"""Judging a step of the series that comes near a singular position, or passes one.

- Where branches cross, det(G₁ G₀ᵀ) of the constraint gradients at both ends of a step changes its sign; it
  keeps it where the rank of G stays (a bordered test function: W. Govaerts, Numerical Methods for
  Bifurcations of Dynamical Equilibria, 2000).
- Where branches miss each other by a gap g, the series about one side goes straight on to the other; beyond
  the gap its rows are violated by g at least, and by more the further it goes.  A step near a singular
  position is therefore as exact as rounding allows, and violated by rounding alone.
- Near a singular position rounding moves the state along the vanishing direction by its ratio to the pivot,
  and turns the velocity by as much again.  A motion that comes nearer than LEAST and does not cross is lost.
  Rounding of the lengths may open a gap that a motion meets before it turns back nearer than ROOT: that is
  lost too.  Whether another one is determined, its twin tells (``mbref.taylor.twin``).
"""

from __future__ import annotations

from numpy import exp, log

from mbref.kernels.compilation import kernel
from mbref.kernels.layout import OK
from mbref.linear_algebra.elimination import determinant
from mbref.linear_algebra.vectors import copy, larger
from mbref.simulation.stepping import SINGULAR_AHEAD, STEP_TOO_SMALL, UNDECIDED
from mbref.taylor.partition import kept_pivot, put_gradient
from mbref.taylor.samples import evaluate_series
from mbref.taylor.turning import pivot_of_turning, turns_back

NEAR = 0.3  # least pivot of G, over the largest that it has been, below which a singular position is near
AHEAD = 0.03  # the same, below which a series of a loose tolerance gives way to an exact one
NOISE = 4e-15  # over the pivot: the tolerance of a step, which then crosses by a quarter of its distance
BEFORE = 0.6  # of the largest pivot: from there on a step may cross
ROUNDING = 1e-15  # the least violation that is asked for
RESOLUTION = 1e-14  # violation of a step beside a singular position, that passes no gap
ACROSS = 1e-13  # of a step that crosses
CLOCK = 3e-16  # of the time: its rounding, over which drivers and variables move
DEEPEST = 0.2  # of a step's first pivot: its last is not less, so that the next is not the worse for it
SHORTEST = 0.05  # the same, of a step that crosses: refused, it would be tried again from nearer
VANISHING = log(0.2)  # of a determinant over its values at both ends, that falls and rises linearly
VANISHED = -30.0  # the same logarithm at its least, of a step that begins far from where it crosses
LONG, MOST_PARTS = 0.5, 8  # that a variable moves in a part of a step, and the most parts
STEEPEST = 1.5  # that a pivot falls and rises in a step, over the most that a variable moves
GOLDEN, SECTIONS = 0.6180339887498949, 70  # of the search for the least determinant
SECANTS = 12  # of the search for its change of sign, behind which it halves
LEFT = 2.0  # of the violation that corrections leave, of rows that depend on others: it is no gap's
CREPT = 1e-6  # pivot over its largest below which a crossing is rounding's, unless the series began there
LOST_ROW = 1e-6  # of the largest pivot: formulations may take a row with less for one that depends on others
LEAST = 1e-9  # pivot over its largest below which the branch depends on rounding
ROOT = 2.5e-8  # pivot, of unit rows, at the root of the gaps that rounding of the lengths may open
FALLEN = 0.5  # of the pivot where a passage began: a larger one has not come near


@kernel
def remember_pivots(memory):
    """Keep the pivots where a step begins, and whether they fall towards a singular position."""
    progress, before = memory.progress, memory.progress.past_pivot
    remember_pivots_here(memory)
    progress.approaching = progress.past_pivot <= before and not progress.crossed


@kernel
def remember_pivots_here(memory):
    """Keep the pivots of the last factorisation, and the largest that the least one has been."""
    solver, progress = memory.solver, memory.progress
    copy(solver.last, solver.past)
    progress.past_choice, progress.past_pivot = progress.choice, least_pivot(memory)
    progress.largest_pivot = max(progress.largest_pivot, progress.past_pivot)


@kernel
def least_pivot(memory):
    """The least pivot of G at the last factorisation; 1 without rows."""
    solver, least = memory.solver, 1.0
    for k in range(memory.progress.rank):
        least = min(least, abs(solver.last[k]))
    return least


@kernel
def moved_in(h, memory):
    """The most that a variable moves in a step of h seconds, at the rates of both ends."""
    variables, series = memory.solver.order.shape[0], memory.series
    return h * max(size_of(series.past, 1, variables), size_of(series.terms, 1, variables))


@kernel
def keeps_signs(memory):
    """Whether the pivots are those of the rows and variables where the step began, with the same signs."""
    progress, solver = memory.progress, memory.solver
    if progress.choice != progress.past_choice:
        return False
    for k in range(progress.rank):  # noqa: SIM110 - no generators in kernels
        if solver.last[k] * solver.past[k] <= 0.0:
            return False
    return True


@kernel
def is_near(pivot, progress):
    """Whether a step begins or ends near a singular position."""
    return min(pivot, progress.past_pivot) < NEAR * progress.largest_pivot


@kernel
def remember_gradient(memory):
    """Keep G where the step began."""
    solver = memory.solver
    put_gradient(memory.series.past, memory)
    copy(solver.work.reshape(-1), solver.past_gradient.reshape(-1))


@kernel
def overlap(y, memory):
    """Whether det(G Gᵀ₀) of the independent rows is negative, and its logarithm: G at variables y[0]."""
    solver, rank = memory.solver, memory.progress.rank
    product, past, work = solver.product, solver.past_gradient, solver.work
    put_gradient(y, memory)
    for i in range(rank):
        for j in range(rank):
            value = 0.0
            for c in range(work.shape[1]):
                value += work[solver.row[i], c] * past[solver.row[j], c]
            product[i, j] = value
    return determinant(product, rank)


@kernel
def has_crossed(h, pivot, memory):
    """Whether a step of h seconds crosses: its determinant changes the sign, or vanishes between its ends.

    Pivots of the same rows and variables whose signs stay have vanished twice or never, and twice takes a
    way that is long beside them: else no determinant is needed.  Branches of several loops that cross at once
    leave the sign of the determinant: in a motion that does not turn back, it is looked at where a least
    pivot vanishes that falls and rises linearly.
    """
    progress, moved = memory.progress, moved_in(h, memory)
    brief = progress.past_pivot + pivot > STEEPEST * moved
    if (brief and keeps_signs(memory)) or progress.past_pivot + kept_pivot(memory) > STEEPEST * moved:
        return False
    far = progress.passing and progress.past_pivot >= BEFORE * progress.largest_pivot
    if changes_sign(h, min(int(moved / LONG) + 1, MOST_PARTS), memory):
        return True
    turns = turns_back(memory.series.terms, memory)
    if brief or (keeps_signs(memory) and not is_near(pivot, progress)) or turns:
        return False
    _, behind = overlap(memory.series.terms, memory)
    _, before = overlap(memory.series.past, memory)
    between = size_at(h * progress.past_pivot / (progress.past_pivot + pivot), memory) - min(before, behind)
    vanishes = between < VANISHING
    if vanishes and far:
        vanishes = size_at(least_between(h, memory), memory) < VANISHED + min(before, behind)
    evaluate_series(h, memory)
    return vanishes


@kernel
def changes_sign(h, parts, memory):
    """Whether the determinant of the gradients at both ends of a step of h seconds is negative.

    A long step is looked at in parts, because rows that turn by a right angle change the sign too.  The
    gradient where the step began is kept.
    """
    series, changes = memory.series, False
    remember_gradient(memory)
    for part in range(1, parts):
        evaluate_series(h * part / parts, memory)
        negative, _ = overlap(memory.state, memory)
        changes = changes or negative
        copy(memory.solver.work.reshape(-1), memory.solver.past_gradient.reshape(-1))
    negative, _ = overlap(series.terms, memory)
    if parts > 1:
        evaluate_series(h, memory)
        remember_gradient(memory)
    return changes or negative


@kernel
def size_of(series, k, variables):
    """The largest coefficient of order k."""
    size = 0.0
    for i in range(variables):
        size = larger(size, series[k, i])
    return size


@kernel
def find_crossing(h, memory):
    """The time (s, from its beginning) at which a step of h seconds that crossed met the singular position.

    The determinant vanishes there, with a change of sign unless branches of several loops cross at once.
    """
    change = sign_change(h, memory)
    return change if change >= 0.0 else least_between(h, memory)


@kernel
def is_at_crossing(at, h, memory):
    """Whether the rows leave a motion free to the formulation, beyond that of the series, at a time (s) of a
    step of h seconds that crossed: pivots fall linearly."""
    progress = memory.progress
    if not progress.crossed:
        return False
    crossing = find_crossing(h, memory)
    return abs(at - crossing) * progress.past_pivot <= LOST_ROW * progress.largest_pivot * crossing


@kernel
def sign_change(h, memory):
    """The time (s) at which the determinant changes its sign inside a step of h seconds; -1 if it does not.

    By the Illinois algorithm (M. Dowell and P. Jarratt, BIT 11, 1971); where that is slow, because several
    loops are flat at once and the root is a multiple one, by halving.
    """
    evaluate_series(0.0, memory)
    _, unit = overlap(memory.state, memory)
    start, end, side = 0.0, h, 0
    before, after = value_at(start, unit, memory), value_at(end, unit, memory)
    if not before * after < 0.0:
        return -1.0
    for k in range(SECTIONS):
        middle = (start * after - end * before) / (after - before) if k < SECANTS else 0.5 * (start + end)
        if not start < middle < end:
            break
        value = value_at(middle, unit, memory)
        if value * after > 0.0:
            end, after = middle, value
            before = 0.5 * before if side == 1 else before
            side = 1
        else:
            start, before = middle, value
            after = 0.5 * after if side == -1 else after
            side = -1
    return end if abs(after) < abs(before) else start


@kernel
def value_at(h, unit, memory):
    """The determinant at a distance h (s) from the step's beginning, over one of a logarithm."""
    evaluate_series(h, memory)
    negative, size = overlap(memory.state, memory)
    return -exp(size - unit) if negative else exp(size - unit)


@kernel
def least_between(h, memory):
    """The time (s) inside a step of h seconds at which the determinant is least, by golden section."""
    start, end = 0.0, h
    one, other = h - GOLDEN * h, GOLDEN * h
    before, after = size_at(one, memory), size_at(other, memory)
    for _ in range(SECTIONS):
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
def size_at(h, memory):
    """The logarithm of the determinant's size at a distance h (s) from the step's beginning."""
    evaluate_series(h, memory)
    _, size = overlap(memory.state, memory)
    return size


@kernel
def exactness(progress):
    """The tolerance of a step: a motion bends the more sharply the nearer it is to a singular position."""
    return progress.tolerance * min(1.0, progress.past_pivot / progress.largest_pivot)


@kernel
def exactness_across(progress):
    """The tolerance of a step that crosses: its terms grow by rounding, with its length over the distance."""
    distance = progress.past_pivot / progress.largest_pivot
    if progress.passing and progress.approaching and distance < BEFORE:
        return max(progress.tolerance, NOISE / distance)
    return exactness(progress)


@kernel
def distance_ahead(h, memory):
    """How far (s) a least pivot that falls linearly, and did so in an attempt of h seconds, is from zero."""
    pivot, past = least_pivot(memory), memory.progress.past_pivot
    return h * past / (past + pivot if memory.progress.crossed else past - pivot)


@kernel
def resolution(memory):
    """The violation of a step that passes no gap, whose correction costs energy; drivers round with time."""
    progress, terms, rounding, speed = memory.progress, memory.series.terms, ROUNDING, 0.0
    if memory.polynomials.given.driver.shape[0] > 0:
        for i in range(memory.solver.order.shape[0]):
            speed = max(speed, abs(terms[1, i]))
        rounding = max(rounding, CLOCK * memory.run.loop.clock.time * speed)
    if progress.crossed:
        return max(ACROSS, rounding)
    return max(RESOLUTION * progress.past_pivot / progress.largest_pivot, rounding, LEFT * progress.left)


@kernel
def judge_branch(h, last, memory):
    """Judge a step of h seconds by the least pivot: OK, or why the branch on which it ends is in doubt."""
    progress, pivot = memory.progress, least_pivot(memory)
    progress.crossed = has_crossed(h, pivot, memory)
    if not progress.passing:
        ahead = progress.crossed or pivot < AHEAD * progress.largest_pivot
        return SINGULAR_AHEAD if ahead else OK
    if not (progress.crossed or is_near(pivot, progress)):
        return OK
    turned = turns_back(memory.series.terms, memory)
    if progress.crossed and turned:
        return STEP_TOO_SMALL
    if progress.crossed and progress.past_pivot < min(CREPT * progress.largest_pivot, progress.entered):
        return UNDECIDED
    deepest = (SHORTEST if progress.crossed else DEEPEST) * progress.past_pivot
    if not progress.violation <= resolution(memory) or (not last and pivot < deepest):
        return STEP_TOO_SMALL
    root = min(ROOT, FALLEN * progress.entered)
    if turned and pivot_of_turning(h, memory) < root:
        return UNDECIDED
    if progress.crossed or last or pivot >= progress.past_pivot:
        return OK
    return OK if pivot >= max(root, LEAST * progress.largest_pivot) else UNDECIDED
