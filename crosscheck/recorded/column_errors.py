"""Errors of the columns of a table: each cell is compared within the rounding that its format gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from crosscheck.recorded.columns import VECTORS, kind_of
from crosscheck.recorded.explanations import with_signs
from crosscheck.recorded.number_formats import WHOLE

BEGINS = 0.01  # fraction of the largest error at which an error is said to begin
SHARE = 1e-3  # fraction of a column's range; a coarser rounding or tolerance is stated beside "right"
# fraction of a quantity's size, or of the column's range; numbers rounded more coarsely are not judged
COARSEST = 0.1
FINE = 1e-12  # fraction of a quantity's size; a finer rounding is not stated, also of constant columns
CLOSE = 1 - 1e-9  # fraction of the bound: smaller errors do not move a sample; the rest is for rounding
INNER = 1e-3  # weight of errors within their bounds: of times without a larger error, a middle one is taken
EVEN = 1e-3  # fraction of half a unit, by which evenly spaced times may differ in double precision
ROUNDS = 3  # parabolas, each about the time that the one before gives; the last one's error is rounding
NEWTON = 8  # steps of Newton's method; at an extremum each leaves a quarter of an error
SEARCH = 60  # steps of the search for a time within its rounding; each leaves two thirds of the interval
Columns = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class ColumnError:
    """Error of a column.

    Attributes
    ----------
    name : str
        The column.
    largest : float
        Largest error; if the column is off, of the samples at which it is off. SI units.
    bound : float
        Error that means nothing: of the reference, plus half a unit of the last digit. It is the bound at the
        sample of the largest error if the column is off, otherwise the largest bound.
    allowed : float
        The bound plus the tolerance times the size of the quantity.
    begins : float or None
        Time (s) at which the error first exceeds the part BEGINS of the largest error; None if right.
    rounded_to : int or None
        Number of significant digits of the column's largest number, if the rounding of numbers or times
        exceeds the part SHARE of the column's range.
    is_coarse : bool
        True if the rounding exceeds the part COARSEST of the quantity's size: the column cannot be judged.
    is_small : bool
        True if the tolerance exceeds the part SHARE of the column's largest number.
    """

    name: str
    largest: float
    bound: float
    allowed: float
    begins: float | None
    rounded_to: int | None = None
    is_coarse: bool = False
    is_small: bool = False

    @property
    def is_right(self) -> bool:
        """Return whether the error is within bound and tolerance together, and the digits can show it."""
        return self.largest <= self.allowed and not self.is_coarse


@dataclass(frozen=True)
class Compared:
    """Recorded and exact columns (k,) at times (k,), with the bound (k,) of each cell and the tolerance of
    each column.

    ``rounding`` (k,) is half a unit of the last digit of each cell, ``digits`` the number of significant
    digits of each column, ``scale`` the size of each column's quantity.
    """

    times: np.ndarray
    recorded: Columns
    exact: Columns
    bound: Columns
    tolerance: Mapping[str, float]
    rounding: Columns
    digits: Mapping[str, int]
    scale: Mapping[str, float]

    def allowed(self, name: str) -> np.ndarray:
        """Return the error (k,) that counts as right at each sample."""
        return self.bound[name] + self.tolerance[name]

    @property
    def is_right(self) -> bool:
        """Return whether no error of a cell exceeds what counts as right."""
        return all(
            bool((np.abs(column - self.exact[n]) <= self.allowed(n)).all())
            for n, column in self.recorded.items()
        )

    def errors(self) -> tuple[ColumnError, ...]:
        """Return the error of every column."""
        return tuple(self._error(name) for name in self.recorded)

    def _error(self, name: str) -> ColumnError:
        size, allowed = np.abs(self.recorded[name] - self.exact[name]), self.allowed(name)
        off = size > allowed
        half, digits = float(self.rounding[name].max()), self.digits.get(name, WHOLE)
        extent = float(np.ptp(self.exact[name]))
        rounded = digits if half > max(SHARE * extent, FINE * self.scale[name]) else None
        coarse = bool(half > COARSEST * max(extent, self.scale[name]))
        bound, top = float(self.bound[name].max()), float(np.abs(self.exact[name]).max())
        is_small = max(bound, FINE * self.scale[name]) < top < self.tolerance[name] / SHARE
        states = rounded, coarse, is_small
        if not off.any():
            return ColumnError(name, float(size.max()), bound, float(allowed.max()), None, *states)
        k = int(np.argmax(np.where(off, size, -1.0)))
        largest, begins = float(size[k]), off & (size > BEGINS * size[k])
        at = float(self.times[int(np.argmax(begins))])
        return ColumnError(name, largest, float(self.bound[name][k]), float(allowed[k]), at, *states)


def aligned(compared: Compared, half: np.ndarray, later: Mapping[str, Callable[..., np.ndarray]]) -> Compared:
    """Return the comparison at times within the rounding ``half`` (k,) of the written times.

    Evenly spaced times, three or more, count as exact. Other times are moved one by one. All columns of a
    sample are compared at one time. The sum of the parts of errors that exceed their bounds, relative to the
    bounds, is least; a cell that is off at every time within the rounding does not count, unless all cells of
    its row are. The motion is given by the splines ``later``; near each of ROUNDS times it is a parabola.
    """
    times, names = compared.times, list(compared.recorded)
    even = np.abs(times - np.linspace(times[0], times[-1], len(times))) <= EVEN * half
    is_even = len(times) > 2 and bool(even.all())
    if (half <= 8 * np.finfo(float).eps * times[-1]).all() or not names or is_even:
        return compared
    bound = np.array([compared.allowed(n) for n in names])
    left = np.array([compared.recorded[n] - compared.exact[n] for n in names])
    start = np.array([later[n](times) for n in names])
    low = np.where(times > half, -half, 0.0)

    def moved(shift: np.ndarray, order: int = 0) -> np.ndarray:
        found = [
            later[n](times + s, order) for n, s in zip(names, np.broadcast_to(shift, left.shape), strict=True)
        ]
        return np.array(found) - (0.0 if order else start)

    shift = np.zeros_like(half)
    if (np.abs(left) > CLOSE * bound).any():
        has_sign, recorded = _has_sign(names), compared.recorded
        for known in (has_sign, np.ones_like(has_sign)):
            can_be_right = _within_bounds(left, bound, moved, (low, half)) & known[:, None]
            counts = can_be_right | ~can_be_right.any(axis=0)
            for _ in range(ROUNDS):
                slopes, rest = (moved(shift, 1), moved(shift, 2)), left - moved(shift)
                shift = shift + _best_shift(rest, counts / bound, slopes, (low - shift, half - shift))
            if has_sign.all():
                break
            recorded = with_signs(dict(zip(names, start + moved(shift), strict=True)), recorded)
            left = np.array([recorded[n] - compared.exact[n] for n in names])
    change = dict(zip(names, moved(shift), strict=True))
    free = dict(zip(names, np.abs(moved(np.zeros_like(half), 1)) * half, strict=True))
    exact = {n: compared.exact[n] + change[n] for n in names}
    return replace(
        compared,
        times=times + shift,
        recorded=with_signs(exact, compared.recorded),
        exact=exact,
        rounding={n: np.maximum(compared.rounding[n], free[n]) for n in names},
    )


def _has_sign(names: Sequence[str]) -> np.ndarray:
    """Return (n,) whether the sign of a column means anything: of a part of a quaternion it does not, where
    the part passes zero."""
    wholes = [name.rpartition(".")[0] for name in names]
    size = len(VECTORS["orientation"])
    is_whole = [wholes.count(whole) == size for whole in wholes]
    return np.array([kind_of(n) != "orientation" or is_whole[k] for k, n in enumerate(names)])


def _within_bounds(
    left: np.ndarray,
    bound: np.ndarray,
    moved: Callable[..., np.ndarray],
    limits: tuple[np.ndarray, np.ndarray],
) -> np.ndarray:
    """Return (n, k) whether errors ``left`` (n, k) are within their bounds at some change of the time between
    ``limits`` (k,), by Newton's method from both limits and from between them.

    ``moved`` gives the motion since the written times, and its derivatives, at changes (n, k) of the times.
    """
    low, high = (np.broadcast_to(limit, left.shape) for limit in limits)
    found = np.zeros(left.shape, dtype=bool)
    for first in (np.zeros(left.shape), low, high):
        at = first
        for _ in range(NEWTON):
            rate, rest = moved(at, 1), left - moved(at)
            with np.errstate(over="ignore"):  # an infinite step ends at a limit
                step = np.divide(rest, rate, out=np.zeros_like(rest), where=rate != 0.0)
            at = np.clip(at + step, low, high)
        found |= np.abs(left - moved(at)) <= bound
    return found


def _best_shift(
    left: np.ndarray,
    weight: np.ndarray,
    slopes: tuple[np.ndarray, ...],
    limits: tuple[np.ndarray, np.ndarray],
) -> np.ndarray:
    """Return the changes (k,) of times, between ``limits`` (k,), at which the errors ``left`` (n, k) exceed
    their bounds, 1 / ``weight``, least, by first and second derivatives (n, k) of the motion."""
    (rate, curve), (low, high) = slopes, limits

    def excess(shift: np.ndarray) -> np.ndarray:
        size = weight * np.abs(left - rate * shift - curve * shift**2 / 2)
        return np.asarray(
            np.maximum(size - CLOSE, 0.0).sum(axis=0) + INNER * (np.minimum(size, 1.0) ** 2).mean(axis=0)
        )

    for _ in range(SEARCH):
        third = (high - low) / 3
        is_left = excess(low + third) <= excess(high - third)
        low, high = np.where(is_left, low, low + third), np.where(is_left, high - third, high)
    return (low + high) / 2
