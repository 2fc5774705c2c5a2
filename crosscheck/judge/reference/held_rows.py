"""Selection of independent constraint rows of a scene in natural coordinates, and the Taylor series of their
drivers.

Redundant rows are left out by a QR factorisation of Gᵀ with column pivoting.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from scipy.linalg import qr

from crosscheck.judge.arithmetic import Arithmetic, doubles
from crosscheck.judge.reference.natural import NaturalCoordinates
from crosscheck.judge.reference.natural_joints import convolved
from crosscheck.judge.reference.saddle_point import Sparse
from crosscheck.judge.time_functions import piece_of
from crosscheck.judge.tolerances import RANK
from mbref.scene import TimeFunction


class HeldRows:
    """Selected rows of a scene: m rows of joints (``numbers``) and ``couplings``, ``count`` in all.

    The rows of joints consist of p products; ``gears`` are the rows of couplings and of all armatures.
    """

    def __init__(self, of: NaturalCoordinates, rows: Iterable[int]):
        chosen = tuple(map(int, rows))
        self.count, self._joints = len(chosen), of.joints
        self.numbers = tuple(k for k in chosen if k < len(of.c))
        self.couplings = [of.joints.couplings[k - len(of.c)] for k in chosen if k >= len(of.c)]
        self.gears = [*self.couplings, *of.joints.armatures]
        self._arithmetic, self._length = of.arithmetic, of.length
        driven = [(self.numbers.index(k), k, row) for k, row in of.driven if k in self.numbers]
        second = [of.second[k] for _, k, _ in driven if k in of.second]
        self._c = of.c[list(self.numbers)]
        self._moved = [(at, row.driver) for at, k, row in driven if row.driver and k not in of.second]
        turned = [(at, row.driver) for at, k, row in driven if row.driver and k in of.second]
        self._turned = [(at, len(self.numbers) + i, driver) for i, (at, driver) in enumerate(turned)]
        self.products = [*self.numbers, *second]
        u, w = of.u[self.products], of.w[self.products]
        self.u, self.w, self.to_u, self.to_w = Sparse(u), Sparse(w), Sparse(u.T), Sparse(w.T)
        self._dense = u, w

    def drives(self, t: Any, terms: int) -> Drives:
        """Return the rows' dependence on time about t, as series with the given number of terms."""
        value = self._arithmetic.zeros(terms, len(self.numbers))
        value[0] = self._c
        for at, driver in self._moved:
            value[:, at] = value[:, at] + function_series(driver, t, terms, self._arithmetic) / self._length
        angles = [(at, to, function_series(d, t, terms, self._arithmetic)) for at, to, d in self._turned]
        return Drives(value, [(at, to, *cos_sin_series(angle)) for at, to, angle in angles])

    def gradient(self, x: np.ndarray, drives: Drives) -> np.ndarray:
        """Return G (m, 3, n): derivatives of the rows by the coordinates x (3, n)."""
        u, w = self._dense
        products = self.w(x).T[:, :, None] * u[:, None, :] + self.u(x).T[:, :, None] * w[:, None, :]
        return drives.combined(products[None], 0)

    def all_gradients(self, x: np.ndarray, drives: Drives, turned: Sequence[Any]) -> np.ndarray:
        """Return G (m + g, 3, n - 4) of the rows and of the gears, whose coordinates are nearest to
        ``turned``."""
        own = self.gradient(x, drives)[:, :, :-4]
        return np.concatenate([own, self._joints.gradients(self.gears, x, turned)]) if self.gears else own

    def compliance(self, zeros: Any) -> np.ndarray:
        """Return reciprocal inertias (m + g,) of armatures, zeros for all other rows."""
        found = zeros(len(self.numbers) + len(self.gears))
        for k, gear in enumerate(self.gears, len(self.numbers)):
            if gear.inertia is not None:
                found[k] = 1 / gear.inertia
        return np.asarray(found)

    def unit_gradient(self, x: np.ndarray, t: Any, turned: Sequence[Any]) -> np.ndarray:
        """Return G (count, 3 (n - 4)) in double precision with rows of unit length, without the ground's
        columns; coordinates of couplings are nearest to ``turned``."""
        rows = doubles(self.gradient(x, self.drives(t, 1)))[:, :, :-4].reshape(len(self.numbers), -1)
        if self.couplings:
            coupled = doubles(self._joints.gradients(self.couplings, x, turned))
            rows = np.concatenate([rows, coupled.reshape(len(coupled), -1)])
        return rows / np.linalg.norm(rows, axis=1, keepdims=True)


