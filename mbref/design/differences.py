"""Differences of order 8 of smooth functions, central or to one side."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

CENTRAL = (4 / 5, -1 / 5, 4 / 105, -1 / 280)  # weights of central differences of order 8
DIFFERENCE_ORDER = 8


class Stencil(NamedTuple):
    """Offsets (k,) in steps, and the weights (k,) of a first derivative; ``lower`` are weights of an order
    lower by two, whose difference from ``weights`` estimates the truncation."""

    offsets: np.ndarray
    weights: np.ndarray
    lower: np.ndarray


def directional_derivative(function: Callable[[np.ndarray], np.ndarray], h: np.ndarray) -> np.ndarray:
    """Return the change of a function along a vector h, to first order."""
    return np.asarray(sum(w * (function(k * h) - function(-k * h)) for k, w in enumerate(CENTRAL, 1)))


def affine() -> Stencil:
    """Return the stencil with offsets -1, 1/2 and 1, exact for functions whose two estimates agree. Those
    of a cubic function differ at its inflection, too."""
    return Stencil(np.array([-1.0, 0.5, 1.0]), np.array([-0.5, 0.0, 0.5]), np.array([-2.0, 2.0, 0.0]) / 3.0)


def central() -> Stencil:
    """Return the stencil with offsets -4 to 4, without 0."""
    offsets = np.array([-4.0, -3.0, -2.0, -1.0, 1.0, 2.0, 3.0, 4.0])
    return Stencil(offsets, _weights(offsets), np.pad(_weights(offsets[1:-1]), 1))


def one_sided(sign: float) -> Stencil:
    """Return the stencil with offsets 0 to 8 times a sign."""
    offsets = sign * np.arange(DIFFERENCE_ORDER + 1.0)
    return Stencil(offsets, _weights(offsets), np.pad(_weights(offsets[:-2]), (0, 2)))


def _weights(offsets: np.ndarray) -> np.ndarray:
    """Return the weights of a first derivative at 0 that are exact for polynomials of degree < k."""
    powers = np.vander(offsets, increasing=True).T
    return np.linalg.solve(powers, np.eye(len(offsets))[1])
