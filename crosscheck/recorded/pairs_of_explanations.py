"""Explanations of a difference that has two causes: the second is fitted to what the first leaves."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from crosscheck.judge.deadline import ask
from crosscheck.recorded.explanations import Cause, Columns, Difference, vector_names
from crosscheck.recorded.simple_causes import simple

FIRST = 6  # single explanations that are completed by a second one: the best by the difference that remains
MOST = 0.9  # fraction of the difference: an explanation that leaves more explains nothing


def pairs(difference: Difference, singles: Iterable[Cause]) -> Iterator[Cause]:
    """Return pairs of causes: the best of the single causes, each completed by a cause of what it leaves.

    Asks for the deadline before each cause.
    """
    before, sized = difference.size({}), []
    for n, cause in enumerate(singles):
        ask()
        sized.append((difference.size(cause.columns) / before, n, cause))
        sized = sorted(entry for entry in sized if entry[0] < MOST)[:FIRST]
    for _, _, (sentence, complexity, columns, _) in sized:
        explained = {**difference.exact, **columns}
        left = replace(
            difference,
            exact=explained,
            later=_explained(difference, explained),
            begin=float(difference.times[0]),
            end=float(difference.times[-1]),
            every=None,
        )
        for second, more, predicted, _ in simple(left):
            both = {**columns, **predicted}
            yield Cause(f"{sentence}; and {second}", complexity + more + 1, both, "pair")


def _explained(difference: Difference, columns: Columns) -> dict[str, Callable[[np.ndarray], np.ndarray]]:
    """Return the explained columns at any time, and all other columns of the exact motion."""
    splines = {n: CubicSpline(difference.times, column) for n, column in _continuous(columns).items()}
    return {**difference.later, **splines}


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
