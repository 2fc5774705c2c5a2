"""Panels of stiff motions: the collocation equations solved by Newton's method instead of Picard's iteration.

Picard's iteration needs panels of a few times the shortest decay time, however smooth the motion is. Newton's
method needs the derivatives of the rates. These derivatives are computed in double precision, while residuals
use the arithmetic itself, so that each correction gains digits. The rates at the start of a panel are no
unknowns: they follow from the polynomial through the other rates, so that fast decays are damped for any
panel length (E. Hairer and G. Wanner, Solving Ordinary Differential Equations II, 1996, section IV.3: the
stability function vanishes at infinity).
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from crosscheck.judge.arithmetic import doubles
from crosscheck.judge.deadline import ask
from crosscheck.judge.reference.crossing import singular_time
from crosscheck.judge.reference.panels import (
    LAST,
    LONGEST,
    SHORTER,
    SHORTEST,
    SPARE,
    TELLING,
    Equations,
    Panel,
    Panels,
)

MOST = 2500  # largest number of unknowns of a panel
STIFF = 4.0  # panel length / fastest decay time above which a panel is stiff
SWEEPS = 25  # corrections before a panel is shortened
AGAIN = 1e-4  # change below which derivatives are not computed again
GROWS = 2.0  # ratio of successive changes above which the iteration diverges
RESOLVED = 0.1  # fraction of the tolerance: largest last coefficients of a resolved series
STEP = 1e-5  # increment of difference quotients / largest entry of the column


class SlopedEquations(Equations, Protocol):
    """Interface of equations that can return a version of themselves in double precision."""

    def in_doubles(self) -> Equations:
        """Return these equations in double precision."""


class StiffPanels:
    """Newton's method on the Chebyshev points of panels."""

    def __init__(self, panels: Panels):
        self.panels = panels
        signs = np.where(np.arange(panels.count) % 2, 2, -2)
        signs[-1] //= 2  # the last Chebyshev coefficient of the rates is zero
        self.integral = panels.integral[1:, 1:] + panels.integral[1:, :1] * signs[1:]

    def is_for(self, equations: SlopedEquations, t: Any, length: float, state: np.ndarray) -> bool:
        """Return whether a state (n,) has decays much shorter than a panel, and the panel is small enough."""
        if len(state) * self.panels.count > MOST:
            return False
        at = doubles(self.panels.arithmetic.zeros(1) + t)
        (slopes,) = _slopes(equations.in_doubles(), at, doubles(state)[None])
        return bool(np.isfinite(slopes).all() and -np.linalg.eigvals(slopes).real.min() * length > STIFF)

    def panel(self, equations: SlopedEquations, start: Any, length: Any, guess: np.ndarray) -> Panel:
        """Return the solution that starts at the first state of a guess (nodes, n)."""
        settled, light, last = self.panels.arithmetic.settled, equations.light, np.inf
        t, half, y = start + length / 2 * (self.panels.nodes + 1), length / 2, guess
        for sweep in range(SWEEPS):
            ask()
            rates, distance = equations.other_rates(t, y)
            if last > AGAIN:
                factors = self._factorised(equations.in_doubles(), doubles(t), doubles(y), float(half))
            moved = half * self.panels.times(
                self.integral, np.concatenate([equations.light_rates(y), rates], axis=1)[1:]
            )
            step = self._solved(factors, doubles(y[0] + moved - y[1:]))
            size = self._size(y, light)
            change = float((np.abs(step) / size).max())
            if not np.isfinite(change) or (sweep > 1 and change > GROWS * last):
                break
            y, last = y.copy(), change
            y[1:] = settled(y[1:] + step)
            if change <= self.panels.tolerance:
                return self._judged(Panel(start, length, y, rates, True, 1.0), size, distance)
        return Panel(start, length, guess, rates, False, SHORTER)

    def _judged(self, panel: Panel, size: np.ndarray, distance: np.ndarray) -> Panel:
        """Return a converged panel, or a failed panel if its points do not resolve the motion or it crosses a
        singular position."""
        fits = self._fits(panel.states, size)
        crossing = singular_time(doubles(self.panels.nodes), distance)
        if fits < 1 or crossing is not None:
            factor = min(max(SPARE * fits, SHORTEST), SHORTER)
            return Panel(
                panel.start, panel.length, panel.states, panel.rates, False, factor, foreseen=crossing
            )
        return Panel(panel.start, panel.length, panel.states, panel.rates, True, min(SPARE * fits, LONGEST))

    def _fits(self, y: np.ndarray, size: np.ndarray) -> float:
        """Return the factor by which a panel with an equal number of points could be longer."""
        level = RESOLVED * self.panels.tolerance
        series = (np.abs(doubles(self.panels.times(self.panels.series, y))) / size).max(axis=1)
        needed = np.flatnonzero(series > level).max(initial=0) + 1
        room = self.panels.count - LAST
        if needed <= room:
            return float(room / needed)
        return float(np.log(min(series[-LAST:].max(), TELLING)) / np.log(level))

    def _size(self, y: np.ndarray, light: int) -> np.ndarray:
        return self.panels._size(y, 0 * y, light)

    def _factorised(self, equations: Equations, t: np.ndarray, y: np.ndarray, half: float) -> Any:
        """Return factors of 1 - half · integral ⊗ derivatives."""
        slopes = _slopes(equations, t, y)[1:]
        nodes, n = len(slopes), slopes.shape[-1]
        matrix = -half * np.einsum("ij,jab->iajb", doubles(self.integral), slopes).reshape(
            nodes * n, nodes * n
        )
        return lu_factor(matrix + np.eye(nodes * n), check_finite=False)

    def _solved(self, factors: Any, residual: np.ndarray) -> np.ndarray:
        return lu_solve(factors, residual.ravel(), check_finite=False).reshape(residual.shape)


def _slopes(equations: Equations, t: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return derivatives (K, n, n) of the rates by the states (K, n), by central differences."""
    n, steps = y.shape[1], STEP * np.maximum(np.abs(y).max(axis=0), 1.0)
    moved = (steps * np.eye(n))[:, None]
    ends = [_rates(equations, t, y + side * moved) for side in (1, -1)]
    return np.moveaxis((ends[0] - ends[1]) / (2 * steps[:, None, None]), 0, 2)


def _rates(equations: Equations, t: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return rates (…, K, n) of states (…, K, n)."""
    ask()
    many, flat = np.tile(t, len(y)), y.reshape(-1, y.shape[-1])
    other, _ = equations.other_rates(many, flat)
    return np.concatenate([equations.light_rates(flat), other], axis=1).reshape(y.shape)
