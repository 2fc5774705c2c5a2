"""Judging a step of the series that comes near a singular position, or passes one.

- Where branches cross, det(G₁ G₀ᵀ) of the constraint gradients at both ends of a step changes its sign; it
  keeps it where the rank of G stays (a bordered test function: W. Govaerts, Numerical Methods for
  Bifurcations of Dynamical Equilibria, 2000).
- Where branches miss each other by a gap g, the series about one side goes straight on to the other; beyond
  the gap its rows are violated by g at least, and by more the further it goes.  A step near a singular
  position is therefore as exact as rounding allows, and violated by rounding alone.
- Near a singular position rounding moves the state along the vanishing direction by its ratio to the pivot,
  and turns the velocity by as much again.  A motion that comes nearer than LEAST and does not cross
  is lost.
"""

from __future__ import annotations

from numpy import log

from mbref.kernels.compilation import kernel
from mbref.taylor.samples import evaluate_series
from mbref.taylor.solver import put_gradient

NEAR = 0.3  # least pivot of G, over the largest that it has been, below which a singular position is near
EXACT = 1e-14  # the least tolerance of a series
NOISE = 3e-14  # over the pivot: that of a step which then crosses by a third of its distance
BEFORE = 0.6  # of the largest pivot: from there on a step may cross
RESOLUTION = 1e-12  # violation of a step that passes no gap
DEEPEST = 0.25  # of a step's first pivot: its last is not less, so that the next is not the worse for it
VANISHING = log(0.2)  # of a determinant over its values at both ends, that falls and rises linearly
LEAST = 1e-4  # pivot over its largest below which the branch depends on rounding


@kernel
def remember_gradient(memory):
    """Keep G at the first coefficients, where a step begins."""
    solver, progress = memory.solver, memory.progress
    put_gradient(memory.series.terms, memory)
    for r in range(solver.work.shape[0]):
        for c in range(solver.work.shape[1]):
            solver.past_gradient[r, c] = solver.work[r, c]
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
def determinant(a, n):
    """Sign (whether negative) and logarithm of the leading n x n block's, which becomes its LU factor."""
    negative, size = False, 0.0
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[best, k]):
                best = i
        if best != k:
            negative = not negative
            for j in range(n):
                a[k, j], a[best, j] = a[best, j], a[k, j]
        if a[k, k] < 0.0:
            negative = not negative
        size += log(max(abs(a[k, k]), 1e-300))
        for i in range(k + 1, n):
            factor = a[i, k] / a[k, k] if a[k, k] != 0.0 else 0.0
            for j in range(k, n):
                a[i, j] -= factor * a[k, j]
    return negative, size


@kernel
def turns_back(memory):
    """Whether the rates of the variables at both ends of a step point against each other."""
    past, terms, along = memory.series.past, memory.series.terms, 0.0
    for i in range(memory.solver.order.shape[0]):
        along += past[1, i] * terms[1, i]
    return along <= 0.0


@kernel
def has_crossed(h, pivot, memory):
    """Whether a step of h seconds crosses: its determinant changes the sign, or vanishes between its ends.

    Branches of several loops that cross at once leave the sign: then, in a motion that does not turn back,
    the determinant is looked at where a least pivot vanishes that falls and rises linearly.
    """
    progress = memory.progress
    negative, behind = overlap(memory.series.terms, memory)
    if negative or progress.past_pivot >= BEFORE * progress.largest_pivot or turns_back(memory):
        return negative
    _, before = overlap(memory.series.past, memory)
    evaluate_series(h * progress.past_pivot / (progress.past_pivot + pivot), memory)
    _, between = overlap(memory.state, memory)
    evaluate_series(h, memory)
    return between < VANISHING + min(before, behind)


@kernel
def exactness(progress):
    """The tolerance of the series: the run's times the square of the relative pivot, at least EXACT."""
    relative = progress.past_pivot / progress.largest_pivot
    return min(progress.tolerance, max(progress.tolerance * relative * relative, EXACT))


@kernel
def exactness_across(progress):
    """The same of a step that crosses: terms that rounding makes grow with its length over the distance."""
    exact, pivot = exactness(progress), progress.past_pivot
    return max(exact, NOISE / pivot) if pivot < BEFORE * progress.largest_pivot else exact


@kernel
def passes_gap(crossed, pivot, memory):
    """Whether a step's violation is more than rounding, where it crosses or ends near a singular position."""
    progress = memory.progress
    if not crossed and min(pivot, progress.past_pivot) >= NEAR * progress.largest_pivot:
        return False
    return not progress.violation <= RESOLUTION
