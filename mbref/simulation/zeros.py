"""Times at which signals of a motion fall below zero, found to rounding from runs at chosen times."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from mbref.motions.motion import Motion

GRID = 33  # samples of a window in which signals are followed
NODES = 13  # samples of an interval with a zero; their polynomial has an error near rounding
CURVED = 0.02  # error of a cubic between samples / range of the signal, above which a window is shorter
SHARPER = 0.25  # of such a window
LEAST_WINDOW = 1e-12  # window / longest time, below which a signal does not leave zero
PULL = 1e-10  # force / largest force of a window that rounding may leave
MOST_ROOT_STEPS = 8  # steps of Newton's method; four reach rounding
FROM_ZERO = -1.0  # a signal that starts at zero is negative at the next sample


class Signal(NamedTuple):
    """A number of a motion that is positive until an event: values and rates (k,); forces have no rate.

    Values of at least ``-least`` count as zero; for forces the limit is relative to the largest one.
    """

    value: Callable[[Motion], np.ndarray]
    rate: Callable[[Motion], np.ndarray] | None = None
    least: float = 0.0

    def floor(self, value: np.ndarray) -> float:
        """Return the size that rounding may give to values (k,) that are zero."""
        return self.least if self.rate else PULL * float(np.abs(value).max(initial=0.0))


def first_zero(run: Callable[[np.ndarray], Motion], signals: Sequence[Signal], end: float) -> float | None:
    """Return the first time (s), up to an end, at which a signal falls below zero; None without one, or if
    the motion ends before. ``run`` returns the motion at increasing times (k,)."""
    begin, window = 0.0, end
    while begin < end:
        stop = min(begin + window, end)
        motion = run(np.append(np.linspace(begin, stop, GRID)[:-1], stop))
        if window > LEAST_WINDOW * end and any(_is_coarse(motion, signal) for signal in signals):
            window *= SHARPER
            continue
        found = [_first(run, motion, signal) for signal in signals]
        zeros = [time for time in found if time is not None]
        if FROM_ZERO in zeros:
            if window <= LEAST_WINDOW * end:
                return 0.0
            window /= GRID
        elif zeros:
            return min(zeros)
        elif len(motion.times) < GRID:
            return None
        else:
            begin, window = stop, 2 * window
    return None


def _is_coarse(motion: Motion, signal: Signal) -> bool:
    """Return whether samples are too far apart to follow a signal by cubic polynomials."""
    if not signal.rate or len(motion.times) < GRID:
        return False
    value, rate, step = signal.value(motion), signal.rate(motion), motion.times[2] - motion.times[0]
    between = (value[:-2:2] + value[2::2]) / 2 + step / 8 * (rate[:-2:2] - rate[2::2])
    return bool(np.abs(between - value[1::2]).max() > CURVED * np.ptp(value) + signal.least)


def _first(run: Callable[[np.ndarray], Motion], motion: Motion, signal: Signal) -> float | None:
    """Return the first time (s) in a motion at which a signal falls below zero, FROM_ZERO, or None."""
    value, times = signal.value(motion), motion.times
    floor = signal.floor(value)
    for k in range(len(times) - 1):
        if value[k + 1] < -floor or (signal.rate and _dips(times, value, signal.rate(motion), k)):
            if abs(value[k]) <= floor and value[k + 1] < -floor:
                return float(times[k]) or FROM_ZERO
            found = _between(run, signal, floor, float(times[k]), float(times[k + 1]))
            if found is not None:
                return found
    return None


def _dips(times: np.ndarray, value: np.ndarray, rate: np.ndarray, k: int) -> bool:
    """Return whether a signal, whose rate changes its sign from minus to plus, may be negative between."""
    if not rate[k] < 0.0 < rate[k + 1]:
        return False
    return bool(min(value[k], value[k + 1]) < max(-rate[k], rate[k + 1]) * (times[k + 1] - times[k]))


def _between(
    run: Callable[[np.ndarray], Motion], signal: Signal, floor: float, begin: float, end: float
) -> float | None:
    """Return the first time (s) in an interval at which a signal falls below zero, FROM_ZERO, or None."""
    places = -np.cos(np.pi * np.arange(NODES) / (NODES - 1))
    nodes = begin + (end - begin) * (places + 1) / 2
    nodes[-1] = end
    value = signal.value(run(nodes))
    below = np.flatnonzero(value < -floor)
    if not below.size or below[0] == 0:
        return None
    k = int(below[0])
    if abs(value[k - 1]) <= floor:
        return float(nodes[k - 1]) or FROM_ZERO
    law = np.polynomial.Chebyshev.fit(nodes, value, NODES - 1, domain=[begin, end])
    time = float(brentq(law, nodes[k - 1], nodes[k], xtol=1e-15 * end)) if law(nodes[k - 1]) > 0 else nodes[k]
    slope = float(law.deriv()(time))
    for _ in range(MOST_ROOT_STEPS):
        at = run(np.array([time]))
        slope = float(signal.rate(at)[0]) if signal.rate else slope
        step = float(signal.value(at)[0]) / slope if slope else 0.0
        time = min(max(time - step, begin), end)
        if abs(step) <= 4 * np.finfo(float).eps * end:
            break
    return time
