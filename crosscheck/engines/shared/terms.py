"""Integration by crosscheck of the equations of motion whose terms an engine computes.

The engine gives the mass matrix M, the bias force h of gravity and velocities, and for every link its pose,
Jacobian and acceleration at v' = 0. Closures and drivers are additional rows J v' = γ, loads are wrenches on
the links, and

    M v' + h = τ + Jᵀ λ

is solved by least squares weighted with the mass matrix, so that redundant rows are allowed.  States are
integrated by DOP853 and projected onto the closures after every step, by the least kinetic energy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np
from scipy.linalg import solve_triangular

from crosscheck.engine import Setting
from crosscheck.engines.shared.driver_motion import motion, stated_rate
from crosscheck.engines.shared.geometry import cross_matrix
from crosscheck.engines.shared.initial_velocities import initial_rates
from crosscheck.engines.shared.joint_coordinates import JointCoordinates, rotation_vector
from crosscheck.engines.shared.least_change import REDUNDANT, least_change, root_of_mass
from crosscheck.engines.shared.sampling import Adaptive, Counts, Failed, Sample
from crosscheck.engines.shared.spanning_tree import GROUND_LINK, Tree
from crosscheck.engines.shared.tree_reactions import LinkMotion, applied, sample_of, wrench
from mbref import rotations
from mbref.motions.trajectory import Outcome
from mbref.rotations import cross
from mbref.scene import Scene

FAMILY = "terms"
ABOUT = "the engine's mass matrix, bias and Jacobians; DOP853, closures solved and projected by crosscheck"
OPTIONS = {"rtol": "relative tolerance of a step", "min_step": "shortest step, s"}
RTOLS = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11)
LEAST_TURN = 0.03  # rad turned within the shortest step
# rad; a driver moves by at most this in one step, since closures may change branch within larger ones
TURN_PER_STEP = 0.25
PROJECTIONS = 10  # largest number of Newton iterations; two are usual
CLOSED = 1e-13  # m and rad; residual at which a projection ends
CLOSED_ENOUGH = 1e-8  # m and rad; largest residual of a result


ROUNDED = 1e-13  # entry of a closure's row / largest entry of its two ends; smaller entries are rounding


class Terms(NamedTuple):
    """An engine's terms at a state, velocities in the tree's order.

    For every link they contain the rotation since t = 0 (n, 3, 3) and position (n, 3) of its frame in the
    world, the Jacobian (n, 6, nv) of its velocity and angular velocity, and its accelerations (n, 6) at v' =
    0.
    """

    mass: np.ndarray
    bias: np.ndarray
    rotation: np.ndarray
    position: np.ndarray
    jacobian: np.ndarray
    drift: np.ndarray


class Mechanism(Protocol):
    """Interface of a scene's tree in an engine."""

    scene: Scene
    tree: Tree
    coordinates: JointCoordinates

    def terms(self, q: np.ndarray, v: np.ndarray) -> Terms:
        """Return the engine's terms at positions (nq,) and velocities (nv,)."""


