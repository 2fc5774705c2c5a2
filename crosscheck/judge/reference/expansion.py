"""Taylor series of a motion in natural coordinates, and the length of the steps for which it is accurate.

Of order k the unknowns X_{k+2} and λ_k enter linearly, with one and the same matrix [M Gᵀ; G 0] at the time
of expansion (J. D. Pryce, BIT 41, 2001, on Taylor series of differential-algebraic equations), so that one
factorisation serves all orders and nothing is differentiated by hand.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from crosscheck.judge.deadline import ask
from crosscheck.judge.reference.held_rows import HeldRows
from crosscheck.judge.reference.natural import NaturalCoordinates
from crosscheck.judge.reference.natural_joints import GearSeries, convolved
from crosscheck.judge.reference.natural_loads import Loads, LoadSeries
from crosscheck.judge.reference.saddle_point import SaddlePoint

LEAST_TERMS = 6  # smallest number of terms of a series


class Expansion:
    """The Taylor series about a time t: coordinates ``x`` (order + 3, 3, n), angles of loads of joints, and
    joint coordinates of couplings and armatures."""

    @np.errstate(all="ignore")  # a series that is not finite has no reach, which ends the motion
    def __init__(
        self,
        of: NaturalCoordinates,
        held: HeldRows,
        loads: Loads,
        order: int,
        t: Any,
        start: tuple[np.ndarray, np.ndarray],
        angles: Sequence[Any],
        turned: Sequence[Any],
    ):
        terms, zeros = order + 3, of.arithmetic.zeros
        m, p = len(held.numbers), len(held.products)
        self._held, self._drives = held, held.drives(t, terms)
        self._loads: LoadSeries = loads.series(t, angles, terms)
        self._gears = GearSeries(of.joints, held.gears, turned, terms, zeros)
        rows = held.all_gradients(start[0], self._drives, turned)
        self._system = SaddlePoint(of.mass, rows, held.compliance(zeros), of.arithmetic)
        self.x = zeros(terms, 3, start[0].shape[1])
        self._u, self._w = zeros(2, terms, 3, p)
        self._products, self._multipliers, self._factors = zeros(terms, p), zeros(terms, m), zeros(terms, p)
        self.x[0], self.x[1] = start
        self._grow(0)
        self._grow(1)
        for k in range(order + 1):
            ask()
            self._solve(k)

    @property
    def angles(self) -> list[np.ndarray]:
        """Series of the angles of loads about joints' axes."""
        return [load.value for load in self._loads.turned]

    @property
    def turned(self) -> list[np.ndarray]:
        """Return the series of the joint coordinates."""
        return [coordinate.value for coordinate in self._gears.coordinates]

    def _grow(self, k: int) -> None:
        """Compute order k of all quantities that follow from order k of the coordinates."""
        self._u[k], self._w[k] = self._held.u(self.x[k]), self._held.w(self.x[k])
        self._products[k] = convolved(self._u, self._w, k).sum(axis=0)
        self._loads.grow(k, self.x)
        self._gears.grow(k, self.x)

    def _solve(self, k: int) -> None:
        """Compute order k of the multipliers and order k + 2 of the coordinates from the equations of motion
        and the rows."""
        j = k + 2
        self._products[j] = convolved(self._u, self._w, j).sum(axis=0)  # all terms without X_j
        self._gears.grow(j, self.x)
        gap = np.concatenate(
            [self._drives.combined(self._products, j) - self._drives.c[j], self._gears.gaps(j)]
        )
        self._factors[k] = self._drives.spread(self._multipliers, k)  # all terms without λ_k
        force = self._loads.order(k, self.x) - self._reaction(k) - self._gears.pull(k)
        x, found = self._system.solve(force[:, :-4], -gap * (j * (j - 1)))
        count = self._multipliers.shape[1]
        self._multipliers[k] = found[:count]
        self._gears.put(found[count:], k)
        self.x[j, :, :-4] = x / (j * (j - 1))
        self._factors[k] = self._drives.spread(self._multipliers, k)
        self._grow(j)

    def _reaction(self, k: int) -> np.ndarray:
        """Return order k (3, n) of Gᵀ λ."""
        factors = self._factors[:, None]
        on_u, on_w = convolved(factors, self._w, k), convolved(factors, self._u, k)
        return self._held.to_u(on_u) + self._held.to_w(on_w)


class Series:
    """Series of the coordinates about a time, and the sizes of its terms, which determine the possible steps.

    The size of a term is its norm or the norm of the next term, whichever is larger, so that a series with
    even orders only is not cut too early. The series ends with its smallest term, because later terms contain
    growing rounding noise.
    """

    def __init__(self, x: np.ndarray):
        self._x, self._orders = x, np.arange(len(x))
        sizes = [np.abs(term).max() for term in x]
        self._logs = np.array([float(np.log(size)) if float(size) > 0 else -np.inf for size in sizes])
        self._logs -= self._logs[0]

    def reach(self, tolerance: float) -> float:
        """Return the longest step (s) for which the smallest term is not above the tolerance."""
        with np.errstate(over="ignore"):
            each = np.exp((np.log(tolerance) - self._logs[1:]) / self._orders[1:])
        return float(np.minimum(each[:-1], each[1:])[LEAST_TERMS - 1 :].max())

    def left_out(self, h: float) -> float:
        """Return the size of the first omitted term for a step h (s), relative to the coordinates."""
        return float(np.exp(self._pairs(h).min()))

    def terms(self, h: float) -> int:
        """Return the number of terms that a step h (s) needs."""
        return LEAST_TERMS + 1 + int(np.argmin(self._pairs(h)))

    def _pairs(self, h: float) -> np.ndarray:
        sizes = self._logs + self._orders * np.log(h)
        return np.maximum(sizes[:-1], sizes[1:])[LEAST_TERMS:]


def value(series: np.ndarray, d: Any, derivative: int = 0) -> Any:
    """Return a series (terms, …), or a derivative of it, at a distance d (s), by Horner's scheme."""
    for _ in range(derivative):
        series = series[1:] * np.arange(1, len(series)).reshape(-1, *(1,) * (series.ndim - 1))
    total = series[-1]
    for coefficient in series[-2::-1]:
        total = total * d + coefficient
    return total
