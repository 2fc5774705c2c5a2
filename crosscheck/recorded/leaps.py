"""Samples at times at which a load is switched, or at which constraints come or go or a stop is met:
accelerations and forces leap there, at events velocities too, and a tool may write the values before or after
the leap."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from crosscheck.judge.time_functions import functions_of
from crosscheck.recorded.column_errors import Compared
from mbref.scene import Scene

SAME = 4 * float(np.finfo(float).eps)  # relative difference of times by their rounding
LOCATED = 1e-9  # relative error of the time of an event that a tool locates by itself
BEFORE = 1e-12  # time before a leap / its time, at which all numbers have their values before it


def leaps(scene: Scene, times: np.ndarray, events: Sequence[float] = ()) -> dict[int, tuple[float, float]]:
    """Return for each sample (k,) at a time of switching, up to rounding, or at an event, within LOCATED, a
    time before the leap and the time of the leap (s)."""
    switched = {t for f in functions_of(scene) for t in f.interval if 0.0 < t < np.inf}
    found = {}
    for time, near in (*((t, SAME) for t in switched), *((t, LOCATED) for t in events if t > 0.0)):
        k = int(np.argmin(np.abs(times - time)))
        if abs(times[k] - time) <= near * time:
            found[k] = (time * (1 - BEFORE), time)
    return found


def with_sides(
    compared: Compared,
    sides: Mapping[int, tuple[float, float]],
    times: np.ndarray,
    columns: Mapping[str, np.ndarray],
) -> Compared:
    """Return the comparison of each sample at a leap with the nearer side, of all columns with one side.

    ``columns`` (m,) is the exact motion at ``times`` (m,).
    """
    exact = {n: column.copy() for n, column in compared.exact.items()}
    names = list(exact)
    for k, both in sides.items():
        if k >= len(compared.times):
            continue
        rows = [np.array([exact[n][k] for n in names])]
        rows += [np.array([columns[n][row] for n in names]) for row in np.searchsorted(times, both)]
        recorded = np.array([compared.recorded[n][k] for n in names])
        allowed = np.array([compared.allowed(n)[k] for n in names])
        excess = [np.maximum(np.abs(recorded - row) - allowed, 0.0) / allowed for row in rows]
        best = rows[int(np.argmin([each.sum() for each in excess]))]
        for n, number in zip(names, best, strict=True):
            if abs(compared.recorded[n][k] - exact[n][k]) > compared.allowed(n)[k]:
                exact[n][k] = number
    return replace(compared, exact=exact)
