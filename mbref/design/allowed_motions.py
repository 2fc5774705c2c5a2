"""Motions that the constraints of a pose allow: accelerations, and poses on the constraints near others.

Displacements and accelerations x (n,) are in units of the mechanism: lengths and rad. A few rows are solved
by singular values. For many rows a sparse factorisation moves the null vectors of a near pose into the null
space, unless its pivots leave the rank in doubt.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mbref.equations.gaps import CLOSED, gaps, lengths_of_rows
from mbref.equations.initial_state import (
    LARGE,
    MET,
    MOST_ITERATIONS,
    SHORTEST_MOVE,
    position_weights,
    solve_positions,
)
from mbref.equations.model import Model, Terms, displaced
from mbref.equations.sparse_rows import SparseRows
from mbref.equations.units import row_lengths
from mbref.linear_algebra.minimum_norm import ALPHA

FEW_ROWS = 5  # rows; for more, singular values take longer than a sparse factorisation
TANGENT_RANK = 1e-9  # singular value of unit rows / largest one; smaller ones count as zero
TURNED_AWAY = 0.1  # length of a moved unit null vector; a shorter one may miss a direction of the null space


@dataclass(frozen=True)
class Allowed:
    """Solutions of Φ_q S x = γ: the least one, ``bound`` (n,), and an orthonormal basis ``free`` (n, f) of
    the null space. ``conditioning`` is the smallest nonzero singular value of unit rows over the largest, or
    the smallest pivot, which is a bound of it."""

    bound: np.ndarray
    free: np.ndarray
    conditioning: float


class ConstraintRows:
    """The constraint rows of a model, at poses near q (7 nb,)."""

    def __init__(self, model: Model, q: np.ndarray):
        self.model, self._first = model, q

    @cached_property
    def _sparse(self) -> SparseRows | None:
        return SparseRows(self.model, self._first) if self.model.m > FEW_ROWS else None

    def allowed(self, terms: Terms, near: np.ndarray | None) -> Allowed:
        """Return the solutions of the terms' rows; ``near`` (n, f) spans the null space of a near pose."""
        found = None if near is None else self._moved(terms, near)
        if found is not None:
            return found
        rows = terms.jacobian * self.model.units
        lengths = row_lengths(rows)
        few = rows.shape[0] < rows.shape[1]  # then the null space needs all right singular vectors
        left, values, right = np.linalg.svd(rows / lengths[:, None], full_matrices=few)
        rank = int(np.sum(values > TANGENT_RANK * values.max(initial=0.0)))
        bound = right[:rank].T @ (left[:, :rank].T @ (terms.gamma / lengths) / values[:rank])
        return Allowed(bound, right[rank:].T, float(values[rank - 1] / values[0]) if rank else 1.0)

    def _moved(self, terms: Terms, near: np.ndarray) -> Allowed | None:
        """Return the solutions by a sparse factorisation; None for few rows, or if the rank is in doubt."""
        if self._sparse is None:
            return None
        units, count = self.model.units, near.shape[1]
        x = np.zeros((1 + count, self.model.n))
        x[1:] = (units[:, None] * near / np.linalg.norm(near, axis=0)).T
        rhs = np.zeros((1 + count, self.model.m))
        rhs[0] = terms.gamma
        if not self._sparse.change(terms.blocks, units, x, rhs):
            return None
        if self._sparse.rank != self.model.n - count:
            return None
        x /= units
        free, triangle = np.linalg.qr(x[1:].T)
        if np.abs(np.diag(triangle)).min(initial=1.0) < TURNED_AWAY:
            return None
        return Allowed(x[0], free, self._sparse.least_pivot)

    def closed(self, q: np.ndarray) -> np.ndarray | None:
        """Return the coordinates (7 nb,) on the constraints nearest to q, in the metric of M; None if there
        are none."""
        sparse = self._sparse
        if sparse is not None and (self.model.m > LARGE or sparse.are_independent):
            return self._closed(q, sparse)
        found, _ = solve_positions(self.model, 0.0, q)
        terms = self.model.terms(0.0, found)
        return found if gaps(terms, self.model.length).max(initial=0.0) <= CLOSED else None

    def _closed(self, q: np.ndarray, sparse: SparseRows) -> np.ndarray | None:
        """Return ``closed`` by Newton steps with a sparse factorisation each."""
        model = self.model
        reach = np.abs(q.reshape(model.nb, 7)[:, :3]).max() / model.length
        terms = model.terms(0.0, q)
        lengths = lengths_of_rows(terms.blocks, model.length)  # for all steps, which change them little
        for _ in range(MOST_ITERATIONS):
            gap = (np.abs(terms.phi) / lengths).max(initial=0.0)
            if gap <= MET * max(1.0, reach):
                return q
            x = np.zeros((1, model.n))
            # off the constraints, rows that depend on others there are nearly dependent
            sparse.change(terms.blocks, self._root, x, -terms.phi[None], ALPHA)
            if np.abs(x / model.units).max() < SHORTEST_MOVE:
                break
            q = displaced(q, x[0])
            terms = model.terms(0.0, q)
        return q if gap <= CLOSED else None

    @cached_property
    def _root(self) -> np.ndarray:
        return np.asarray(1.0 / np.sqrt(position_weights(self.model)))


def by_gauss(model: Model, terms: Terms, allowed: Allowed) -> np.ndarray:
    """Return q'' (n,) of the terms: of all that the rows allow, the one of Gauss's principle."""
    free, bound, weight = allowed.free, allowed.bound, terms.mass * model.units**2
    mass = free.T @ (weight[:, None] * free)
    push = free.T @ (terms.force * model.units - weight * bound)
    return np.asarray(model.units * (bound + free @ np.linalg.solve(mass, push)))
