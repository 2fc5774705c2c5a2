"""Ordinary differential equations to rounding error: Chebyshev–Picard iteration in extended precision.

On a panel of time the derivative is sampled at all Chebyshev points at once, interpolated, integrated
exactly, and the iteration is repeated until it converges; a panel whose Chebyshev series does not decrease to
rounding is shortened.  No tolerance limits the steps: the solution is as exact as the arithmetic allows.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Callable
from threading import Lock

import numpy as np

from crosscheck.judge.deadline import TimeIsUp, ask, within

NODES = 64  # nodes of a panel (polynomials of degree 63)
SWEEPS = 60  # Picard iterations before a panel is shortened
EASY = 20  # iterations: after fewer of them the next panel is longer
ROOT_STEPS = 20  # Newton iterations for the time at which a component has a given value
UP, DOWN = np.longdouble(1.2), np.longdouble(0.7)  # factors on the length of the next panel
REAL = np.longdouble  # 64-bit mantissa on x86; double elsewhere, with the accuracy of double
SETTLED = 64 * float(np.finfo(REAL).eps)  # relative limit of the last change and of the last coefficients
SECONDS = 20.0  # CPU seconds for all panels of a solution, which is known up to the last panel
SMALLEST = 1e-12  # panel length / time reached below which the solution counts as singular

Derivative = Callable[[np.ndarray], np.ndarray]


class NoSolution(ArithmeticError):
    """The solution ends before the requested time: its derivative becomes singular, or the CPU time has
    passed.

    The solution is known up to ``until`` (s).
    """

    def __init__(self, reason: str, until: float = 0.0):
        super().__init__(reason)
        self.reason, self.until = reason, until

    @classmethod
    def ending(cls, reason: str, end: float) -> NoSolution:
        """Return the error for a reason, a clause, at a value of the independent variable."""
        found = cls(f"{reason} at t = {end:.9g}", float(np.nextafter(end, 0.0)))
        found.reason = reason
        return found


class Solution:
    """Solution of y' = f(y), y(0) = y0, for any t ≥ 0; f maps states (n, m) to derivatives (n, m).

    Panels are computed at first access, within SECONDS of CPU time, and cached; several threads may call at
    once.
    """

    def __init__(self, derivative: Derivative, start: np.ndarray, first_panel: float):
        self._derivative = derivative
        self._edges = [REAL(0)]
        self._values: list[np.ndarray] = []  # (NODES, m) for each panel
        self._state = np.asarray(start, dtype=REAL)
        self._next = REAL(first_panel)
        self._asked, self._spent = Lock(), 0.0

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """Return states (k, m) at times (k,) ≥ 0; raises NoSolution if the solution ends before the last
        time."""
        times = np.asarray(times, dtype=REAL)
        edges, values = self._panels(lambda: self._edges[-1] < times.max(initial=0))
        panel = np.clip(np.searchsorted(edges, times, side="right") - 1, 0, len(values) - 1)
        x = 2 * (times - edges[panel]) / (edges[panel + 1] - edges[panel]) - 1
        return np.einsum("kn,knm->km", _cardinal(x), values[panel])

    def reach(self, is_enough: Callable[[np.ndarray], bool]) -> np.ndarray:
        """Return the state (m,) at the start or the end of the first panel at which ``is_enough`` is true."""
        self._extend(lambda: not is_enough(self._state))
        return self._state

    def where(self, component: int, wanted: np.ndarray) -> np.ndarray:
        """Return states (k, m) at which a component that grows from 0 has the wanted values (k,)."""
        wanted = np.asarray(wanted, dtype=REAL)
        edges, values = self._panels(lambda: self._state[component] < wanted.max(initial=0))
        nodes = edges[:-1, None] + (_nodes() + 1) / 2 * np.diff(edges)[:, None]
        reached = values[..., component]
        at = np.interp(wanted.astype(float), reached.ravel().astype(float), nodes.ravel().astype(float))
        at = at.astype(REAL)
        for _ in range(ROOT_STEPS):
            state = self(np.clip(at, 0, edges[-1]))
            step = (wanted - state[:, component]) / self._derivative(state)[:, component]
            at = at + step
            if np.abs(step).max(initial=0) <= SETTLED * np.abs(at).max(initial=0):
                break
        return self(np.clip(at, 0, edges[-1]))

    def _panels(self, is_short: Callable[[], bool]) -> tuple[np.ndarray, np.ndarray]:
        """Return edges (p + 1,) and values (p, NODES, m) of at least one panel; panels are added while
        ``is_short`` is true."""
        self._extend(lambda: not self._values or is_short())
        return np.array(self._edges), np.stack(self._values)

    def _extend(self, is_short: Callable[[], bool]) -> None:
        """Add panels while ``is_short`` is true."""
        with self._asked:
            began = time.thread_time()
            try:
                with within(SECONDS - self._spent):
                    while is_short():
                        self._add_panel()
            except TimeIsUp as end:
                raise NoSolution.ending(str(end), float(self._edges[-1])) from None
            finally:
                self._spent += time.thread_time() - began

    def _add_panel(self) -> None:
        while True:
            values, sweeps = self._sweep(self._next)
            if values is not None:
                break
            self._next = self._next * DOWN
            if self._next < SMALLEST * max(float(self._edges[-1]), 1e-3):
                raise NoSolution.ending("the solution ends", float(self._edges[-1]))
        self._values.append(values)
        self._edges.append(self._edges[-1] + self._next)
        self._state = values[-1]
        if sweeps < EASY:
            self._next = self._next * UP

    def _sweep(self, length: np.floating) -> tuple[np.ndarray | None, int]:
        integrate, series = _matrices()
        y = np.tile(self._state, (NODES, 1))
        for sweep in range(SWEEPS):
            ask()
            with np.errstate(all="ignore"):
                slope = self._derivative(y)
                better = self._state + length / 2 * (integrate @ slope)
            if not np.isfinite(better).all():
                return None, sweep
            scale = np.maximum(np.abs(better).max(axis=0), np.abs(length * slope).max(axis=0))
            change, y = np.abs(better - y).max(axis=0), better
            if (change <= SETTLED * scale).all():
                tail = np.abs(series[-3:] @ slope).max(axis=0) * length
                return (y, sweep) if (tail <= SETTLED * scale).all() else (None, sweep)
        return None, SWEEPS


@functools.cache
def _nodes() -> np.ndarray:
    """Return the Chebyshev points from -1 to 1."""
    pi = 4 * np.arctan(REAL(1))
    return -np.cos(pi * np.arange(NODES).astype(REAL) / (NODES - 1))


@functools.cache
def _matrices() -> tuple[np.ndarray, np.ndarray]:
    """Return (integrals from -1 to each node, Chebyshev coefficients) as matrices for values at the nodes."""
    n = NODES - 1
    pi = 4 * np.arctan(REAL(1))
    angles = pi * ((np.arange(NODES)[:, None] * (n - np.arange(NODES))) % (2 * n)).astype(REAL) / n
    series = np.cos(angles) * 2 / n
    series[:, [0, n]] /= 2
    series[[0, n]] /= 2
    k = np.arange(NODES + 1)
    phase = (k[None] * (n - np.arange(NODES))[:, None]) % (2 * n)
    t = np.cos(pi * phase.astype(REAL) / n)  # T_k at the nodes, one degree more
    primitive = np.zeros((NODES, NODES), dtype=REAL)  # integral of T_k from -1
    primitive[:, 0] = t[:, 1] + 1
    primitive[:, 1] = (t[:, 2] - 1) / 4
    for j in range(2, NODES):
        at = t[:, j + 1] / (2 * (j + 1)) - t[:, j - 1] / (2 * (j - 1))
        primitive[:, j] = at - at[0]
    return primitive @ series, series


def _cardinal(x: np.ndarray) -> np.ndarray:
    """Return barycentric interpolation weights (k, NODES) at points x (k,) in [-1, 1]."""
    sign = np.where(np.arange(NODES) % 2, REAL(-1), REAL(1))
    sign[[0, -1]] /= 2
    distance = x[:, None] - _nodes()
    hit = distance == 0
    weights = sign / np.where(hit, REAL(1), distance)
    weights = np.where(hit.any(axis=1, keepdims=True), hit.astype(REAL), weights)
    return weights / weights.sum(axis=1, keepdims=True)
