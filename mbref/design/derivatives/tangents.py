"""Tangents of the equations of motion: derivatives of a state by coordinates of the freedoms, and by numbers.

Displacements and their rates are in units S of the mechanism (its length, and 1 rad). At k states, f of the
n displacements determine the others; y = (u, w) are these f displacements and changes of velocities.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.linalg

from mbref.design.allowed_motions import TANGENT_RANK
from mbref.design.derivatives.changes_of_scene import scene_changes
from mbref.design.derivatives.numbers_of_scene import SceneNumber
from mbref.design.derivatives.states import States, terms_along
from mbref.equations.model import Model
from mbref.equations.tangent_solutions import (
    PartitionAndUnits,
    StatesAndRows,
    TangentMemory,
    compute_tangents,
)
from mbref.equations.units import row_lengths, unit_rows
from mbref.kernels.named_memory import allocate, packed

MASSLESS = 1e-13  # mass along a freedom / largest one, below which nothing resists: it does not accelerate
# share of a number's effect on the constraints that no displacement compensates; accurate rows leave less
COMPENSATED = 1e-7
NOISE = 1e-12  # rounding of Φ, lengths of the mechanism or rad
MOST_ENTRIES = 2_000_000  # numbers at states that are computed together: 16 MB


class RowPartition(NamedTuple):
    """Independent constraint rows (r,), dependent displacements (r,) that they determine, and independent
    displacements (f,)."""

    rows: np.ndarray
    dependent: np.ndarray
    independent: np.ndarray


def partition_of(model: Model, state: States) -> RowPartition:
    """Return the partition of rows and displacements at one state (1,), by singular values and pivots."""
    rows = unit_rows(terms_along(model, state).jacobian[0] * model.units)
    _, values, right = np.linalg.svd(rows, full_matrices=True)
    rank = int(np.sum(values > TANGENT_RANK * values.max(initial=0.0)))
    return partition_by(right[rank:].T, rows)


def partition_by(free: np.ndarray, rows: np.ndarray) -> RowPartition:
    """Return the partition of unit rows (m, n) and displacements, by pivots; ``free`` (n, f) spans the null
    space of the rows."""
    independent = _pivots(free.T)
    dependent = np.setdiff1d(np.arange(len(free)), independent)
    return RowPartition(_pivots(rows[:, dependent].T), dependent, independent)


def _pivots(matrix: np.ndarray) -> np.ndarray:
    """Return the indices (r,) of columns of a matrix (r, c) that span it best."""
    if not matrix.size:
        return np.zeros(0, dtype=int)
    return np.sort(scipy.linalg.qr(matrix, mode="r", pivoting=True)[1][: len(matrix)]).astype(int)


def tangent_ranks(model: Model, states: States) -> list[int]:
    """Return the ranks of the constraint rows at states."""
    values = np.linalg.svd(unit_rows(terms_along(model, states).jacobian * model.units), compute_uv=False)
    return np.sum(values > TANGENT_RANK * values.max(axis=1, initial=0.0, keepdims=True), axis=1).tolist()


class TangentRows:
    """The constraint rows at k states, and bases (k, n, f) of the freedoms: each column moves one independent
    displacement by one unit."""

    def __init__(self, model: Model, states: States, partition: RowPartition):
        self.model, self.units, self.partition = model, model.units, partition
        self.terms = terms_along(model, states)
        rows = self.terms.jacobian * model.units
        self._lengths = row_lengths(rows)
        self._unit = rows / self._lengths[..., None]
        chosen = self._unit[:, partition.rows]
        self.inverse = np.linalg.inv(chosen[..., partition.dependent])
        self.basis = np.zeros((len(rows), model.n, len(partition.independent)))
        self.basis[:, partition.dependent] = -self.inverse @ chosen[..., partition.independent]
        self.basis[:, partition.independent] = np.eye(len(partition.independent))
        self.mass = (self.terms.mass * model.units**2)[:, None]

    def packed(self, states: States) -> dict[str, StatesAndRows | PartitionAndUnits]:
        """Return the states, and these rows, as arrays of ``TangentMemory``."""
        f, r = self.basis.shape[2], len(self.partition.rows)
        compliance = np.zeros((len(states.times), f, f)) if self.model.kinematic else self._inverse_mass
        count, n = self.basis.shape[:2]
        arrays = (
            self.inverse.reshape(count * r, r),
            self.basis.reshape(count * n, f),
            compliance.reshape(count * f, f),
        )
        given = states.times, states.q, states.v, states.angles, states.a, states.multipliers, self._lengths
        has_mass = np.array([not self.model.kinematic], dtype=np.int64)
        own = *self.partition, self.units, self.mass[:, 0], has_mass
        return {
            "states": StatesAndRows(*map(np.ascontiguousarray, (*given, *arrays))),
            "partition": PartitionAndUnits(*map(np.ascontiguousarray, own)),
        }

    def placed(self, rhs: np.ndarray) -> np.ndarray:
        """Return x (k, n, c) with Φ_q S x = rhs (k, m, c), zero at the independent displacements."""
        x = np.zeros((len(rhs), self.model.n, rhs.shape[2]))
        unit = rhs / self._lengths[..., None]
        x[:, self.partition.dependent] = self.inverse @ unit[:, self.partition.rows]
        return x

    def solve(self, rhs: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return a (k, n, c) and λ (k, m, c), zero for dependent rows, with Φ_q a = rhs (k, m, c) and
        M a + Φ_qᵀ λ = force (k, n, c)."""
        pushed, a = force * self.units[:, None], self.placed(rhs)
        multipliers = np.zeros_like(rhs)
        if not self.model.kinematic:
            a = a + self.basis @ (self._inverse_mass @ (self.basis.mT @ (pushed - self.mass * a)))
            parts = self.inverse.mT @ (pushed - self.mass * a)[:, self.partition.dependent]
            multipliers[:, self.partition.rows] = parts
        return a * self.units[:, None], multipliers / self._lengths[..., None]

    @cached_property
    def _inverse_mass(self) -> np.ndarray:
        """Return inverses (k, f, f) of the mass matrices of the freedoms; one without mass has none."""
        matrices = self.basis.mT @ (self.mass * self.basis)
        if not matrices.size or self.mass.min() > MASSLESS * self.mass.max():
            return np.linalg.inv(matrices)
        return np.linalg.pinv(matrices, rcond=MASSLESS, hermitian=True)


