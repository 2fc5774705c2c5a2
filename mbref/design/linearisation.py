"""Equations of motion about a pose at rest, in coordinates along the constraints' tangent.

With x = (δr, δπ') the displacements of the bodies from a pose q0, S = diag(1 m, 1/L rad) and an orthonormal
basis Z of the null space of Φ_q S, a pose has the coordinates y: q(y) is q0 ⊕ S Z y put onto the constraints.
About an equilibrium, y'' = A y + B y' to first order, with A = ∂/∂y and B = ∂/∂y' of Zᵀ S⁻¹ q''. In a steady
motion the pose is at rest in a frame that turns with the driver (turning.py), and q'' is relative to it.
"""

from __future__ import annotations

import numpy as np

from mbref.design.turning import TURNED_BY, UNCHANGED, Turning
from mbref.equations.gaps import is_closed
from mbref.equations.initial_state import solve_positions
from mbref.equations.model import Model, displaced
from mbref.equations.units import unit_rows
from mbref.linear_algebra.least_norm import null_space

TANGENT_RANK = 1e-9  # singular value of unit rows / largest one; smaller ones count as zero
# increment of difference quotients / mechanism's length: truncation and rounding are both about 1e-13
DIFFERENCE_STEP = 0.005
SHORT = 0.04  # factor on DIFFERENCE_STEP for differences of second order
CENTRAL = (4 / 5, -1 / 5, 4 / 105, -1 / 280)  # weights of central differences of order 8


class OffConstraints(Exception):
    """No pose that satisfies the constraints was found near a displaced one."""


class Tangent:
    """Coordinates y (f,), m, of poses near a pose q0 (7 nb,) at rest in a frame."""

    def __init__(self, model: Model, q: np.ndarray, frame: Turning):
        self.model, self.q, self.frame = model, q, frame
        self.units = np.tile(np.repeat([1.0, 1.0 / model.length], 3), model.nb)
        self.step = DIFFERENCE_STEP * model.length
        self.basis = _null_space(model.terms(0.0, q).jacobian * self.units)

    @property
    def freedoms(self) -> int:
        """Number of coordinates y."""
        return int(self.basis.shape[1])

    def pose(self, y: np.ndarray) -> np.ndarray:
        """Return q(y) (7 nb,). Raises OffConstraints if no pose on the constraints is found."""
        moved = displaced(self.q, self.units * (self.basis @ y))
        found, _ = solve_positions(self.model, 0.0, moved)
        if not is_closed(self.model, self.model.terms(0.0, found)):
            raise OffConstraints
        return found

    def accelerations(self, y: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """Return y'' (f,), m/s², at y and y' (f,)."""
        q = self.pose(y) if y.any() else self.q
        v = self.units * (self.basis @ rate)
        found = accelerations(self.model, 0.0, q, self.frame.velocities(self.model, q) + v)
        return np.asarray(self.basis.T @ (self.frame.relative(self.model, q, v, found) / self.units))

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


def accelerations(model: Model, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return q'' (n,) at time t (s): of all that the rows allow, the one of Gauss's principle."""
    terms = model.terms(t, q, v)
    free = _null_space(terms.jacobian)
    bound = np.zeros(model.n)
    if model.m:
        bound = np.linalg.lstsq(terms.jacobian, terms.gamma, rcond=TANGENT_RANK)[0]
    mass = free.T @ (terms.mass[:, None] * free)
    push = free.T @ (terms.force - terms.mass * bound)
    return np.asarray(bound + free @ np.linalg.solve(mass, push))


def multipliers(tangent: Tangent) -> np.ndarray:
    """Return λ (m,) of least norm of a pose at rest in its frame, with M q'' + Φ_qᵀ λ = g."""
    model, q = tangent.model, tangent.q
    v = tangent.frame.velocities(model, q)
    terms = model.terms(0.0, q, v)
    left = terms.force - terms.mass * accelerations(model, 0.0, q, v)
    return np.asarray(np.linalg.lstsq(terms.jacobian.T, left, rcond=TANGENT_RANK)[0])


def unsteady(tangent: Tangent) -> str:
    """Return the reason why motions near a pose change while the mechanism turns; empty if they do not.

    A displaced pose with a velocity is compared with the same one after the mechanism has turned.
    """
    model, frame = tangent.model, tangent.frame
    if not frame.rate or not tangent.freedoms:
        return ""
    try:
        q = tangent.pose(np.full(tangent.freedoms, tangent.step))
    except OffConstraints:
        q = tangent.q
    now = frame.velocities(model, q)
    later, rates = frame.turned(model, q, TURNED_BY), frame.turned_rates(model, now, TURNED_BY)
    t = TURNED_BY / frame.rate
    phi = np.abs(model.terms(t, later, rates).phi)
    if phi.max(initial=0.0) > UNCHANGED * max(1.0, model.length):
        return f"joint {model.row_joint[int(phi.argmax())]!r} does not turn with it"
    before, after = accelerations(model, 0.0, q, now), accelerations(model, t, later, rates)
    change = np.abs(frame.turned_rates(model, before, TURNED_BY) - after).max()
    return "the loads change while it turns" if change > UNCHANGED * np.abs(before).max() else ""


def _null_space(jacobian: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis (n, f) of the displacements that unit rows allow."""
    return null_space(unit_rows(jacobian), TANGENT_RANK)
