"""Functions of time by the judge: values and series in any arithmetic, and the times at which pieces end.

A table is joined by its cubic spline, found from the second derivatives at its rows: tridiagonal equations,
whose ends are eliminated because the third derivative is continuous at the second and at the last but one
row. The equations of a periodic table form a ring, which is cut at one row and closed by its superposition.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import numpy as np

from crosscheck.judge.arithmetic import DOUBLE, Arithmetic
from mbref.scene import Scene, TimeFunction

NEAR = 1e-12  # relative distance below which two times count as one time of switching


class Piece(NamedTuple):
    """A piece of a function from a time (s) on: whether polynomial and sine act, and the cubic (4,) of a
    table in t - knot."""

    acts: bool
    knot: Any
    cubic: np.ndarray


def ends(function: TimeFunction) -> tuple[float, ...]:
    """Return the times (s), ascending, at which pieces of a function end."""
    inner = {t for t, _ in function.table[1:-1]} if function.table else set()
    return tuple(sorted(t for t in {*function.interval, *inner} if 0.0 < t < np.inf))


def functions_of(scene: Scene) -> list[TimeFunction]:
    """Return the functions of time of a scene's drivers and loads."""
    of_drivers = [function for driver in scene.driver for function in driver.functions]
    return [*of_drivers, *(load.over_time for load in scene.load if load.over_time)]


def next_end(scene: Scene, since: float) -> float:
    """Return the first time (s) after another at which a piece of a function ends; infinite without such a
    time."""
    later = [t for f in functions_of(scene) for t in ends(f) if t > since * (1 + NEAR)]
    return min(later, default=np.inf)


def value(
    function: TimeFunction, t: np.ndarray | float, derivative: int = 0, since: float | None = None
) -> np.ndarray:
    """Return the value of a function, or a time derivative of it, at times t (…), s.

    The piece is the one that acts from ``since`` (s) on, by default the piece at each time.
    """
    t = np.asarray(t, dtype=float)
    if since is not None or not ends(function):
        return values(function, t, since or 0.0, derivative)
    number, found = np.searchsorted(ends(function), t, side="right"), np.zeros_like(t)
    for k in np.unique(number):
        begin = (0.0, *ends(function))[k]
        found[number == k] = values(function, t[number == k], begin, derivative)
    return found


def values(
    function: TimeFunction,
    t: np.ndarray,
    since: float,
    derivative: int = 0,
    arithmetic: Arithmetic = DOUBLE,
) -> np.ndarray:
    """Return values or derivatives (…) at times t (…), of the piece that acts from ``since`` (s) on."""
    piece = piece_of(function, since, arithmetic)
    found = _polynomial(piece.cubic, t - piece.knot, derivative)
    if piece.acts:
        found = found + _polynomial(arithmetic.array(function.coefficients), t, derivative)
    if piece.acts and function.sine is not None:
        sine = function.sine
        amplitude, frequency, phase = arithmetic.array((sine.amplitude, sine.frequency, sine.phase))
        angle = frequency * t + phase
        wave = np.cos(angle) if derivative % 2 else np.sin(angle)
        sign = -1 if derivative % 4 > 1 else 1
        found = found + sign * amplitude * frequency**derivative * wave
    return np.asarray(found)


def _polynomial(coefficients: np.ndarray, t: np.ndarray, derivative: int) -> np.ndarray:
    for _ in range(derivative):
        coefficients = coefficients[1:] * np.arange(1, len(coefficients))
    total = 0 * t
    for c in coefficients[::-1]:
        total = total * t + c
    return np.asarray(total)


def piece_of(function: TimeFunction, since: float, arithmetic: Arithmetic) -> Piece:
    """Return the piece that acts from a time (s) on."""
    now = since * (1 + NEAR)
    start, stop = function.interval
    acts = start <= now < stop
    if not acts or function.table is None:
        return Piece(acts, arithmetic.number(0.0), arithmetic.zeros(4))
    times = [t for t, _ in function.table]
    k = min(max(int(np.searchsorted(times, now, side="right")) - 1, 0), len(times) - 2)
    return Piece(acts, arithmetic.number(times[k]), _spline(function.table, function.periodic, arithmetic)[k])