def _unrounded(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the rows ``second`` - ``first`` (n, nv), with zeros for rounding: a closure that the tree
    satisfies anyway, such as a duplicate joint, has rows of zeros, which the least squares leave out."""
    rows = second - first
    rows[np.abs(rows) < ROUNDED * max(np.abs(first).max(), np.abs(second).max())] = 0.0
    return rows


def sweep(rate: float) -> list[Setting]:
    """Return settings by relative tolerance for a scene that turns at a rate (rad/s)."""
    shortest = float(f"{LEAST_TURN / rate:.2g}")
    return [Setting(FAMILY, {"rtol": rtol, "min_step": shortest}) for rtol in RTOLS]


@dataclass(frozen=True)
class _Rows:
    """Closures at a state: residuals (m,), m and rad, Jacobian (m, nv), accelerations (m,) at v' = 0, and
    positions (world) of the closures' second anchors."""

    residual: np.ndarray
    jacobian: np.ndarray
    drift: np.ndarray
    places: Sequence[np.ndarray]


class Simulation:
    """One simulation of a mechanism at a setting of FAMILY."""

    def __init__(self, mechanism: Mechanism, setting: Setting):
        self.mechanism, self.scene, self.tree = mechanism, mechanism.scene, mechanism.tree
        self.at = mechanism.coordinates
        self.counts = Counts()
        self.driven = self.tree.driven(self.scene)
        places = dict(zip(self.at.single.tolist(), self.at.single_q.tolist(), strict=True))
        self.driven_q = [places[i] for i, _ in self.driven]
        self.free = np.setdiff1d(np.arange(self.at.nv), [i for i, _ in self.driven])
        self.coupled = self._couplings()
        self.rotors = self._rotors()
        self.y = np.concatenate([self.at.start(), initial_rates(self.scene, self.tree)])
        longest = TURN_PER_STEP / stated_rate(self.scene) if self.driven else np.inf
        limits = setting.options["rtol"], setting.options["min_step"], longest
        self.integrator = Adaptive(self.rates, self.settled, *limits, self.counts)

    def _couplings(self) -> np.ndarray:
        """Rows J (couplings, nv) of Σ factor · q = 0."""
        rows = np.zeros((len(self.scene.coupling), self.at.nv))
        for row, coupling in zip(rows, self.scene.coupling, strict=True):
            for factor, i in zip(coupling.factors, self.tree.coupled(self.scene, coupling), strict=True):
                row[i] += factor
        return rows

    def _rotors(self) -> np.ndarray:
        """Diagonal matrix (nv, nv) of the armatures."""
        found = np.zeros(self.at.nv)
        for i, inertia in self.tree.armatures(self.scene):
            found[i] = inertia
        return np.diag(found)

    def _terms(self, q: np.ndarray, v: np.ndarray) -> Terms:
        """Return the engine's terms, with the armatures in the mass matrix."""
        found = self.mechanism.terms(q, v)
        return found._replace(mass=found.mass + self.rotors)

    def advance(self, t0: float, t1: float) -> None:
        """Move the state from t0 to t1; raises Failed."""
        self.y = self.integrator.advance(self.y, t0, t1)

    def split(self, t: float, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return positions and velocities of a state; driven coordinates are as prescribed at t, quaternions
        have length 1."""
        q, v = self.at.normalised(y[: self.at.nq]), y[self.at.nq :]
        if self.driven:
            q, v = q.copy(), v.copy()
            for (i, driver), iq in zip(self.driven, self.driven_q, strict=True):
                q[iq], v[i], _ = motion(driver, t)
        return q, v

    def rates(self, t: float, y: np.ndarray) -> np.ndarray:
        """Return the rates (nq + nv,) of a state."""
        q, v = self.split(t, y)
        return np.concatenate([self.at.rates(q, v), self.accelerations(t, q, v)[0]])

    def accelerations(
        self, t: float, q: np.ndarray, v: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, LinkMotion, _Rows]:
        """Return v' (nv,), the closures' forces λ (m,), the links' motion with these accelerations, and the
        rows."""
        terms = self._terms(q, v)
        motion_now, rows = self._motion(t, terms, q, v), self._rows(terms, q, v)
        a = np.zeros(self.at.nv)
        for i, driver in self.driven:
            a[i] = motion(driver, t)[2]
        acting = self._forces(terms, motion_now) - terms.bias - terms.mass @ a
        gamma = -rows.drift - rows.jacobian @ a
        root = self._root(t, terms)
        for what, values in (("forces", acting), ("closures", rows.jacobian)):
            if not np.isfinite(values).all():
                raise Failed(Outcome.NOT_FINITE, t, f"the {what} are not finite at {t:.6g} s")
        pushed = solve_triangular(root, acting[self.free], lower=True)
        spread = solve_triangular(root, rows.jacobian[:, self.free].T, lower=True).T
        held = np.linalg.lstsq(spread, gamma - spread @ pushed, rcond=REDUNDANT)[0]
        a[self.free] = solve_triangular(root, pushed + held, lower=True, trans="T")
        multipliers = np.linalg.lstsq(spread.T, held, rcond=REDUNDANT)[0]
        return a, multipliers, self._accelerated(terms, motion_now, a), rows

    def settled(self, t: float, y: np.ndarray) -> np.ndarray:
        """Return the state nearest to y, measured by kinetic energy, that satisfies closures and drivers;
        raises Failed."""
        q, v = self.split(t, y)
        if not (self.tree.closures or self.scene.coupling):
            return np.concatenate([q, v])
        terms = self._terms(q, v)
        root = self._root(t, terms)
        for _ in range(PROJECTIONS):
            rows = self._rows(terms, q, v)
            if not abs(rows.residual).max() > CLOSED:
                break
            q = self.at.moved(q, self._least(t, root, rows.jacobian, -rows.residual))
            terms = self._terms(q, v)
        if not abs(rows.residual).max() < CLOSED_ENOUGH:
            raise Failed(Outcome.NOT_CONVERGED, t, f"the closures could not be met at {t:.6g} s")
        return np.concatenate([q, v - self._least(t, root, rows.jacobian, rows.jacobian @ v)])

    def sample(self, t: float) -> Sample:
        """Return poses, velocities, accelerations and reactions."""
        q, v = self.split(t, self.y)
        _, multipliers, moved, rows = self.accelerations(t, q, v)
        return sample_of(self.scene, self.tree, moved, self._closing(multipliers, rows))

    def _closing(self, multipliers: np.ndarray, rows: _Rows) -> list[np.ndarray]:
        """Return, for each closure, the wrench on its second link about the world's origin."""
        found, start = [], 0
        for closure, place in zip(self.tree.closures, rows.places, strict=True):
            force = multipliers[start : start + 3]
            start += 3
            moment = np.zeros(3)
            if closure.kind == "weld":
                moment = multipliers[start : start + 3]
                start += 3
            found.append(wrench(force, place, moment))
        return found

    def _motion(self, t: float, terms: Terms, q: np.ndarray, v: np.ndarray) -> LinkMotion:
        twists = terms.jacobian @ v
        return LinkMotion(
            terms.rotation,
            terms.position,
            twists[:, :3],
            twists[:, 3:],
            self.at.of_velocities(q),
            v,
            time=t,
        )

    def _accelerated(self, terms: Terms, of: LinkMotion, a: np.ndarray) -> LinkMotion:
        change = terms.jacobian @ a + terms.drift
        return replace(of, acceleration=change[:, :3], angular_acceleration=change[:, 3:])

    def _forces(self, terms: Terms, of: LinkMotion) -> np.ndarray:
        """Return generalised forces (nv,) of the loads."""
        tau = np.zeros(self.at.nv)
        for link, force, moment in applied(self.scene, self.tree, of):
            tau += terms.jacobian[link].T @ np.concatenate([force, moment])
        return tau

    def _rows(self, terms: Terms, q: np.ndarray, v: np.ndarray) -> _Rows:
        """Return the rows of the closures, then of the couplings."""
        residual, jacobian, drift, places = [np.zeros(0)], [np.zeros((0, self.at.nv))], [np.zeros(0)], []
        for closure in self.tree.closures:
            first, second = (self._end(terms, v, link, closure.anchor) for link in closure.links)
            n = 3 if closure.kind == "point" else 6
            gap = second[0] - first[0]
            if n == 6:
                turned = self._rotation(terms, closure.links[1]) @ self._rotation(terms, closure.links[0]).T
                gap = np.concatenate([gap, rotation_vector(rotations.from_matrix(turned))])
            residual.append(gap)
            jacobian.append(_unrounded(first[1][:n], second[1][:n]))
            drift.append((second[2] - first[2])[:n])
            places.append(second[0])
        residual.append(self.coupled @ self.at.of_velocities(q))
        jacobian.append(self.coupled)
        drift.append(np.zeros(len(self.coupled)))
        return _Rows(np.concatenate(residual), np.vstack(jacobian), np.concatenate(drift), places)

    def _rotation(self, terms: Terms, link: int) -> np.ndarray:
        return np.eye(3) if link == GROUND_LINK else terms.rotation[link]

    def _end(
        self, terms: Terms, v: np.ndarray, link: int, anchor: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the position (3,) of a point of a link, its Jacobian (6, nv), and its accelerations (6,) at
        v' = 0."""
        if link == GROUND_LINK:
            return anchor, np.zeros((6, self.at.nv)), np.zeros(6)
        arm = terms.rotation[link] @ (anchor - self.tree.links[link].position)
        jacobian, drift = terms.jacobian[link].copy(), terms.drift[link].copy()
        omega = jacobian[3:] @ v
        jacobian[:3] -= cross_matrix(arm) @ jacobian[3:]
        drift[:3] += cross(drift[3:], arm) + cross(omega, cross(omega, arm))
        return terms.position[link] + arm, jacobian, drift

    def _root(self, t: float, terms: Terms) -> np.ndarray:
        """Return the lower Cholesky factor of the mass matrix of the coordinates that are not driven."""
        return root_of_mass(terms.mass[np.ix_(self.free, self.free)], t)

    def _least(self, t: float, root: np.ndarray, jacobian: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """Return the change (nv,) of least kinetic energy, zero in driven coordinates, for which the rows
        have the wanted values."""
        change = np.zeros(self.at.nv)
        change[self.free] = least_change(root, jacobian[:, self.free], wanted, t)
        return change
