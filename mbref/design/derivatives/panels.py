"""Panels of time with Gauss points, and collocation of a linear differential equation in them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

MOST_TOGETHER = 1_000_000  # entries of matrices that are solved together: 8 MB


class Precision(NamedTuple):
    """Number of Gauss points of a panel, and the step of differences, see ``Direction.steps``."""

    points: int
    step: float


class Gauss(NamedTuple):
    """Gauss points (N,) in (0, 1) and their weights (N,).

    ``analysis`` (N, N) gives Legendre coefficients of a function from its values at the points, ``integrals``
    (N, N) are of the Lagrange polynomials from 0 to each point.
    """

    points: np.ndarray
    weights: np.ndarray
    analysis: np.ndarray
    integrals: np.ndarray

    def integrals_to(self, share: float) -> np.ndarray:
        """Return the integrals (N,) of the Lagrange polynomials from 0 to a share of the panel."""
        return _integrals(np.array([share]), self.analysis)[0]


def gauss(count: int) -> Gauss:
    """Return the Gauss points of a panel."""
    x, w = legendre.leggauss(count)
    values = legendre.legvander(x, count - 1)
    analysis = (values * w[:, None]).T * (np.arange(count) + 0.5)[:, None]
    points = 0.5 * (x + 1.0)
    return Gauss(points, 0.5 * w, analysis, _integrals(points, analysis))


def _integrals(ends: np.ndarray, analysis: np.ndarray) -> np.ndarray:
    """Return the integrals (e, N) of the Lagrange polynomials from 0 to ends (e,)."""
    values = legendre.legvander(2.0 * ends - 1.0, len(analysis))  # ∫ P_k = (P_{k+1} - P_{k-1})/(2 k + 1)
    before = np.concatenate([-np.ones((len(ends), 1)), values[:, :-2]], axis=1)
    return 0.5 * (values[:, 1:] - before) / (2 * np.arange(len(analysis)) + 1) @ analysis


def rates_in_panels(lengths: np.ndarray, system: np.ndarray, rule: Gauss) -> Iterator[np.ndarray]:
    """Yield for each panel of ``lengths`` (panels,), s, the rates y' (N, d, d + c) at its Gauss points: of
    y' = A y from the d unit vectors, and of y' = A y + b from zero. ``system`` (panels, N, d, d + c) is A, b.
    """
    count, d = system.shape[1:3]
    size = count * d
    together = max(1, MOST_TOGETHER // max(1, size * size))
    for first in range(0, len(lengths), together):
        own, length = system[first : first + together], lengths[first : first + together]
        within = rule.integrals[:, None, :, None] * own[:, :, :, None, :d]
        within = length[:, None, None] * within.reshape(len(own), size, size)
        yield from np.linalg.solve(np.eye(size) - within, own.reshape(len(own), size, -1)).reshape(own.shape)


def tails(values: np.ndarray, rule: Gauss) -> np.ndarray:
    """Return the largest of the last two Legendre coefficients (panels,) of functions with values (panels, N,
    n)."""
    return np.abs(np.einsum("cp,jpn->jcn", rule.analysis[-2:], values)).max(axis=(1, 2), initial=0.0)
