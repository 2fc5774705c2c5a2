"""Derivatives of the eigenvalues of small motions about an equilibrium by numbers of the scene."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mbref.design.derivatives.at_rest import (
    MovedEquilibrium,
    equilibrium_request,
    moved_equilibrium,
)
from mbref.design.derivatives.numbers_of_scene import Variants, variants_of
from mbref.design.derivatives.sensitivities import DIFFERENCE_ROUNDING, SECOND_PRECISION
from mbref.design.derivatives.states import state_at_rest
from mbref.design.derivatives.tangents import TangentRows, tangents_at, with_accelerations
from mbref.equations.model import Model, displaced
from mbref.input_error import InputError
from mbref.scene import Scene

# distance of eigenvalues / largest one, up to which they are one repeated eigenvalue; rounding separates a
# double eigenvalue with one shape by about 1e-8
REPEATED = 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class EigenvalueSensitivities:
    """Derivatives ∂s/∂p of the e eigenvalues s of small motions about an equilibrium by p numbers.

    Attributes
    ----------
    eigenvalues : ndarray of complex, shape (e,)
        Two for each degree of freedom, 1/s, the smallest first.
    parameters : tuple of str
        Names of the numbers.
    units : tuple of str
        Units (p,) of the derivatives, such as ``"(1/s)/(kg)"``.
    values : ndarray of complex, shape (e, p)
        Derivatives, in 1/s over the SI unit of the number. A repeated eigenvalue splits if the number grows:
        its entries are the slopes of the parts, in no order of shapes, which do not add up over numbers. NaN
        where a repeated eigenvalue has fewer shapes than entries, as at critical damping: it is UNDECIDED,
        because no derivative exists.
    errors : ndarray, shape (e, p)
        Estimated absolute errors of the derivatives.
    repeated : tuple of tuple of int
        Indices of eigenvalues that are equal.
    """

    eigenvalues: np.ndarray
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    values: np.ndarray
    errors: np.ndarray
    repeated: tuple[tuple[int, ...], ...]

    def __repr__(self) -> str:
        return f"<EigenvalueSensitivities of {len(self.eigenvalues)} to {len(self.parameters)} numbers>"


def eigenvalue_sensitivities(scene: Scene | str | Path, to: Sequence[str]) -> EigenvalueSensitivities:
    """Return derivatives of the eigenvalues of small motions about an equilibrium.

    With u the independent displacements, small motions obey u'' = K u + C u', so that s are the eigenvalues
    of A = [0, 1; K, C], and s' = wᴴ A' v / wᴴ v with right and left vectors v and w. A' contains the motion
    of the equilibrium with the number.

    Parameters
    ----------
    scene : Scene, str or path
        A scene whose pose is an equilibrium, such as ``mbref.equilibria(scene)[0].scene``.
    to : sequence of str
        Paths of numbers of the scene, as of ``sensitivities``.

    Returns
    -------
    EigenvalueSensitivities
        Eigenvalues, and their derivatives with estimated errors.

    Raises
    ------
    SceneError
        If the scene has no number at a path.
    InputError
        If the scene has no degree of freedom, and for the reasons of ``equilibrium_sensitivities``.
    """
    request, step = equilibrium_request(scene, None, to), SECOND_PRECISION.step
    moved = moved_equilibrium(request, step)
    if not len(moved.partition.independent):
        raise InputError(f"{request.scene.name}: has no degree of freedom, so it has no small motions")
    matrix = _matrix(request.model, moved.state.q[0], moved)
    rate = max(np.sqrt(np.abs(matrix[0]).max()), np.abs(matrix[1]).max())
    whole = _of_first_order(matrix, rate)
    values = np.linalg.eigvals(whole)
    values = values[np.lexsort((-values.imag, values.real, (np.abs(values) / rate).round(12)))]
    groups = [*_groups(values)]
    found = np.full((len(values), len(request.labels)), np.nan, dtype=complex)
    errors = np.full(found.shape, np.nan)
    for k, label in enumerate(request.labels):
        variants = next(variants_of(request.scene, label, request.model))
        change, uncertain = _slope(variants, moved, k, rate)
        for group in groups:
            found[group, k], errors[group, k] = _slopes(whole, values[group], change, uncertain)
    request.model.release()
    repeated = tuple(tuple(group) for group in groups if len(group) > 1)
    units = tuple(f"(1/s)/({unit or 'SI'})" for unit in request.units)
    return EigenvalueSensitivities(values, request.labels, units, found, errors, repeated)


def _matrix(model: Model, q: np.ndarray, moved: MovedEquilibrium) -> np.ndarray:
    """Return K and C (2, f, f) of a model at rest at q (7 nb,), which may be off its equilibrium."""
    state, at = state_at_rest(model, q), moved.partition.independent
    rows = TangentRows(model, state, moved.partition)
    found = tangents_at(model, with_accelerations(state, rows), rows, [])
    by_place_and_rate = found.a[0][at] / model.units[at, None]
    return np.array(np.split(by_place_and_rate, 2, axis=1))


def _of_first_order(matrix: np.ndarray, rate: float) -> np.ndarray:
    """Return A (2 f, 2 f) for (u, u' / rate), so that its entries have one size."""
    f = matrix.shape[1]
    return np.block([[np.zeros((f, f)), rate * np.eye(f)], [matrix[0] / rate, matrix[1]]])


def _slope(
    variants: Variants, moved: MovedEquilibrium, number: int, rate: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the derivative A' (2 f, 2 f) by a number along the moving equilibrium, and its errors."""
    stencil, step, parts = variants.stencil, variants.step, []
    for place, offset in enumerate(stencil.offsets):
        model = variants.model(place)
        q = displaced(moved.state.q[0], offset * step * moved.x[:, number])
        parts.append(_of_first_order(_matrix(model, q, moved), rate))
        model.release()
    all_, unit = np.array(parts), np.ones_like(parts[0])
    unit[: len(unit) // 2] = 0.0  # the upper half is constant
    change, lower = (np.tensordot(w, all_, 1) * unit / step for w in (stencil.weights, stencil.lower))
    rounded = DIFFERENCE_ROUNDING * np.abs(all_ * unit).max() * np.abs(stencil.weights).max() / step
    return change, np.abs(change - lower) + rounded * unit


def _groups(values: np.ndarray) -> Iterator[list[int]]:
    """Yield lists of indices of equal eigenvalues."""
    left, limit = list(range(len(values))), REPEATED * np.abs(values).max()
    while left:
        group = [k for k in left if abs(values[k] - values[left[0]]) <= limit]
        left = [k for k in left if k not in group]
        yield group


def _slopes(
    matrix: np.ndarray, values: np.ndarray, change: np.ndarray, uncertain: np.ndarray
) -> tuple[np.ndarray, float]:
    """Return the derivatives (k,) of a k-fold eigenvalue and their error; NaN without k shapes."""
    left, sizes, right = np.linalg.svd(matrix - values.mean() * np.eye(len(matrix)))
    k = len(values)
    if sizes[-k] > REPEATED * sizes[0]:
        return np.full(k, np.nan), np.nan
    w, v = left[:, -k:], right[-k:].conj().T
    if np.linalg.svd(w.conj().T @ v, compute_uv=False)[-1] <= REPEATED:
        return np.full(k, np.nan), np.nan
    inverse = np.linalg.inv(w.conj().T @ v)
    slopes = np.linalg.eigvals(inverse @ w.conj().T @ change @ v)
    bound = np.abs(inverse) @ np.abs(w).T @ uncertain @ np.abs(v)
    return slopes[np.lexsort((slopes.imag, slopes.real))], float(np.linalg.norm(bound, 2))
