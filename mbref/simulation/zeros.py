"""Times at which signals of a motion fall below zero, found to rounding from runs at chosen times."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from mbref.motions.motion import Motion

GRID = 32  # intervals of a window in which signals are followed, an even number
PER_STEP = 16  # intervals for each step of the run, which resolves the motion's oscillations
PER_PERIOD = 32  # intervals for each period of a load over time, whose force may act on a body at rest
MOST = 8192  # intervals, above which a window is shorter
LEAST = 8  # intervals between two times at which a function of time changes its law
JUMP = 1e-12  # time before such a change / longest time, at which a signal has its value before the change
NODES = 13  # samples of an interval with a zero; their polynomial has an error near rounding
CURVED = 0.02  # error of a cubic between samples / range of the signal, above which a window is shorter
SHARPER = 0.25  # of such a window
LEAST_WINDOW = 1e-12  # window / longest time, below which a signal does not leave zero
PULL = 1e-10  # force / largest force of a window that rounding may leave
MOST_ROOT_STEPS = 8  # steps of Newton's method; four reach rounding
SAME_ZERO = 1e-13  # difference of times / longest time, by rounding, of signals that fall below zero at once
FROM_ZERO = -1.0  # a signal that starts at zero is negative at the next sample


class Signal(NamedTuple):
    """A number of a motion that is positive until an event: values and rates (k,); forces have no rate.

    Values of at least ``-least`` count as zero; forces also to PULL times the largest one.
    """

    value: Callable[[Motion], np.ndarray]
    rate: Callable[[Motion], np.ndarray] | None = None
    least: float = 0.0

    def floor(self, value: np.ndarray) -> float:
        """Return the size that rounding may give to values (k,) that are zero."""
        return self.least if self.rate else max(self.least, PULL * float(np.abs(value).max(initial=0.0)))


class Zero(NamedTuple):
    """A time (s) at which signals fall below zero, and their numbers."""

    time: float
    signals: tuple[int, ...]


def first_zero(
    run: Callable[[np.ndarray], Motion],
    signals: Sequence[Signal],
    end: float,
    knots: Sequence[float] = (),
    frequency: float = 0.0,
) -> Zero | None:
    """Return the first time (s), up to an end, at which signals fall below zero; None without one, or if
    the motion ends before. ``run`` returns the motion at increasing times (k,). At ``knots`` (s) functions
    of time change their law; ``frequency`` (rad/s) is the largest one of their sines."""
    begin, window = 0.0, end
    while begin < end:
        stop = min(begin + window, end)
        count = max(GRID, math.ceil(PER_PERIOD * frequency * (stop - begin) / (2 * math.pi)))
        times = _times(begin, stop, knots, min(count, MOST), JUMP * end)
        motion = run(times)
        count = max(count, math.ceil(PER_STEP * motion.cost.steps * (stop - begin) / stop))
        if len(times) <= count <= MOST:
            times = _times(begin, stop, knots, count, JUMP * end)
            motion = run(times)
        is_coarse = count > MOST or any(_is_coarse(motion, signal) for signal in signals)
        if is_coarse and window > LEAST_WINDOW * end:
            window *= SHARPER
            continue
        found = [_first(run, motion, signal) for signal in signals]
        zeros = [time for time in found if time is not None]
        if FROM_ZERO in zeros:
            if window <= LEAST_WINDOW * end:
                return Zero(0.0, tuple(k for k, time in enumerate(found) if time == FROM_ZERO))
            window /= GRID
        elif zeros:
            last = min(zeros) + SAME_ZERO * end
            together = (k for k, time in enumerate(found) if time is not None and time <= last)
            return Zero(min(zeros), tuple(together))
        elif len(motion.times) < len(times):
            return None
        else:
            begin, window = stop, 2 * window
    return None


def _times(begin: float, stop: float, knots: Sequence[float], count: int, jump: float) -> np.ndarray:
    """Return times of about ``count`` intervals, in pairs of equal ones, and of two last ones of ``jump`` (s)
    before each knot."""
    cuts = [begin, *(knot for knot in knots if begin + 4 * jump < knot < stop), stop]
    parts = []
    for first, last in itertools.pairwise(cuts):
        pairs = max(LEAST // 2, math.ceil(count * (last - first) / (stop - begin) / 2))
        before = [last - jump] if last < stop else []
        parts.append([*np.linspace(first, last - 2 * jump * len(before), 2 * pairs + 1), *before])
    return np.concatenate(parts)


def _is_coarse(motion: Motion, signal: Signal) -> bool:
    """Return whether samples are too far apart to follow a signal by cubic polynomials."""
    if not signal.rate or len(motion.times) < 3 or not len(motion.times) % 2:
        return False
    value, rate, step = signal.value(motion), signal.rate(motion), motion.times[2::2] - motion.times[:-2:2]
    between = (value[:-2:2] + value[2::2]) / 2 + step / 8 * (rate[:-2:2] - rate[2::2])
    return bool(np.abs(between - value[1::2]).max() > CURVED * np.ptp(value) + signal.least)


def _first(run: Callable[[np.ndarray], Motion], motion: Motion, signal: Signal) -> float | None:
    """Return the first time (s) in a motion at which a signal falls below zero, FROM_ZERO, or None."""
    value, times = signal.value(motion), motion.times
    rate, floor = signal.rate and signal.rate(motion), signal.floor(value)
    for k in range(len(times) - 1):
        ends = k + 1 if value[k + 1] < -floor else _end_of_dip(times, value, rate, k)
        if ends:
            if abs(value[k]) <= floor and value[k + 1] < -floor:
                return float(times[k]) or FROM_ZERO
            found = _between(run, signal, floor, float(times[k]), float(times[ends]))
            if found is not None:
                return found
    return None


def _end_of_dip(times: np.ndarray, value: np.ndarray, rate: np.ndarray | None, k: int) -> int:
    """Return the index of the sample up to which a signal may be negative after sample k, though no sample
    is: its rate changes its sign from minus to plus, or a sample is its minimum. Return 0 without one."""
    if rate is not None:
        steepest = max(-rate[k], rate[k + 1]) * (times[k + 1] - times[k])
        return (k + 1) * bool(rate[k] < 0.0 < rate[k + 1] and min(value[k : k + 2]) < steepest)
    if k + 2 >= len(times) or min(np.diff(times[k : k + 3])) <= 2 * JUMP * times[-1]:
        return 0
    first, lowest, last = value[k : k + 3]
    return (k + 2) * bool(lowest <= min(first, last) and lowest < max(first, last) - lowest)


def _between(
    run: Callable[[np.ndarray], Motion], signal: Signal, floor: float, begin: float, end: float
) -> float | None:
    """Return the first time (s) in an interval at which a signal falls below zero, FROM_ZERO, or None."""
    if end - begin <= 2 * JUMP * end:
        return end
    places = -np.cos(np.pi * np.arange(NODES) / (NODES - 1))
    nodes = begin + (end - begin) * (places + 1) / 2
    nodes[-1] = end
    value = signal.value(run(nodes))
    law = np.polynomial.Chebyshev.fit(nodes, value, NODES - 1, domain=[begin, end])
    k = int(np.argmax(value < -floor)) or int(np.argmin(value))
    if value[0] < -floor or (k in (0, NODES - 1) and not value[k] < -floor):
        return None
    below = float(nodes[k])
    if not value[k] < -floor:
        below = _lowest(law, nodes[k - 1 : k + 2])
        if not signal.value(run(np.array([below])))[0] < -floor:
            return None
        k += bool(below > nodes[k])
    if abs(value[k - 1]) <= floor:
        return float(nodes[k - 1]) or FROM_ZERO
    before = float(nodes[k - 1])
    time = float(brentq(law, before, below, xtol=1e-15 * end)) if law(before) > 0 > law(below) else below
    slope = float(law.deriv()(time))
    for _ in range(MOST_ROOT_STEPS):
        at = run(np.array([time]))
        slope = float(signal.rate(at)[0]) if signal.rate else slope
        step = float(signal.value(at)[0]) / slope if slope else 0.0
        time = min(max(time - step, begin), end)
        if abs(step) <= 4 * np.finfo(float).eps * end:
            break
    return time


def _lowest(law: np.polynomial.Chebyshev, nodes: np.ndarray) -> float:
    """Return the time at which a polynomial is least between the outer two of three nodes (3,), s."""
    first, _, last = map(float, nodes)
    found = minimize_scalar(
        law, bounds=(first, last), method="bounded", options={"xatol": 1e-9 * (last - first)}
    )
    return float(found.x)
