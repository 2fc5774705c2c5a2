"""Eigenvalues of small motions y'' = A y + B y', each with a bound of its error.

A matrix with an error of at most F in each entry has an eigenvalue within |w|ᵀ (F |v| + |r|) / |wᴴ v| of an
eigenvalue s with right and left vectors v, w and residual r, to first order (Golub and Van Loan, Matrix
Computations, section 7.2).  Where two eigenvalues meet, wᴴ v vanishes, and the bound is the square root.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mbref.design.linearisation import DIFFERENCE_STEP, EPSILON, Tangent

# factor on the change of difference quotients with their step, and on rounding of accelerations
CHANGES, ROUNDINGS = 4.0, 32.0
OTHER_STEP = 0.7  # factor on the step of the second difference quotients
# change of difference quotients with the step / its bound by rounding, above which the step is too long for a
# part, such as a short spring; factor on the step then, and the smallest step / the first one
LONG_STEP, SHORTENED, SHORTEST_STEP = 1e3, 0.1, 1e-5


class Eigenvalues(NamedTuple):
    """Eigenvalues (2f,) 1/s, the largest error of each, and their displacements y (f, 2f)."""

    values: np.ndarray
    bounds: np.ndarray
    shapes: np.ndarray


class Linear(NamedTuple):
    """A and B (f, f) of y'' = A y + B y', and the largest errors of their entries."""

    by_place: np.ndarray
    by_rate: np.ndarray
    place_errors: np.ndarray
    rate_errors: np.ndarray


def linear_at(tangent: Tangent, away: np.ndarray) -> Linear:
    """Return the equations of small motions about a pose that may be ``away`` (f,) from the equilibrium."""
    place, place_errors = _by_place(tangent)
    if (exact := tangent.exact_slope()) is not None:
        place_errors = place_errors + np.abs(place - exact)
    scale = tangent.rate_scale(place)
    rate, other_rate = tangent.by_rate(scale), tangent.by_rate(OTHER_STEP * scale)
    if away.any():
        here = tangent.slope() if exact is None else exact
        around = tangent.slope(away), tangent.slope(-away)
        place_errors = place_errors + np.max([np.abs(slope - here) for slope in around], axis=0)
    rounded = tangent.pushes[:, None] * _inverse_steps(tangent)
    rate_errors = CHANGES * np.abs(rate - other_rate) + rounded / scale
    return Linear(place, rate, place_errors, rate_errors + ROUNDINGS * EPSILON * np.abs(rate))


def _by_place(tangent: Tangent) -> tuple[np.ndarray, np.ndarray]:
    """Return A and the largest errors of its entries (f, f).

    The step of the differences is shortened until A no longer changes with it, except by rounding, of the
    entry or of the entry with the largest forces. If A changes with the shortest step, too, the errors are
    the largest difference of all steps.
    """
    share, found = 1.0, list[np.ndarray]()
    while share >= SHORTEST_STEP:
        place, other = tangent.by_place(share), tangent.by_place(share * OTHER_STEP)
        inverse_steps = _inverse_steps(tangent) / share
        rounded = tangent.pushes[:, None] * inverse_steps + np.abs(place) * inverse_steps / tangent.sizes
        changes, found = CHANGES * np.abs(place - other), [*found, place]
        # a freedom without a force is rounded by forces that joints pass on to its body
        if not (changes > np.maximum(LONG_STEP * rounded, rounded.max(initial=0.0))).any():
            return place, changes + rounded
        share *= SHORTENED
    return place, np.max([np.abs(each - place) for each in found], axis=0) + changes + rounded


def _inverse_steps(tangent: Tangent) -> np.ndarray:
    """Return the rounding of accelerations over the steps (f,) of the differences; nearly dependent rows
    magnify rounding by the inverse of their conditioning."""
    return ROUNDINGS * EPSILON / tangent.conditioning * tangent.sizes / DIFFERENCE_STEP


def eigenvalues_of(linear: Linear) -> Eigenvalues:
    """Return the eigenvalues with their bounds, the smallest first; parts within the bound are zero."""
    undamped = not (np.abs(linear.by_rate) > linear.rate_errors).any()
    values, bounds, shapes = _undamped_eigenvalues(linear) if undamped else _damped_eigenvalues(linear)
    real = np.where(np.abs(values.real) <= bounds, 0.0, values.real)
    imaginary = np.where(np.abs(values.imag) <= bounds, 0.0, values.imag)
    values = real + 1j * imaginary
    size = np.abs(values).max(initial=0.0) or 1.0
    order = np.lexsort((-values.imag, values.real, (np.abs(values) / size).round(12)))
    return Eigenvalues(values[order], bounds[order], shapes[:, order])


def _undamped_eigenvalues(linear: Linear) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return eigenvalues ± √μ of eigenvalues μ of A, without damping."""
    squares, errors, vectors = _bounded_eigenvalues(linear.by_place, linear.place_errors)
    roots = np.sqrt(squares.astype(complex))
    size = np.abs(squares)
    bounds = np.where(size <= errors, np.sqrt(size + errors), errors / np.sqrt(np.maximum(size, 1e-300)))
    return np.concatenate([roots, -roots]), np.tile(bounds, 2), np.tile(vectors, 2)


def _damped_eigenvalues(linear: Linear) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return eigenvalues of the equations of first order for (y, y' / w), with a rate w of their size."""
    f = len(linear.by_place)
    w = max(np.sqrt(np.abs(linear.by_place).max()), np.abs(linear.by_rate).max())
    zero = np.zeros((f, f))
    matrix = np.block([[zero, w * np.eye(f)], [linear.by_place / w, linear.by_rate]])
    errors = np.block([[zero, zero], [linear.place_errors / w, linear.rate_errors]])
    values, bounds, vectors = _bounded_eigenvalues(matrix, errors)
    return values, bounds, vectors[:f]


def _bounded_eigenvalues(matrix: np.ndarray, errors: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return eigenvalues of a matrix (k, k), their bounds for the errors of its entries, and vectors."""
    from scipy.linalg import eig

    values, left, right = eig(matrix, left=True, right=True)
    products = (left.conj() * right).sum(axis=0)
    is_double = products == 0.0
    apart = np.where(is_double, 1.0, products)
    refined = (left.conj() * (matrix @ right)).sum(axis=0) / apart
    values = np.where(is_double, values, refined)
    residuals = np.abs(matrix @ right - values * right)
    rounding = EPSILON * len(matrix) * np.abs(matrix)
    change = (np.abs(left) * ((errors + rounding) @ np.abs(right) + residuals)).sum(axis=0)
    size = np.abs(matrix).max(initial=0.0)
    bounds = change / np.maximum(np.abs(products), np.sqrt(np.minimum(change / (size or 1.0), 1.0)))
    bounds = np.where(change > 0.0, bounds, 0.0)
    return values, bounds, right
