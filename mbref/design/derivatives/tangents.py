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
from mbref.equations.row_factors import FactorMemory, RowPartition, SolveMemory, factorise_rows, solve_rows
from mbref.equations.tangent_solutions import (
    StatesAndRows,
    TangentMemory,
    UnitsAndMass,
    compute_tangents,
)
from mbref.equations.units import row_lengths, unit_rows
from mbref.kernels.named_memory import allocate, packed
from mbref.linear_algebra.elimination_order import elimination_order, lu_pattern, places_in_factors

MASSLESS = 1e-13  # mass along a freedom / largest one, below which nothing resists: it does not accelerate
# share of a number's effect on the constraints that no displacement compensates; accurate rows leave less
COMPENSATED = 1e-7
NOISE = 1e-12  # rounding of Φ, lengths of the mechanism or rad
SIGN_VECTORS = 4  # vectors of signs, whose products with D⁻¹ estimate its norm
MOST_ENTRIES = 2_000_000  # numbers at states that are computed together: 16 MB


def partition_of(model: Model, state: States) -> RowPartition:
    """Return the partition of rows and displacements at one state (1,), by singular values and pivots."""
    rows = unit_rows(terms_along(model, state).jacobian[0] * model.units)
    _, values, right = np.linalg.svd(rows, full_matrices=True)
    rank = int(np.sum(values > TANGENT_RANK * values.max(initial=0.0)))
    return partition_by(right[rank:].T, rows, model)


def partition_by(free: np.ndarray, rows: np.ndarray, model: Model) -> RowPartition:
    """Return the partition of unit rows (m, n) of a model and displacements, by pivots; ``free`` (n, f) spans
    the null space of the rows."""
    independent = _pivots(free.T)
    dependent = np.setdiff1d(np.arange(len(free)), independent)
    chosen = _pivots(rows[:, dependent].T)
    possible = np.zeros(rows.shape, dtype=bool)
    row, entry = np.nonzero(model.entry_columns < model.n)
    possible[row, column := model.entry_columns[row, entry]] = True
    within = np.ix_(chosen, dependent)
    orders = elimination_order(rows[within], possible[within])
    chosen, dependent = chosen[orders[0]], dependent[orders[1]]
    lu = lu_pattern(possible[np.ix_(chosen, dependent)])
    place = row * model.entry_columns.shape[1] + entry
    i, j = _places(chosen, len(rows))[row], _places(dependent, model.n)[column]
    of_d, free_column = (i >= 0) & (j >= 0), _places(independent, model.n)[column]
    of_c = np.flatnonzero((i >= 0) & (free_column >= 0))
    of_c = of_c[np.argsort(free_column[of_c], kind="stable")]
    starts = np.searchsorted(free_column[of_c], np.arange(len(independent) + 1))
    of_factors = places_in_factors(lu, i[of_d], j[of_d])
    parts = place[of_d], of_factors, place[of_c], i[of_c], starts
    return RowPartition(chosen, dependent, independent, *parts, lu)


def _places(chosen: np.ndarray, count: int) -> np.ndarray:
    """Return the place (count,) of each index among the chosen ones, -1 for others."""
    found = np.full(count, -1)
    found[chosen] = np.arange(len(chosen))
    return found


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
        count, units = len(states.times), np.append(model.units, np.zeros(6))  # the fixed frame does not move
        entries = self.terms.blocks * units[model.entry_columns]
        self._lengths = row_lengths(entries)
        entries /= self._lengths[..., None]
        sizes = {"k": count, "n": model.n, "r": len(partition.rows), "free": len(partition.independent)}
        sizes |= {
            "factors": len(partition.lu.column),
            "entries": model.entry_columns.size,
            "probes": SIGN_VECTORS,
        }
        given = {"partition": partition, "entries": entries.reshape(count, -1)}
        probes = np.random.default_rng(0).choice([-1.0, 1.0], (SIGN_VECTORS, sizes["r"]))
        memory = allocate(FactorMemory, sizes, **given, probes=probes)
        factorise_rows(packed(memory).argument)
        self._factors, self._probed = memory.factors, memory.probed
        self.basis = memory.basis.reshape(count, model.n, sizes["free"])
        self.mass = (self.terms.mass * model.units**2)[:, None]

    @property
    def inverse_sizes(self) -> np.ndarray:
        """Estimates (k,) of the Frobenius norm of D⁻¹, from its products with vectors of signs."""
        products = self._probed.reshape(len(self.basis), -1)
        return np.asarray(np.linalg.norm(products, axis=1) / np.sqrt(SIGN_VECTORS))

    @property
    def pivots(self) -> np.ndarray:
        """Sizes (k, r) of the pivots of D."""
        return np.abs(self._factors[:, self.partition.lu.diagonal])

    def packed(self, states: States) -> dict[str, StatesAndRows | RowPartition | UnitsAndMass]:
        """Return the states, and these rows, as arrays of ``TangentMemory``."""
        count, n, f = self.basis.shape
        compliance = np.zeros((count, f, f)) if self.model.kinematic else self._inverse_mass
        given = states.times, states.q, states.v, states.angles, states.a, states.multipliers, self._lengths
        arrays = self._factors, self.basis.reshape(count * n, f), compliance.reshape(count * f, f)
        has_mass = np.array([not self.model.kinematic], dtype=np.int64)
        return {
            "states": StatesAndRows(*map(np.ascontiguousarray, (*given, *arrays))),
            "partition": self.partition,
            "body": UnitsAndMass(self.units, np.ascontiguousarray(self.mass[:, 0]), has_mass),
        }

    def _solved(self, rhs: np.ndarray, transposed: bool = False) -> np.ndarray:
        """Return D⁻¹ or D⁻ᵀ times right-hand sides (k, r, c)."""
        count, size, columns = rhs.shape
        found = np.ascontiguousarray(rhs.mT).reshape(count * columns, size)
        memory = SolveMemory(self.partition.lu, self._factors, found)
        solve_rows(int(transposed), packed(memory).argument)
        return found.reshape(count, columns, size).mT

    def placed(self, rhs: np.ndarray) -> np.ndarray:
        """Return x (k, n, c) with Φ_q S x = rhs (k, m, c), zero at the independent displacements."""
        x = np.zeros((len(rhs), self.model.n, rhs.shape[2]))
        unit = rhs / self._lengths[..., None]
        x[:, self.partition.dependent] = self._solved(unit[:, self.partition.rows])
        return x

    def solve(self, rhs: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return a (k, n, c) and λ (k, m, c), zero for dependent rows, with Φ_q a = rhs (k, m, c) and
        M a + Φ_qᵀ λ = force (k, n, c)."""
        pushed, a = force * self.units[:, None], self.placed(rhs)
        multipliers = np.zeros_like(rhs)
        if not self.model.kinematic:
            a = a + self.basis @ (self._inverse_mass @ (self.basis.mT @ (pushed - self.mass * a)))
            left = (pushed - self.mass * a)[:, self.partition.dependent]
            multipliers[:, self.partition.rows] = self._solved(left, transposed=True)
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
