"""Equations of motion about a pose at rest, in coordinates along the constraints' tangent.

With x the displacements of the bodies in units S of the mechanism (its length, and 1 rad), the tangent of the
constraints at a pose q0 is x = Z y with Φ_q S Z = 0 and Zᵀ M Z = m.  M is the mass matrix for x, m its
largest value along the tangent.  A pose has the coordinates y: q(y) is q0 ⊕ S Z y put onto the constraints.
About an equilibrium, y'' = A y + B y' to first order, with A = ∂/∂y and B = ∂/∂y' of Zᵀ M x'' / m.  A is
symmetric for forces with a potential, so that stiff directions do not round soft ones.  In a steady motion
the pose is at rest in a frame that turns with the driver (turning.py), and x'' is relative to it.
"""

from __future__ import annotations

import copy

import numpy as np

from mbref.design.allowed_motions import TANGENT_RANK, ConstraintRows, by_gauss
from mbref.design.derivatives.states import state_at_rest
from mbref.design.derivatives.tangents import (
    MASSLESS,
    TangentRows,
    partition_by,
    tangents_at,
    with_accelerations,
)
from mbref.design.differences import directional_derivative
from mbref.design.turning import TURNED_BY, UNCHANGED, Turning
from mbref.equations.gaps import gaps
from mbref.equations.joint_angles import angles_at, counted_from
from mbref.equations.model import Model, displaced, displacement
from mbref.equations.units import row_lengths, unit_rows
from mbref.scene import SceneError

# increment of difference quotients / mechanism's length: truncation and rounding are both about 1e-13
DIFFERENCE_STEP = 0.005
SHORT = 0.04  # factor on DIFFERENCE_STEP for differences of second order
UNEQUAL = 1e4  # largest / least stiffness, above which errors of the largest disturb the least
WEIGHTLESS = 1e-20  # mass along a tangent / largest mass, below which no mass resists the forces
LIGHT = 1e3  # factor on MASSLESS, since tangents have another basis
FEW_FREEDOMS = 4  # up to which differences cost less than the tangents, whose kernel is compiled once
EPSILON = float(np.finfo(float).eps)


class OffConstraints(Exception):
    """No pose that satisfies the constraints was found near a displaced one."""


