"""Equations of motion about a pose at rest, in coordinates along the constraints' tangent.

With x = (δr, δπ') the displacements of the bodies from a pose q0, S = diag(1 m, 1/L rad) and an orthonormal
basis Z of the null space of Φ_q S, a pose has the coordinates y: q(y) is the pose q0 ⊕ S Z y, projected onto
the constraints. About an equilibrium, y'' = A y + B y' to first order, with A = ∂/∂y and B = ∂/∂y' of Zᵀ S⁻¹
q''.
"""

from __future__ import annotations

import numpy as np

from mbref.equations.initial_state import solve_positions
from mbref.equations.model import Model, displaced
from mbref.equations.units import row_lengths

RANK = 1e-9  # singular value of unit rows / largest one; smaller ones count as zero
STEP = 0.02  # increment of difference quotients / mechanism's length; its eighth power is rounding
SHORT = 0.01  # factor on STEP for differences of second order
CENTRAL = (4 / 5, -1 / 5, 4 / 105, -1 / 280)  # weights of central differences of order 8
MET = 1e-10  # largest |Φ| / mechanism's length for a pose that satisfies the constraints


class OffConstraints(Exception):
    """No pose that satisfies the constraints was found near a displaced one."""


class Tangent:
    """Coordinates y (f,), m, of poses near a pose q0 (7 nb,) at rest."""

    def __init__(self, model: Model, q: np.ndarray):
        self.model, self.q = model, q
        length = max(model.length, 1e-12)
        self.units = np.tile(np.repeat([1.0, 1.0 / length], 3), model.nb)
        self.step = STEP * length
        self.basis = _null_space(model.terms(0.0, q, np.zeros(model.n)).jacobian * self.units)

    @property
    def freedoms(self) -> int:
        """Number of coordinates y."""
        return int(self.basis.shape[1])

    def pose(self, y: np.ndarray) -> np.ndarray:
        """Return q(y) (7 nb,). Raises OffConstraints if no pose on the constraints is found."""
        moved = displaced(self.q, self.units * (self.basis @ y))
        found, _ = solve_positions(self.model, 0.0, moved)
        phi = self.model.terms(0.0, found, np.zeros(self.model.n)).phi
        if np.abs(phi).max(initial=0.0) > MET * max(1.0, self.model.length):
            raise OffConstraints
        return found

    def accelerations(self, y: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """Return y'' (f,), m/s², at y and y' (f,)."""
        q = self.pose(y) if y.any() else self.q
        v = self.units * (self.basis @ rate)
        return np.asarray(self.basis.T @ (accelerations(self.model, q, v) / self.units))

    def slope(self) -> np.ndarray:
        """Return A = ∂y''/∂y (f, f) by differences of second order, for Newton's method."""
        zero, moves = np.zeros(self.freedoms), SHORT * self.step * np.eye(self.freedoms)
        pairs = [(self.accelerations(move, zero), self.accelerations(-move, zero)) for move in moves]
        return np.array([after - before for after, before in pairs]).T / (2 * SHORT * self.step)

    def linear_part(self) -> tuple[np.ndarray, np.ndarray]:
        """Return A = ∂y''/∂y and B = ∂y''/∂y' (f, f) by differences of order 8."""
        zero, directions = np.zeros(self.freedoms), np.eye(self.freedoms)
        by_place = [self._derivative(lambda y: self.accelerations(y, zero), d) for d in directions]
        by_rate = [self._derivative(lambda y: self.accelerations(zero, y), d) for d in directions]
        return np.array(by_place).T, np.array(by_rate).T

    def _derivative(self, function, direction: np.ndarray) -> np.ndarray:  # type: ignore[no-untyped-def]
        h = self.step
        parts = [
            w * (function(k * h * direction) - function(-k * h * direction)) for k, w in enumerate(CENTRAL, 1)
        ]
        return np.asarray(np.sum(parts, axis=0) / h)


def accelerations(model: Model, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return q'' (n,) at t = 0: the accelerations of Gauss's principle among all that the constraint rows
    allow."""
    terms = model.terms(0.0, q, v)
    free = _null_space(terms.jacobian)
    bound = np.linalg.lstsq(terms.jacobian, terms.gamma, rcond=RANK)[0] if model.m else np.zeros(model.n)
    mass = free.T @ (terms.mass[:, None] * free)
    push = free.T @ (terms.force - terms.mass * bound)
    return np.asarray(bound + free @ np.linalg.solve(mass, push))


def multipliers(model: Model, q: np.ndarray) -> np.ndarray:
    """Return λ (m,) of least norm at rest, with M q'' + Φ_qᵀ λ = g."""
    terms, still = model.terms(0.0, q, np.zeros(model.n)), np.zeros(model.n)
    left = terms.force - terms.mass * accelerations(model, q, still)
    return np.asarray(np.linalg.lstsq(terms.jacobian.T, left, rcond=RANK)[0])


def _null_space(jacobian: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis (n, f) of the displacements that unit rows allow."""
    if not len(jacobian):
        return np.eye(jacobian.shape[1])
    _, values, vectors = np.linalg.svd(jacobian / row_lengths(jacobian)[:, None])
    return np.asarray(vectors[int(np.sum(values > RANK * values[0])) :].T)