class Drives:
    """Series of the rows about one time: right-hand sides c (terms, m); a driven angle ψ gives the row cos ψ
    y_row + sin ψ y_second of products y."""

    def __init__(self, c: np.ndarray, turns: list[tuple[int, int, np.ndarray, np.ndarray]]):
        self.c, self._turns = c, turns

    def combined(self, products: np.ndarray, k: int) -> np.ndarray:
        """Return order k of the rows (m, …) from series of the products (terms, p, …)."""
        rows = products[k][: self.c.shape[1]].copy()
        each = (-1,) + (1,) * (products.ndim - 2)
        for at, second, cosine, sine in self._turns:
            first = convolved(cosine.reshape(each), products[:, at], k)
            rows[at] = first + convolved(sine.reshape(each), products[:, second], k)
        return rows

    def spread(self, multipliers: np.ndarray, k: int) -> np.ndarray:
        """Return order k of the products' factors (p,) from series of the rows' multipliers (terms, m)."""
        factors = np.concatenate([multipliers[k], 0 * multipliers[k][: len(self._turns)]])
        for at, second, cosine, sine in self._turns:
            factors[at] = convolved(cosine, multipliers[:, at], k)
            factors[second] = convolved(sine, multipliers[:, at], k)
        return factors


def independent(rows: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return numbers of independent rows among unit rows (m, n), in increasing order, and the pivots (min(m,
    n),) relative to the first pivot.

    Weights (m,) near one decide between rows with equal pivots.
    """
    if not len(rows):
        return np.zeros(0, dtype=int), np.zeros(0)
    r, order = qr((rows * weights[:, None]).T, mode="r", pivoting=True, check_finite=False)
    pivots = np.abs(np.diag(r)) / np.abs(r[0, 0])
    return np.sort(order[: int((pivots > RANK).sum())]), pivots


def function_series(function: TimeFunction, t: Any, terms: int, arithmetic: Arithmetic) -> np.ndarray:
    """Return Taylor coefficients (terms,) about t of the piece of a function that acts from t on."""
    piece, series = piece_of(function, float(t), arithmetic), arithmetic.zeros(terms)
    for coefficients, d in ((piece.cubic, t - piece.knot), (arithmetic.array(function.coefficients), t)):
        c = list(coefficients) if piece.acts else []
        for i in range(len(c)):  # repeated Horner's scheme: coefficients of the polynomial in s at d + s
            for j in range(len(c) - 2, i - 1, -1):
                c[j] = c[j] + d * c[j + 1]
        series[: len(c)] = series[: len(c)] + c[:terms]
    if function.sine and piece.acts:
        sine = function.sine
        amplitude, frequency, phase = arithmetic.array([sine.amplitude, sine.frequency, sine.phase])
        angle = frequency * t + phase
        sine, cosine = amplitude * np.sin(angle), amplitude * np.cos(angle)
        for k in range(terms):
            series[k] = series[k] + (sine, cosine, -sine, -cosine)[k % 4] * frequency**k / math.factorial(k)
    return arithmetic.settled(series)


def cos_sin_series(angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return Taylor coefficients of the cosine and the sine of a series (terms,)."""
    cosine, sine = 0 * angle, 0 * angle
    cosine[0], sine[0] = np.cos(angle[0]), np.sin(angle[0])
    rate = angle[1:] * np.arange(1, len(angle))
    for k in range(1, len(angle)):
        cosine[k] = -(rate[:k] * sine[k - 1 :: -1]).sum() / k
        sine[k] = (rate[:k] * cosine[k - 1 :: -1]).sum() / k
    return cosine, sine
