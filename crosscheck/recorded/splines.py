"""Splines through the columns of a motion, in pieces between the times at which drivers and loads change, and
between events."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from crosscheck.judge.time_functions import ends, functions_of
from mbref.scene import Scene

DEGREE = 5  # degree of the splines through the exact motion
FEWEST = DEGREE + 1  # samples of a piece; a shorter piece belongs to the one before it
AT_END = 1e-9  # fraction of the duration: nearer samples may be on either side of a leap


@dataclass(frozen=True)
class Pieces:
    """A function of time (s) by a spline for each piece; ``ends`` (p - 1,) are the times between pieces."""

    ends: np.ndarray
    splines: tuple[BSpline, ...]

    def __call__(self, times: np.ndarray, derivative: int = 0) -> np.ndarray:
        """Return values or derivatives (k,) at times (k,)."""
        piece, found = np.searchsorted(self.ends, times, side="right"), np.zeros(np.shape(times))
        for k in np.unique(piece):
            found[piece == k] = self.splines[k](times[piece == k], derivative)
        return found


def splines(
    scene: Scene, times: np.ndarray, columns: dict[str, np.ndarray], events: Sequence[float] = ()
) -> dict[str, Pieces]:
    """Return columns (k,) as functions of time; a piece ends where a function of time of the scene changes,
    and at the times (s) of events, because accelerations, forces or velocities leap there."""
    between = _ends(scene, times, events)
    piece = np.searchsorted(between, times, side="right")
    near = np.abs(times[:, None] - between[None]).min(axis=1, initial=np.inf) <= AT_END * times[-1]
    places = [np.flatnonzero((piece == k) & ~near) for k in range(len(between) + 1)]
    return {
        name: Pieces(between, tuple(_spline(times[place], column[place]) for place in places))
        for name, column in columns.items()
    }


def _ends(scene: Scene, times: np.ndarray, events: Sequence[float]) -> np.ndarray:
    """Return the times (s) between pieces of at least FEWEST samples."""
    found: list[float] = []
    for end in sorted({*events, *(end for function in functions_of(scene) for end in ends(function))}):
        before = np.sum((times > (found[-1] if found else -1.0)) & (times < end))
        if before > FEWEST and np.sum(times > end) > FEWEST:
            found.append(end)
    return np.array(found)


def _spline(times: np.ndarray, column: np.ndarray) -> BSpline:
    """Return the spline of degree DEGREE, or less if there are few samples, through a column (k,)."""
    if len(times) == 1:
        return BSpline([0.0, 1.0], column, 0)
    degree = min(DEGREE, len(times) - 1)
    return make_interp_spline(times, column, degree - 1 + degree % 2)
