"""Chebyshev–Picard panels: the differential equation is solved on a whole interval of time (panel) at once,
in any arithmetic.

The rates at the Chebyshev points of a panel are interpolated and integrated exactly, and the iteration is
repeated until it converges (Clenshaw and Norton, Computer Journal 6, 1963; Bai and Junkins, Journal of the
Astronautical Sciences 58, 2011).  Positions follow from the velocities of the same sweep, which about halves
the number of sweeps.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from crosscheck.judge.arithmetic import Arithmetic, doubles
from crosscheck.judge.deadline import ask
from crosscheck.judge.reference.crossing import bridged, singular_ahead, singular_time

SWEEPS = 60  # Picard iterations before a panel is shortened
MANY = 35  # iterations; after more iterations the next panel is not longer
SETTLED = 2000.0  # rounding units; limit of the last change and of the last coefficients of the series
BRIDGED = 1e4  # factor on the tolerance across a singular position
TELLING = 1e-3  # change of an iterate below which its series determines the length of a panel
ROUGHLY = 1.2  # safety factor on a panel length estimated from the series of an iterate
SPARE = 0.9  # panel length / longest length that the series resolves
# factors on the length of the next panel: largest, after a failed panel, smallest
LONGEST, SHORTER, SHORTEST = 1.6, 0.6, 0.5
FLOOR = 1e-3  # fraction of the largest column that is the least scale of a column
DIVERGES = 1e3
LAST = 3  # number of last coefficients of a series that must be small
# ratio of the last eighth of the coefficients to the eighth before, above which a series ends in rounding
# noise
FLAT = 0.1
NOISE = 4.0  # multiple of the last eighth of the coefficients: noise level of an iteration
NOISIEST = 1e5  # multiple of the tolerance: largest noise of a converged panel


class Equations(Protocol):
    """Differential equations y' of states (K, n).

    The rates of the first ``light`` columns are cheap to compute, and follow from all columns.
    """

    light: int

    def light_rates(self, y: np.ndarray) -> np.ndarray:
        """Return the rates (K, light) of the first columns."""

    def other_rates(self, t: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the rates (K, n - light) of all other columns, and the distance (K,) of their equations from
        singularity."""

    def nearer(self, t: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return states that violate the constraints less; near singular positions, the rates of states that
        violate the constraints lose digits."""


@dataclass(frozen=True)
class Panel:
    """An interval of time: start, length, states (nodes, n) and rates of the columns after the light ones.

    Further fields are: whether the iteration has converged; a factor on the length for the next panel or
    another attempt; the place in [-1, 1] of a crossed singular position; the place (from -1 on) of a
    predicted singular position.
    """

    start: Any
    length: Any
    states: np.ndarray
    rates: np.ndarray
    settled: bool
    factor: float
    crossing: float | None = None
    foreseen: float | None = None
    sweeps: int = 0

    def time(self, place: float | None) -> float | None:
        """Return the time (s) of a place."""
        return None if place is None else float(self.start + self.length * (place + 1) / 2)


class Panels:
    """Matrices for a number of Chebyshev points, and the iteration on these points."""

    def __init__(self, arithmetic: Arithmetic, nodes: int):
        self.arithmetic, self.count = arithmetic, nodes
        self.tolerance = SETTLED * arithmetic.eps
        last, i = nodes - 1, np.arange(nodes)
        cosine = _cosines(arithmetic, last)
        self.nodes = -1 * cosine[i]
        self.series = cosine[(i[:, None] * (last - i)) % (2 * last)] * 2 / last
        self.series[:, [0, last]] = self.series[:, [0, last]] / 2
        self.series[[0, last]] = self.series[[0, last]] / 2
        values = cosine[(np.arange(nodes + 1) * (last - i)[:, None]) % (2 * last)]  # values of T_0 … T_nodes
        self.integral = self.times(_antiderivatives(values), self.series)

    def times(self, matrix: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Return matrix products (m, n) (n, k); Arb's own products if elements are objects."""
        if not self.arithmetic.digits:
            return matrix @ values
        from flint import arb_mat

        a, b = (arb_mat(x.tolist()) for x in (matrix, values))
        out = np.array([*(a * b).entries(), None], dtype=object)[:-1]
        return self.arithmetic.settled(out.reshape(matrix.shape[0], values.shape[1]))

    def panel(self, equations: Equations, start: Any, length: Any, guess: np.ndarray) -> Panel:
        """Return the solution that starts at the first state of a guess (nodes, n)."""
        t, places = start + length / 2 * (self.nodes + 1), doubles(self.nodes)
        y, last, crossing = guess, np.inf, None
        for sweep in range(1, SWEEPS):
            ask()
            with np.errstate(all="ignore"):
                here = y if crossing is None else equations.nearer(t, y)
                rates, distance = equations.other_rates(t, here)
                if last < 1:
                    found = singular_time(places, distance)
                    crossing = crossing if found is None else found
                if crossing is not None:
                    rates = bridged(places, rates, distance)
                better, size = self._integrated(equations, y, rates, length)
                change = (np.abs(doubles(better - y)) / size).max(initial=0.0)
            if not np.isfinite(change) or change > DIVERGES * last:
                return Panel(start, length, guess, rates, False, SHORTEST, foreseen=crossing)
            y, last = self.arithmetic.settled(better), min(last, change)
            panel = Panel(start, length, y, rates, False, SHORTER, crossing, sweeps=sweep)
            if (progress := self._progress(panel, size, change, distance)) is not None:
                return progress
        return Panel(start, length, guess, rates, False, SHORTER, foreseen=crossing)

    def _integrated(
        self, equations: Equations, y: np.ndarray, rates: np.ndarray, length: Any
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return states (nodes, n) from the first state on, for given rates of the columns after the light
        ones, and the columns' sizes (n,)."""
        light, half, better = equations.light, length / 2, y.copy()
        better[:, light:] = y[0, light:] + half * self.times(self.integral, rates)
        moves = equations.light_rates(better)
        better[:, :light] = y[0, :light] + half * self.times(self.integral, moves)
        return better, self._size(better, np.concatenate([moves, rates], axis=1) * length, light)

    def _progress(self, panel: Panel, size: np.ndarray, change: float, distance: np.ndarray) -> Panel | None:
        """Return the panel once an iterate has converged, or the factor by which it must be shorter."""
        tolerance = self.tolerance * (1 if panel.crossing is None else BRIDGED)
        # a change of iterates across a singular position does not decrease regularly
        if change > (TELLING if panel.crossing is None else tolerance):
            return None
        series = self._series(panel.rates * panel.length, size[-panel.rates.shape[1] :])
        tolerance = max(tolerance, self._noise(series))
        fits, settled = self._fits(series, change, tolerance), change <= tolerance
        if fits < 1 / (1 if settled else ROUGHLY):
            factor = max(SPARE * fits, SHORTEST)
            return replace(panel, factor=factor, crossing=None, foreseen=panel.crossing, sweeps=0)
        if not settled:
            return None
        factor = min(SPARE * fits, LONGEST if panel.sweeps < MANY else 1.0)
        return replace(
            panel, settled=True, factor=factor, foreseen=singular_ahead(doubles(self.nodes), distance)
        )

    def _series(self, moved: np.ndarray, size: np.ndarray) -> np.ndarray:
        """Return the largest Chebyshev coefficients (nodes,) of columns (nodes, n), relative to the sizes
        (n,)."""
        return (np.abs(doubles(self.times(self.series, moved))) / size).max(axis=1, initial=0.0)

    def _noise(self, series: np.ndarray) -> float:
        """Return the noise of an iterate that ill-conditioned equations cause.

        The noise is 0 if the series decreases to its end, or to the tolerance.
        """
        few = len(series) // 8
        before, last = series[-2 * few : -few].max(), series[-few:].max()
        noisy = self.tolerance < last < NOISIEST * self.tolerance and last > FLAT * before
        return NOISE * float(last) if noisy else 0.0

    def _fits(self, series: np.ndarray, change: float, tolerance: float) -> float:
        """Return the factor by which a panel with an equal number of points could be longer. The coefficients
        decrease geometrically: if an iterate needs k coefficients down to the size of its change, the
        solution needs k log(tolerance) / log(change); if the iterate has fewer coefficients, the last
        coefficient is used.
        """
        level = max(change, tolerance)
        above = np.flatnonzero(series > level)
        needed = above.max(initial=0) + 1
        if needed > self.count - LAST:
            needed, level = self.count, min(max(series[-LAST:].max(), level), TELLING)
        return float((self.count - LAST) / (needed * np.log(tolerance) / np.log(level)))

    @staticmethod
    def _size(y: np.ndarray, moved: np.ndarray, light: int) -> np.ndarray:
        """Return the scales (n,) of the columns' changes."""
        size = np.maximum(np.abs(doubles(y)).max(axis=0), np.abs(doubles(moved)).max(axis=0))
        for group in (slice(None, light), slice(light, None)):
            largest = size[group].max(initial=0.0)
            size[group] = np.maximum(size[group], FLOOR * largest + np.finfo(float).tiny)
        return size

    def sampled(self, panel: Panel, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return states (k, n) and rates of the columns after the light ones at times (k,) of a panel."""
        x = (t - panel.start) / panel.length * 2 - 1
        values = _summed(self._coefficients(panel), x[:, None])
        return values[:, : panel.states.shape[1]], values[:, panel.states.shape[1] :]

    def continued(self, panel: Panel, times: float, singular: float) -> tuple[Panel, float]:
        """Return the panel extended by the factor ``times`` over a singular position (s), and its error.

        The series are cut at their smallest terms at the new end. The error is the size of the first omitted
        terms, relative to the states' columns.
        """
        c, n = self._coefficients(panel), panel.states.shape[1]
        size = self._size(panel.states, 0 * panel.states, n - panel.rates.shape[1])
        growth = np.polynomial.chebyshev.chebvander(2 * times - 1, self.count - 1)
        terms = (np.abs(doubles(c[:, :n])) / size).max(axis=1) * growth.ravel()
        pairs = np.maximum(terms[:-1], terms[1:])
        cut = LAST + int(np.argmin(pairs[LAST:]))
        values = _summed(c[:cut], ((self.nodes + 1) * times - 1)[:, None])
        length = panel.length * times
        place = 2 * (singular - float(panel.start)) / float(length) - 1
        longer = Panel(panel.start, length, values[:, :n], values[:, n:], True, 1.0, place)
        return longer, float(pairs[cut])

    def _coefficients(self, panel: Panel) -> np.ndarray:
        """Return the Chebyshev coefficients (nodes, ·) of states and rates."""
        return self.times(self.series, np.concatenate([panel.states, panel.rates], axis=1))


def _summed(c: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return values (k, n) of Chebyshev series (m, n) at places x (k, 1), by Clenshaw's recurrence."""
    b, ahead = 0 * x + c[-1], 0 * x
    for row in c[-2:0:-1]:
        b, ahead = 2 * x * b - ahead + row, b
    return c[0] + x * b - ahead


def _antiderivatives(values: np.ndarray) -> np.ndarray:
    """Return integrals (nodes, nodes) of T_j from -1 to each node, from the values (nodes, nodes + 1) of
    T_j."""
    nodes = len(values)
    out = values[:, :nodes] * 0
    out[:, 0], out[:, 1] = values[:, 1] + 1, (values[:, 2] - 1) / 4
    for j in range(2, nodes):
        at = values[:, j + 1] / (2 * (j + 1)) - values[:, j - 1] / (2 * (j - 1))
        out[:, j] = at - at[0]
    return out


def _cosines(arithmetic: Arithmetic, n: int) -> np.ndarray:
    """Return cos(π k / n) (2 n,); π by Gauss's arithmetic-geometric mean (Brent, Journal of the ACM 23,
    1976)."""
    a, gap, power = arithmetic.array([1.0]), arithmetic.array([0.25]), 1
    b = np.sqrt(a / 2)
    while float(a[0] - b[0]) > arithmetic.eps**0.5:
        mean = (a + b) / 2
        a, b, gap, power = mean, np.sqrt(a * b), gap - power * (a - mean) * (a - mean), 2 * power
    mean = (a + b) / 2
    gap = gap - power * (a - mean) * (a - mean)
    return arithmetic.settled(np.cos(mean * mean / gap * arithmetic.array(np.arange(2 * n)) / n))