def with_accelerations(states: States, rows: TangentRows) -> States:
    """Return the states with their accelerations and multipliers."""
    a, multipliers = rows.solve(rows.terms.gamma[..., None], rows.terms.force[..., None])
    return states._replace(a=a[..., 0], multipliers=multipliers[..., 0])


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


def tangents_at(model: Model, states: States, rows: TangentRows, numbers: Sequence[SceneNumber]) -> Tangents:
    """Return the tangents at states with accelerations."""
    sizes = {**model.sizes, "k": len(states.times), "r": len(rows.partition.rows)}
    sizes |= {"free": len(rows.partition.independent), "numbers": len(numbers)}
    sizes["c"] = count = 2 * sizes["free"] + len(numbers)
    memory = allocate(TangentMemory, sizes, **rows.packed(states), numbers=scene_changes(numbers, model))
    equations = model.memory
    before = equations.values.angles.copy()
    compute_tangents(sizes["free"], packed(memory).argument, equations.packed.argument)
    equations.values.angles[:] = before
    found = memory.found
    noise = NOISE * np.array([np.abs(number.weights).max() for number in numbers])
    x, v, a, multipliers = (part.reshape(len(states.times), count, part.shape[1]).mT for part in found[:4])
    return Tangents(x, v, a, multipliers, found.rest > COMPENSATED * found.largest + noise)
