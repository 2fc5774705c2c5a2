"""Tangents of the equations of motion: derivatives of a state by coordinates of the freedoms, and by numbers.

Displacements and their rates are in units S of the mechanism (its length, and 1 rad). At k states, f of the
n displacements determine the others; y = (u, w) are these f displacements and changes of velocities.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.linalg

from mbref.design.allowed_motions import TANGENT_RANK
from mbref.design.derivatives.numbers_of_scene import SceneNumber
from mbref.design.derivatives.states import Direction, States, change_along, residuals, terms_along
from mbref.equations.model import Model
from mbref.equations.units import row_lengths

MASSLESS = 1e-13  # mass along a freedom / largest one, below which nothing resists: it does not accelerate
# share of a number's effect on the constraints that no displacement compensates; accurate rows leave less
COMPENSATED = 1e-7
NOISE = 1e-12  # rounding of Φ, lengths of the mechanism or rad


class Tangents(NamedTuple):
    """Changes of k states by c columns: y (2 f of them), then numbers of the scene, each at y = 0.

    Changes x and v (k, n, c) are in units S; a (k, n, c) and λ (k, m, c) in SI units. ``open`` (numbers,) is
    true if no displacement compensates the effect of a number on the constraints.
    """

    x: np.ndarray
    v: np.ndarray
    a: np.ndarray
    multipliers: np.ndarray
    open: np.ndarray


class TangentRows:
    """The constraint rows at k states by their singular values, and bases of the freedoms."""

    def __init__(self, model: Model, states: States):
        self.model, self.units = model, model.units
        self.terms = terms_along(model, states)
        rows = self.terms.jacobian * model.units
        self.lengths = row_lengths(rows)
        left, values, right = np.linalg.svd(rows / self.lengths[..., None], full_matrices=True)
        largest = values.max(axis=1, initial=0.0)
        self.ranks = np.sum(values > TANGENT_RANK * largest[:, None], axis=1)
        self.rank = int(self.ranks.max(initial=0))
        r = self.rank
        self.left, self.values, self.right = left[:, :, :r], values[:, :r], right[:, :r]
        self.free = np.ascontiguousarray(right[:, r:].mT)  # (k, n, f)
        self.mass = self.terms.mass * model.units**2
        self.inverse_mass = _inverses(self.free.mT @ (self.mass[:, None] * self.free))

    def least(self, rhs: np.ndarray) -> np.ndarray:
        """Return the least solutions x (k, n) of Φ_q S x = rhs (k, m)."""
        parts = _product(self.left.mT, rhs / self.lengths) / self.values
        return _product(self.right.mT, parts)

    def opened(self, rhs: np.ndarray, rounding: float) -> bool:
        """Return whether no x compensates rhs (k, m), whose entries have a rounding."""
        unit = rhs / self.lengths
        rest = unit - _product(self.left, _product(self.left.mT, unit))
        return bool(np.abs(rest).max(initial=0.0) > COMPENSATED * np.abs(unit).max(initial=0.0) + rounding)

    def solve(self, rhs: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return a (k, n) in units S and λ (k, m) with Φ_q S a = rhs (k, m), M a + Φ_qᵀ λ = force (k, n)."""
        pushed = force * self.units
        a = self.least(rhs)
        if not self.model.kinematic:
            along = _product(self.free.mT, pushed - self.mass * a)
            a = a + _product(self.free, _product(self.inverse_mass, along))
        parts = _product(self.right, pushed - self.mass * a) / self.values
        return a, _product(self.left, parts) / self.lengths


def _product(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Return products (k, a) of matrices (k, a, b) and vectors (k, b)."""
    return np.asarray((matrices @ vectors[..., None])[..., 0])


def _inverses(matrices: np.ndarray) -> np.ndarray:
    """Return inverses (k, f, f) of mass matrices; freedoms without mass have none."""
    return np.linalg.pinv(matrices, rcond=MASSLESS, hermitian=True) if matrices.size else matrices


def with_accelerations(model: Model, states: States, rows: TangentRows) -> States:
    """Return the states with accelerations and multipliers of least norm."""
    a, multipliers = rows.solve(rows.terms.gamma, rows.terms.force)
    return states._replace(a=a * model.units, multipliers=multipliers * (not model.kinematic))


def independent_displacements(free: np.ndarray) -> np.ndarray:
    """Return the indices (f,) of displacements that determine all others, from a basis (n, f)."""
    count = free.shape[1]
    if not count:
        return np.zeros(0, dtype=int)
    return np.sort(scipy.linalg.qr(free.T, mode="r", pivoting=True)[1][:count])


def tangents_at(
    model: Model,
    states: States,
    rows: TangentRows,
    chosen: np.ndarray,
    numbers: Sequence[SceneNumber],
    step: float,
) -> Tangents:
    """Return the tangents at states whose independent displacements are ``chosen`` (k, f).

    ``step`` is the length of differences, see ``Direction.steps``.
    """
    found = _Columns(model, states, rows, chosen, step)
    f, n, zero = chosen.shape[1], model.n, np.zeros((len(states.times), 3 * model.m + model.n))
    still = np.zeros((len(states.times), n))
    columns = [found.of_displacement(found.basis[:, :, j], zero) for j in range(f)]
    columns += [found.of_velocity(still, found.basis[:, :, j], zero) for j in range(f)]
    opened = []
    for number in numbers:
        changed = number.derivative(lambda _, variant: residuals(variant, states))
        opened.append(rows.opened(changed[:, : model.m], NOISE * np.abs(number.weights).max()))
        columns.append(found.of_displacement(found.placed(-changed[:, : model.m]), changed))
    x, v, a, multipliers = (np.stack(parts, axis=-1) for parts in zip(*columns, strict=True))
    return Tangents(x, v, a, multipliers, np.array(opened, dtype=bool))


class _Columns:
    """Changes of states by one displacement or change of velocity each."""

    def __init__(self, model: Model, states: States, rows: TangentRows, chosen: np.ndarray, step: float):
        self.model, self.states, self.rows, self.chosen, self.step = model, states, rows, chosen, step
        at = np.take_along_axis(rows.free, chosen[:, :, None], axis=1)
        self.basis = rows.free @ np.linalg.inv(at)  # (k, n, f), one at one of the chosen displacements

    def placed(self, rhs: np.ndarray) -> np.ndarray:
        """Return x (k, n) with Φ_q S x = rhs (k, m), zero at the chosen displacements."""
        least = self.rows.least(rhs)
        return least - _product(self.basis, np.take_along_axis(least, self.chosen, axis=1))

    def of_displacement(self, x: np.ndarray, more: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return x, v, a, λ for a displacement x (k, n), and changes ``more`` (k, 3 m + n) of residuals."""
        changed = more + self._change(x, np.zeros_like(x))
        v = self.placed(-changed[:, self.model.m : 2 * self.model.m])
        return self.of_velocity(x, v, changed)

    def of_velocity(self, x: np.ndarray, v: np.ndarray, more: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return x, v, a, λ for a change v (k, n) of velocity; ``more`` are the changes by x."""
        m, changed = self.model.m, more + self._change(np.zeros_like(v), v)
        a, multipliers = self.rows.solve(-changed[:, 2 * m : 3 * m], -changed[:, 3 * m :])
        return x, v, a * self.model.units, multipliers * (not self.model.kinematic)

    def _change(self, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return the change (k, 3 m + n) of residuals at constant accelerations and multipliers."""
        units, none = self.model.units, np.zeros((len(x), self.model.m))
        along = Direction(x * units, v * units, np.zeros_like(x), none)
        return change_along(self.model, self.states, along, self.step)
