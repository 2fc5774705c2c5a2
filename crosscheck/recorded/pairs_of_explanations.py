"""Explanations of a difference that has two causes: the second is fitted to what the first leaves."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from crosscheck.recorded.explanations import Columns, Difference, simple, vector_names

FIRST = 6  # single explanations that are completed by a second one: the best by the difference that remains
MOST = 0.9  # fraction of the difference: an explanation that leaves more explains nothing
Found = tuple[str, int, Columns]


def pairs(difference: Difference, singles: Sequence[Found], seconds: float) -> Iterator[Found]:
    """Return (sentence, number of fitted parameters, predicted columns) for pairs of explanations.

    ``singles`` are the explanations by one cause. The search ends after CPU time (s).
    """
    before, end = difference.size({}), time.process_time() + seconds
    sized = [(difference.size(columns) / before, n) for n, (_, _, columns) in enumerate(singles)]
    for _, n in sorted(entry for entry in sized if entry[0] < MOST)[:FIRST]:
        sentence, complexity, columns = singles[n]
        explained = {**difference.exact, **columns}
        later = _explained(difference, explained)
        left = replace(difference, exact=explained, later=later, begin=float(difference.times[0]))
        for second, more, predicted in simple(left):
            if time.process_time() > end:
                return
            yield f"{sentence}; and {second}", complexity + more + 1, {**columns, **predicted}


def _explained(difference: Difference, columns: Columns) -> Callable[[np.ndarray], Columns]:
    """Return the explained columns at any time, and all other columns of the exact motion."""
    splines = {n: CubicSpline(difference.times, column) for n, column in _continuous(columns).items()}
    return lambda t: {**difference.later(t), **{name: spline(t) for name, spline in splines.items()}}


def _continuous(columns: Columns) -> Columns:
    """Return the columns with signs of quaternions that do not change between samples."""
    found = dict(columns)
    for body in {name.removesuffix(".orientation.w") for name in columns if name.endswith(".orientation.w")}:
        names = vector_names(body, "orientation")
        if all(name in columns for name in names):
            q = np.array([columns[name] for name in names])
            signs = np.where(np.sum(q[:, 1:] * q[:, :-1], axis=0) < 0, -1.0, 1.0)
            q[:, 1:] *= np.cumprod(signs)
            found.update(zip(names, q, strict=True))
    return found