class Tangent:
    """Coordinates y (f,) of poses near a pose q0 (7 nb,) at rest in a frame; Zy is in lengths or rad.

    ``conditioning`` is the one of ``allowed_motions.Allowed``, which falls to zero towards a singular
    position.  ``angles`` (k,) of torsion springs and couplings are at q0, ``at_rest`` (n,) the accelerations
    of bodies at rest in the frame, m/s² and rad/s².  ``lightest`` is the least mass along the tangent / m.
    """

    def __init__(
        self, model: Model, q: np.ndarray, frame: Turning, angles: np.ndarray, before: Tangent | None = None
    ):
        """Store a pose; ``before`` is the tangent at a pose near it."""
        self.basis: np.ndarray
        self.model, self.q, self.frame = model, q, frame
        self.angles = angles_at(model, q, angles)
        with counted_from(model, self.angles):
            self.terms = terms = model.terms(0.0, q, frame.velocities(model, q))
        self.rows: ConstraintRows = before.rows if before else ConstraintRows(model, q)
        allowed = self.rows.allowed(terms, before.basis if before else None)
        self.conditioning, free = allowed.conditioning, allowed.free
        self.weight = terms.mass * model.units**2
        squares, axes = np.linalg.eigh(free.T @ (self.weight[:, None] * free))
        self.mass = float(squares.max(initial=0.0))
        self.lightest = float(squares.min(initial=self.mass)) / (self.mass or 1.0)
        if squares.size and not squares.min() > WEIGHTLESS * self.mass:
            raise _weightless(model, free @ axes[:, 0])
        self.at_rest = by_gauss(model, terms, allowed)
        self.basis = free @ (axes * np.sqrt(self.mass / squares))
        inwards = frame.relative(model, q, np.zeros(model.n), np.zeros(model.n)) / model.units
        self.forces = norms_by_body(terms.force * model.units) + norms_by_body(self.weight * inwards)

    @property
    def freedoms(self) -> int:
        """Number of coordinates y."""
        return int(self.basis.shape[1])

    @property
    def sizes(self) -> np.ndarray:
        """Largest displacement (f,) of a body, lengths or rad, for each unit coordinate."""
        return np.asarray(np.linalg.norm(self.basis, axis=0))

    @property
    def pushes(self) -> np.ndarray:
        """Scale (f,) of the accelerations y'': what the forces on the bodies give without cancelling."""
        return self.pushes_of(self.forces)

    def pushes_of(self, forces: np.ndarray) -> np.ndarray:
        """Return ``pushes`` for the sizes (2 nb,) of forces on the bodies."""
        return np.asarray(norms_by_body(self.basis).T @ forces / self.mass)

    def along(self, axes: np.ndarray) -> Tangent:
        """Return the tangent with coordinates along orthonormal directions (f, f) of y."""
        found = copy.copy(self)
        found.basis = self.basis @ axes
        return found

    def coordinates(self, x: np.ndarray) -> np.ndarray:
        """Return y (f, …) of displacements or accelerations x (n, …), lengths or rad."""
        return np.asarray((self.weight[:, None] * self.basis).T @ x / self.mass)

    def pose(self, y: np.ndarray) -> np.ndarray:
        """Return q(y) (7 nb,). Raises OffConstraints if no pose on the constraints is found."""
        moved = displaced(self.q, self.model.units * (self.basis @ y))
        with counted_from(self.model, self.angles):
            found = self.rows.closed(moved)
        if found is None:
            raise OffConstraints
        return found

    def to(self, other: Tangent) -> np.ndarray:
        """Return the small displacements (n,), lengths or rad, to the pose of another tangent."""
        return np.asarray(displacement(self.q, other.q) / self.model.units)

    def moved(self, y: np.ndarray) -> Tangent | None:
        """Return the tangent at q(y); None if no pose on the constraints is found."""
        try:
            return Tangent(self.model, self.pose(y), self.frame, self.angles, self)
        except OffConstraints:
            return None

    def relative_accelerations(self, y: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """Return x'' (n,), lengths or rad over s², at y and y' (f,)."""
        model, frame = self.model, self.frame
        q = self.pose(y) if y.any() else self.q
        v = model.units * (self.basis @ rate)
        with counted_from(model, self.angles):
            terms = model.terms(0.0, q, frame.velocities(model, q) + v)
            found = by_gauss(model, terms, self.rows.allowed(terms, self.basis))
        return frame.relative(model, q, v, found) / model.units

    def accelerations(self, y: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """Return y'' (f,), 1/s², at y and y' (f,)."""
        return self.coordinates(self.relative_accelerations(y, rate))

    def off_balance(self) -> np.ndarray:
        """Return x'' (n,) at the pose at rest: zero at an equilibrium."""
        still = np.zeros(self.model.n)
        return self.frame.relative(self.model, self.q, still, self.at_rest) / self.model.units

    def slope(self, at: np.ndarray | None = None) -> np.ndarray:
        """Return A = ∂y''/∂y (f, f) at y, by default at the pose, where many freedoms have it by compiled
        tangents; otherwise by differences of second order.

        The stiffest direction has the largest error, which enters softer directions. Where they are far
        softer, Richardson's extrapolation reduces it to fourth order.
        """
        if at is None and (exact := self.exact_slope()) is not None:
            return exact
        place = np.zeros(self.freedoms) if at is None else at
        found = self._differences(place, SHORT * DIFFERENCE_STEP)
        stiffness = np.linalg.svd(found, compute_uv=False)
        if stiffness.max(initial=0.0) > UNEQUAL * stiffness.min(initial=np.inf):
            found += (found - self._differences(place, 2 * SHORT * DIFFERENCE_STEP)) / 3
        return found

    def exact_slope(self) -> np.ndarray | None:
        """Return A (f, f) by the variations of the equations; None for few freedoms, in a turning frame, and
        where bodies hardly have mass or a force has no derivative."""
        if self.freedoms <= FEW_FREEDOMS or self.frame.rate or self.lightest <= LIGHT * MASSLESS:
            return None
        model, at_rest = self.model, state_at_rest(self.model, self.q, self.angles)
        partition = partition_by(self.basis, unit_rows(self.terms.jacobian * model.units), model)
        rows = TangentRows(model, at_rest, partition)
        found = tangents_at(model, with_accelerations(at_rest, rows), rows, ()).a[0]
        own = found[:, : self.freedoms] / model.units[:, None] @ self.basis[partition.independent]
        return self.coordinates(own) if np.isfinite(own).all() else None

    def _differences(self, place: np.ndarray, step: float) -> np.ndarray:
        """Return A (f, f) at y by central differences with a step, lengths or rad."""
        zero, h = np.zeros(self.freedoms), step / self.sizes
        pairs = [
            (self.accelerations(place + move, zero), self.accelerations(place - move, zero))
            for move in np.diag(h)
        ]
        return np.array([after - before for after, before in pairs]).T / (2 * h)

    def by_place(self, share: float) -> np.ndarray:
        """Return A = ∂y''/∂y (f, f) by differences of order 8, with a share of the step."""
        zero, steps = np.zeros(self.freedoms), share * DIFFERENCE_STEP / self.sizes
        changes = [directional_derivative(lambda y: self.accelerations(y, zero), h) for h in np.diag(steps)]
        return np.array(changes).T / steps

    def by_rate(self, scale: float) -> np.ndarray:
        """Return B = ∂y''/∂y' (f, f) by differences of order 8, whose step belongs to a rate ``scale``,
        1/s."""
        zero, steps = np.zeros(self.freedoms), DIFFERENCE_STEP / self.sizes * scale
        changes = [directional_derivative(lambda y: self.accelerations(zero, y), h) for h in np.diag(steps)]
        return np.array(changes).T / steps

    def rate_scale(self, by_place: np.ndarray) -> float:
        """Return the rate, 1/s, of motions by the forces over one length of the mechanism, or by A (f, f)
        where the forces on a body cancel; 1 without forces."""
        squares = np.append(self.pushes / self.sizes, np.abs(by_place))
        return float(np.sqrt(squares.max(initial=0.0))) or 1.0


def _weightless(model: Model, x: np.ndarray) -> SceneError:
    """Return the error of a motion x (n,) without mass; it names the body that moves most."""
    moves = norms_by_body(x).reshape(-1, 2)
    body, part = np.unravel_index(int(moves.argmax()), moves.shape)
    name, field = model.scene.body[body].name, ("mass", "inertia")[part]
    what = "resists a motion of it that the joints allow, so that the motion has no vibration"
    return SceneError([f"body[{name}].{field}: no {field} {what}"])


def norms_by_body(x: np.ndarray) -> np.ndarray:
    """Return the lengths (2 nb, …) of the translational and rotational parts of x (6 nb, …)."""
    return np.asarray(np.linalg.norm(x.reshape(-1, 3, *x.shape[1:]), axis=1))


def accelerations(model: Model, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return q'' (n,) at time t (s): of all that the rows allow, the one of Gauss's principle."""
    terms = model.terms(t, q, v)
    return by_gauss(model, terms, ConstraintRows(model, q).allowed(terms, None))


def multipliers(tangent: Tangent) -> np.ndarray:
    """Return λ (m,) of least norm of a pose at rest in its frame, with M q'' + Φ_qᵀ λ = g."""
    model, q = tangent.model, tangent.q
    v = tangent.frame.velocities(model, q)
    with counted_from(model, tangent.angles):
        terms = model.terms(0.0, q, v)
    left = (terms.force - terms.mass * tangent.at_rest) * model.units
    rows = terms.jacobian * model.units
    lengths = row_lengths(rows)
    return np.asarray(np.linalg.lstsq((rows / lengths[:, None]).T, left, rcond=TANGENT_RANK)[0] / lengths)


def unsteady(tangent: Tangent) -> str:
    """Return the reason why motions near a pose change while the mechanism turns; empty if they do not.

    A displaced pose with a velocity is compared with the same one after the mechanism has turned.
    """
    model, frame = tangent.model, tangent.frame
    if not frame.rate or not tangent.freedoms:
        return ""
    try:
        q = tangent.pose(DIFFERENCE_STEP / tangent.sizes)
    except OffConstraints:
        q = tangent.q
    now = frame.velocities(model, q)
    later, rates = frame.turned(model, q, TURNED_BY), frame.turned_rates(model, now, TURNED_BY)
    t = TURNED_BY / frame.rate
    with counted_from(model, tangent.angles):
        gap = gaps(model.terms(t, later, rates), model.length)
        if gap.max(initial=0.0) > UNCHANGED:
            return f"joint {model.row_joint[int(gap.argmax())]!r} does not turn with it"
        before, after = accelerations(model, 0.0, q, now), accelerations(model, t, later, rates)
    change = np.abs((frame.turned_rates(model, before, TURNED_BY) - after) / model.units).max()
    return (
        "the loads change while it turns" if change > UNCHANGED * np.abs(before / model.units).max() else ""
    )