@functools.lru_cache(maxsize=64)
def _spline(table: tuple[tuple[float, float], ...], periodic: bool, arithmetic: Arithmetic) -> np.ndarray:
    """Return coefficients (n - 1, 4) of the cubics between n rows, ascending, about the earlier row."""
    x, y = (arithmetic.array(column) for column in zip(*table, strict=True))
    h = x[1:] - x[:-1]
    slope = (y[1:] - y[:-1]) / h
    second = (_in_a_ring if periodic else _between_ends)(h, slope, arithmetic)
    linear = slope - h * (2 * second[:-1] + second[1:]) / 6
    return arithmetic.settled(
        np.stack([y[:-1], linear, second[:-1] / 2, (second[1:] - second[:-1]) / (6 * h)], axis=1)
    )


def _between_ends(h: np.ndarray, slope: np.ndarray, arithmetic: Arithmetic) -> np.ndarray:
    """Return the second derivatives (n,) at the rows, for intervals h and slopes (n - 1,), not-a-knot."""
    last = len(h)
    lower, upper = h[:-1] + 0 * h[1:], h[1:] + 0 * h[:-1]
    diagonal, right = 2 * (h[:-1] + h[1:]), 6 * (slope[1:] - slope[:-1])
    first, final = h[0] / h[1], h[-1] / h[-2]
    diagonal[0], upper[0] = diagonal[0] + h[0] * (1 + first), upper[0] - h[0] * first
    diagonal[-1], lower[-1] = diagonal[-1] + h[-1] * (1 + final), lower[-1] - h[-1] * final
    second = arithmetic.zeros(last + 1)
    second[1:last] = _tridiagonal(lower, diagonal, upper, right, arithmetic)
    second[0] = second[1] - first * (second[2] - second[1])
    second[last] = second[last - 1] + final * (second[last - 1] - second[last - 2])
    return second


def _in_a_ring(h: np.ndarray, slope: np.ndarray, arithmetic: Arithmetic) -> np.ndarray:
    """Return the second derivatives (n,) at the rows of a period, of which the last one repeats the first.

    The ring is cut at the first row: its second derivative is 0, and then 1 with no right-hand side. The
    equation of the first row determines the share of the second solution.
    """
    before = np.concatenate([h[-1:], h[:-1]])
    right = 6 * (slope - np.concatenate([slope[-1:], slope[:-1]]))
    rest = slice(1, None)
    parts = before[rest] + 0 * h[rest], 2 * (before + h)[rest], h[rest] + 0 * before[rest]
    ends = arithmetic.zeros(len(h) - 1)
    ends[0], ends[-1] = ends[0] - before[1], ends[-1] - h[-1]
    cut, moved = (_tridiagonal(*parts, side, arithmetic) for side in (right[rest], ends))
    diagonal = 2 * (before[0] + h[0])
    share = (right[0] - before[0] * cut[-1] - h[0] * cut[0]) / (
        diagonal + before[0] * moved[-1] + h[0] * moved[0]
    )
    second = arithmetic.zeros(len(h) + 1)
    second[0], second[1:-1], second[-1] = share, cut + share * moved, share
    return second


def _tridiagonal(
    lower: np.ndarray, diagonal: np.ndarray, upper: np.ndarray, right: np.ndarray, arithmetic: Arithmetic
) -> np.ndarray:
    """Return the solution (k,) of k tridiagonal equations; ``lower[0]`` and ``upper[-1]`` are not read."""
    diagonal, right, count = diagonal.copy(), right.copy(), len(right)
    for i in range(1, count):
        factor = lower[i] / diagonal[i - 1]
        diagonal[i] = diagonal[i] - factor * upper[i - 1]
        right[i] = right[i] - factor * right[i - 1]
    found = arithmetic.zeros(count + 1)
    for i in range(count - 1, -1, -1):
        found[i] = (right[i] - upper[i] * found[i + 1]) / diagonal[i]
    return found[:count]
