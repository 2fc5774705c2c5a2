"""Equations of small motions in joint coordinates of a spanning tree, with multipliers.

M δq'' + C δq' + K δq = Gᵀ δλ and G δq = 0. A steady motion has joint rates v₀ that stay the same, zero at
rest, and multipliers λ with Q(q, v₀) + Gᵀ λ = 0. M is the mass matrix, C = -∂Q/∂v, K = -∂(Q + Gᵀ λ)/∂q.
Displacements N u with G N = 0 give Nᵀ M N u'' + Nᵀ C N u' + Nᵀ K N u = 0. The derivatives are central
differences of order 8 in long doubles.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from crosscheck.judge.arithmetic import DOUBLE, EXTENDED, Arithmetic, doubles
from crosscheck.judge.deadline import ask
from crosscheck.judge.reference.tree_equations import Instant, TreeEquations
from crosscheck.judge.reference.vectors import apply, product, unit
from crosscheck.judge.small_motions.meeting_ends import refuse_damped_meeting
from crosscheck.judge.small_motions.turning import REST, Turning
from crosscheck.judge.tolerances import RANK
from mbref import rotations
from mbref.scene import Scene

PROBE = 1e-6  # displacement, rad or lengths, that shows the directions in which the ends of springs part
STEP = 0.02  # increment of difference quotients, rad or lengths of the mechanism
CENTRAL = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))  # weights of differences of order 8
CLOSED = 1e-12  # largest residual of closed loops / length of the mechanism
CLOSINGS = 6  # attempts of Newton's method to close the loops of a displaced pose
TURNS_AS_A_WHOLE = 1e-9  # part of the twists by which joint rates may miss a common rotation


class NotSteady(Exception):
    """The mechanism cannot move steadily at a pose; the argument says the reason."""


class Small(NamedTuple):
    """Matrices of small motions u (f,): mass, damping and stiffness (f, f); N (nv, f); and the increment of
    the difference quotients."""

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    basis: np.ndarray
    step: float = STEP

    def eigenvalues(self) -> np.ndarray:
        """Return the exponents s (2f,), 1/s, of motions exp(s t), slowest first."""
        return ordered(np.linalg.eigvals(self.matrix()).astype(complex))

    def matrix(self, rate: float = 1.0) -> np.ndarray:
        """Return the matrix (2f, 2f) of the motions of (u, u' / rate)."""
        f = len(self.mass)
        lower = np.linalg.solve(self.mass, np.hstack([-self.stiffness / rate, -self.damping]))
        return np.vstack([rate * np.eye(f, 2 * f, f), lower])


def ordered(eigenvalues: np.ndarray) -> np.ndarray:
    """Return eigenvalues by size, conjugate ones with the positive imaginary part first."""
    size = max(np.abs(eigenvalues).max(initial=0.0), np.finfo(float).tiny)
    keys = (-eigenvalues.imag.round(12), eigenvalues.real, (np.abs(eigenvalues) / size).round(9))
    return np.asarray(eigenvalues[np.lexsort(keys)])


class Balance:
    """Forces of a scene in joint coordinates at poses that move steadily."""

    def __init__(self, scene: Scene, motion: Turning = REST, arithmetic: Arithmetic = EXTENDED):
        self.scene, self.motion, self.arithmetic = scene, motion, arithmetic
        self.equations = TreeEquations(scene, arithmetic)
        self.now = arithmetic.zeros(1)

    @property
    def sizes(self) -> np.ndarray:
        """Return the size (nv,) of each joint rate: the length of the mechanism, or one radian."""
        return np.where(self.equations.tree.turning, 1.0, self.equations.length)

    def start(self) -> np.ndarray:
        """Return the state (n,) of the scene's own pose. Raises SceneError and NotSteady."""
        return self.steady(self.equations.start())

    def closed(self, y: np.ndarray) -> np.ndarray:
        """Return the state (n,) with closed loops near a state. Raises NotSteady if there is none."""
        for _ in range(CLOSINGS):
            ask()
            y = self.equations.closed(self.now[0], y)
            if not np.isfinite(doubles(y)).all():
                break
            if self.equations.gap(self.now[0], y) < CLOSED:
                return y
        raise NotSteady("the loops do not close")

    def steady(self, y: np.ndarray) -> np.ndarray:
        """Return the state with the joint rates of the steady motion. Raises NotSteady."""
        y, begin = y.copy(), self.equations.ends[2]
        y[begin:] = self.arithmetic.zeros(self.equations.nv)
        if self.motion.rate == 0.0:
            return y
        placed = self.at(y[None]).placed
        wanted = self.motion.twists(doubles(placed.position[0, :-1])).ravel()
        twists = np.swapaxes(placed.columns[0, :-1], 1, 2).reshape(-1, self.equations.nv)
        for _ in range(3):
            left = doubles(wanted - twists @ y[begin:])
            y[begin:] = y[begin:] + np.linalg.lstsq(doubles(twists), left, rcond=RANK)[0]
        if np.abs(doubles(wanted - twists @ y[begin:])).max() > TURNS_AS_A_WHOLE * np.abs(wanted).max():
            raise NotSteady("the joints do not let the mechanism turn as a whole")
        return y

    def at(self, y: np.ndarray) -> Instant:
        """Return the parts of the equations at states (K, n) at t = 0."""
        return self.equations.at(np.repeat(self.now, len(y)), y)

    def rows(self, at: Instant) -> np.ndarray:
        """Return the independent constraint rows G (K, m, nv)."""
        return at.rows.jacobian[:, self.equations.kept]

    def forces(self, at: Instant) -> np.ndarray:
        """Return Q (K, nv)."""
        t = np.repeat(self.now, len(at.rate))
        return self.equations.loads.terms(at.placed, at.coordinates, at.rate, t, 0.0)[1]

    def basis(self, at: Instant) -> np.ndarray:
        """Return N (nv, f) at one state: unit displacements that the rows allow."""
        rows = self.rows(at)[0]
        scaled = doubles(rows) * self.sizes
        _, _, vectors = np.linalg.svd(scaled / (np.linalg.norm(scaled, axis=1, keepdims=True)))
        found = self.arithmetic.array(self.sizes[:, None] * vectors[len(rows) :].T)
        return found - np.linalg.pinv(doubles(rows)) @ (rows @ found)

    def conditioning(self, y: np.ndarray) -> float:
        """Return the least singular value of the independent rows, of unit length, / the largest one."""
        scaled = doubles(self.rows(self.at(y[None]))[0]) * self.sizes
        scaled = scaled / np.linalg.norm(scaled, axis=1, keepdims=True)
        values = np.linalg.svd(scaled, compute_uv=False)
        return float(values[-1] / values[0]) if len(values) else 1.0

    def unbalanced(self, y: np.ndarray) -> np.ndarray:
        """Return Nᵀ Q (f,), J, at a state (n,)."""
        at = self.at(y[None])
        return np.asarray(self.basis(at).T @ self.forces(at)[0])

    def multipliers(self, at: Instant) -> np.ndarray:
        """Return λ (m,) with Q + Gᵀ λ = 0 at a steady state."""
        rows, force = self.rows(at)[0], self.forces(at)[0]
        found = self.arithmetic.zeros(len(rows))
        for _ in range(3):
            left = doubles(-1 * force - rows.T @ found)
            found = found + np.linalg.lstsq(doubles(rows.T), left, rcond=None)[0]
        return found

    def moved(self, y: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Return the states (K, n) after displacements (K, nv) of the joint coordinates; rates stay."""
        states = np.repeat(y[None], len(step), axis=0)
        jacobian = np.repeat(self.at(y[None]).coordinates.jacobian, len(step), axis=0)
        found = self.equations.displaced(states, step, jacobian)
        found[:, self.equations.ends[2] :] = states[:, self.equations.ends[2] :]
        return found

    def between(self, y: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Return the displacement (nv,) of the joint coordinates from one state (n,) to another."""
        scalars, light = self.equations.tree.scalars, self.equations.light
        there, here = (state[scalars:light].reshape(-1, 4) for state in (end, y))
        turned = rotations.to_vector(rotations.multiply(there, rotations.conjugate(here)))
        return np.concatenate([end[:scalars] - y[:scalars], turned.ravel()])

    def stiffness(self, y: np.ndarray, basis: np.ndarray, h: float, order: int = 8) -> np.ndarray:
        """Return K N (nv, f) at a steady state."""
        multipliers = self.multipliers(self.at(y[None]))

        def pushed(step: np.ndarray) -> np.ndarray:
            at = self.at(self.moved(y, step))
            return self.forces(at) + apply(np.swapaxes(self.rows(at), 1, 2), multipliers[None])

        return -1 * _difference(pushed, basis, h, order)

    def damping(self, y: np.ndarray, basis: np.ndarray, h: float) -> np.ndarray:
        """Return C N (nv, f) at a steady state."""

        def pushed(step: np.ndarray) -> np.ndarray:
            states = np.repeat(y[None], len(step), axis=0)
            states[:, self.equations.ends[2] :] = states[:, self.equations.ends[2] :] + step
            return self.forces(self.at(states))

        return -1 * _difference(pushed, basis, h, 8)

    def small(self, y: np.ndarray, h: float = STEP) -> Small:
        """Return the matrices of small motions about a steady state (n,); raises SceneError where the motion
        is not linear."""
        at = self.at(y[None])
        basis = self.basis(at)
        aside = self.moved(y, PROBE * self.sizes.max() * basis.T)
        refuse_damped_meeting(self.scene, self.poses(y), [self.poses(each) for each in aside])
        mass = self.equations.loads.mass_matrix(at.placed, at.coordinates)[0]
        parts = mass @ basis, self.damping(y, basis, h), self.stiffness(y, basis, h)
        first, second, third = (doubles(basis.T @ part) for part in parts)
        return Small(first, second, third, doubles(basis), h)

    def poses(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return positions (nb, 3) and unit quaternions (nb, 4) of the bodies at a state."""
        placed = self.at(y[None]).placed
        given = unit(self.arithmetic.array([body.orientation for body in self.scene.body]))
        return doubles(placed.position[0, :-1]), doubles(product(placed.turn[0, :-1], given))


def in_doubles(balance: Balance) -> Balance:
    """Return equations of equal rows in double precision."""
    found = Balance(balance.scene, balance.motion, DOUBLE)
    found.equations.kept, found.equations.rank = balance.equations.kept, balance.equations.rank
    return found


def _difference(function, basis: np.ndarray, h: float, order: int) -> np.ndarray:  # type: ignore[no-untyped-def]
    """Return the derivatives (n, f) of a function (K, nv) -> (K, n) along the columns of the basis."""
    weights = CENTRAL if order == 8 else ((1, 1 / 2),)
    steps = [k * h * basis.T for k, _ in weights]
    values = function(np.concatenate([*steps, *(-1 * step for step in steps)]))
    ahead, back = (half.reshape(len(weights), *basis.T.shape[:1], -1) for half in np.split(values, 2))
    parts = [w * (ahead[n] - back[n]) / h for n, (_, w) in enumerate(weights)]
    return np.asarray(np.sum(parts, axis=0)).T
