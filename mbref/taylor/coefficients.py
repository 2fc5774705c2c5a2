"""Sizes of Taylor coefficients, and the direction of the motion that they describe."""

from __future__ import annotations

from mbref.kernels.compilation import kernel
from mbref.linear_algebra.vectors import larger
from mbref.taylor.simd import WIDTH, load, max_abs


@kernel
def largest_coefficient(series, k, variables):
    """Return the largest absolute coefficient of order k."""
    size = 0.0
    for i in range(variables):
        size = larger(size, series[k, i])
    return size


@kernel
def largest_used(k, memory):
    """Return the largest absolute coefficient of order k of the series that the step evaluates."""
    series, size, lanes = memory.series, 0.0, memory.series.past.shape[1]
    for j in range(0, memory.solver.pivot_columns.shape[0], WIDTH):
        size = max(size, max_abs(load(series.variable, j) * load(series.past, k * lanes + j)))
    return size


@kernel
def distance_moved(h, memory):
    """Return the largest distance that a variable moves in a step of h seconds, at the larger of its rates at
    both ends."""
    variables, series = memory.solver.pivot_columns.shape[0], memory.series
    before, after = (
        largest_coefficient(series.past, 1, variables), largest_coefficient(series.terms, 1, variables),
    )  # fmt: skip
    return h * max(before, after)


@kernel
def turns_back(rates, memory):
    """Return whether rates of the variables, in row 1, point against the rates at the start of the step."""
    past, along = memory.series.past, 0.0
    for i in range(memory.solver.pivot_columns.shape[0]):
        along += past[1, i] * rates[1, i]
    return along <= 0.0
