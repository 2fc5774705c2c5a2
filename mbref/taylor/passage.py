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
- A correction that moves the state by as much as its distance from the singular position, which the pivot
  tells, may take it to another branch: where a driver stands still there, the pivot is the correction's.
"""

from __future__ import annotations

from numpy import log

from mbref.kernels.compilation import kernel
from mbref.kernels.layout import OK, SINGULAR_AHEAD
from mbref.linear_algebra.vectors import copy, larger
from mbref.simulation.stepping import STEP_TOO_SMALL, UNDECIDED
from mbref.taylor.crossing import (
    FEW,
    SECTIONS,
    changes_sign,
    least_between,
    size_at,
    stays_level,
)
from mbref.taylor.overlap import overlap_at_end, remember_gradient, size_at_start
from mbref.taylor.partition import freedoms, kept_pivot
from mbref.taylor.samples import evaluate_series
from mbref.taylor.simd import WIDTH, load, max_abs
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
FALLING = -2.0  # the same logarithm near where it vanishes, of two places too that are close
VANISHED = -30.0  # the same at its least, of a step that begins far from where it crosses
LONG, MOST_PARTS = 0.5, 8  # that a variable moves in a part of a step, and the most parts
STEEPEST = 1.5  # that a pivot falls and rises in a step, over the most that a variable moves
LEFT = 2.0  # of the violation that corrections leave, of rows that depend on others: it is no gap's
CREPT = 1e-6  # pivot over its largest below which a crossing is rounding's, unless the series began there
LEAST = 1e-9  # pivot over its largest below which the branch depends on rounding
ROOT = 2.5e-8  # pivot, of unit rows, at the root of the gaps that rounding of the lengths may open
DRIVEN_ROOT = 1e-7  # the same where drivers prescribe the whole motion, which has no twin
FALLEN = 0.5  # of the pivot where a passage began: a larger one has not come near
SHIFTED = 0.05  # of the pivot, by which a correction may move the state that it tells the branch of


@kernel
def remember_pivots(memory):
    """Keep the pivots where a step begins, and whether they fall towards a singular position."""
    progress, before = memory.progress, memory.progress.past_pivot
    remember_pivots_here(memory)
    progress.approaching = progress.past_pivot <= before and not progress.crossed
    progress.leaving = progress.leaving and progress.past_pivot < AHEAD * progress.largest_pivot


@kernel
def remember_pivots_here(memory):
    """Keep the pivots of the last factorisation, and the largest that the least one has been."""
    solver, progress = memory.solver, memory.progress
    copy(solver.last, solver.past)
    for i in range(solver.pivot_columns.shape[0]):
        solver.past_motion[i] = solver.null_space[0, i]
    progress.past_choice, progress.past_odd = progress.choice, progress.odd
    progress.past_pivot = least_pivot(memory)
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
    variables, series = memory.solver.pivot_columns.shape[0], memory.series
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
def changes_signs(memory):
    """Whether pivots of a step's rows and variables change their signs, or others were chosen twice in it."""
    progress = memory.progress
    if progress.choice == progress.past_choice:
        return not keeps_signs(memory)
    return kept_pivot(memory) < 0.0


@kernel
def vanishes_inside(h, memory):
    """Whether the determinant vanishes inside a step of h seconds, or changes its sign twice."""
    less, more = sizes_at_ends(memory)
    vanishes = not stays_level(h, more, memory)
    if vanishes:
        vanishes = size_at(least_between(h, FEW, memory), memory) < FALLING + less
    if vanishes:
        vanishes = size_at(least_between(h, SECTIONS, memory), memory) < VANISHED + less
    evaluate_series(h, memory)
    return vanishes


@kernel
def is_near(pivot, progress):
    """Whether a step begins or ends near a singular position."""
    return min(pivot, progress.past_pivot) < NEAR * progress.largest_pivot


@kernel
def comes_near(pivot, progress):
    """Whether a step of a loose tolerance ends near a singular position, unless it leaves one."""
    leaves = progress.leaving and pivot > progress.past_pivot
    return pivot < AHEAD * progress.largest_pivot and not leaves


@kernel
def has_crossed(h, pivot, memory):
    """Whether a step of h seconds crosses: its determinant changes the sign, or vanishes between its ends.

    Pivots of the same rows and variables whose signs stay have vanished twice or never, and twice takes a
    way that is long beside them: else no determinant is needed.  Branches of several loops that cross at once
    leave the sign of the determinant, and so do two crossings: it is looked at where it is least if pivots
    change their signs and, in a motion that does not turn back, where a least pivot vanishes that falls and
    rises linearly.
    """
    progress, moved = memory.progress, moved_in(h, memory)
    brief = progress.past_pivot + pivot > STEEPEST * moved
    if (brief and keeps_signs(memory)) or progress.past_pivot + kept_pivot(memory) > STEEPEST * moved:
        return False
    far = progress.passing and progress.past_pivot >= BEFORE * progress.largest_pivot
    if changes_sign(h, min(int(moved / LONG) + 1, MOST_PARTS), memory):
        return True
    if changes_signs(memory) and vanishes_inside(h, memory):
        return True
    turns = turns_back(memory.series.terms, memory)
    if brief or (keeps_signs(memory) and not is_near(pivot, progress)) or turns:
        return False
    between, ends = inside(h, pivot, memory)
    vanishes = between - ends < VANISHING
    if vanishes and far:
        vanishes = size_at(least_between(h, SECTIONS, memory), memory) < VANISHED + ends
    evaluate_series(h, memory)
    return vanishes


@kernel
def inside(h, pivot, memory):
    """The logarithms of the determinant where a least pivot vanishes that falls and rises linearly, and of
    the lesser one at the ends of a step of h seconds."""
    past, (less, _) = memory.progress.past_pivot, sizes_at_ends(memory)
    return size_at(h * past / (past + pivot), memory), less


@kernel
def sizes_at_ends(memory):
    """The logarithms of the determinant at the ends of a step: the lesser and the larger one."""
    remember_gradient(memory)
    _, behind = overlap_at_end(memory)
    before = size_at_start(memory)
    return min(before, behind), max(before, behind)


@kernel
def size_of(series, k, variables):
    """The largest coefficient of order k."""
    size = 0.0
    for i in range(variables):
        size = larger(size, series[k, i])
    return size


@kernel
def size_in_use(k, memory):
    """The largest coefficient of order k of the series that steps look along."""
    series, size, lanes = memory.series, 0.0, memory.series.past.shape[1]
    for j in range(0, memory.solver.pivot_columns.shape[0], WIDTH):
        size = max(size, max_abs(load(series.variable, j) * load(series.past, k * lanes + j)))
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
        for i in range(memory.solver.pivot_columns.shape[0]):
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
        return SINGULAR_AHEAD if progress.crossed or comes_near(pivot, progress) else OK
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
    if progress.corrected > SHIFTED * pivot:
        return STEP_TOO_SMALL if progress.crossed or last else UNDECIDED
    root = min(ROOT if freedoms(memory) > 0 else DRIVEN_ROOT, FALLEN * progress.entered)
    if turned and pivot_of_turning(h, memory) < root:
        return UNDECIDED
    if progress.crossed or pivot >= progress.past_pivot:
        return OK
    return OK if pivot >= max(root, LEAST * progress.largest_pivot) else UNDECIDED
