"""States near a scene's start along displacements that joints allow, with terms of the equations of motion.

The rule of the tangent stands in ``judge/state_derivatives.py``; the terms are joint equations, masses and
forces at given states.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from crosscheck.derivatives.compare import derivative
from crosscheck.judge.constraints import (
    closure_accelerations,
    initial_poses,
    initial_twists,
    jacobian,
)
from crosscheck.judge.gauss_motion import accelerations
from crosscheck.judge.joint_loads import applied
from crosscheck.judge.loads import mass_matrix, world_inertia
from mbref import rotations
from mbref.scene import Scene

ORDERED = 1e-10  # smaller singular values of the rows, of the largest one, are rounding
STEP = 2e-3  # m or rad, of differences of order 8
NO_ANGLES = np.zeros(0)


class Tangent(NamedTuple):
    """Allowed displacements N (6 nb, f) and the changes of twists (6 nb, f) along them, by the rule."""

    basis: np.ndarray
    carried: np.ndarray


@functools.lru_cache(maxsize=32)
def tangent(scene: Scene) -> Tangent:
    """Return the allowed displacements at a scene's start: J N = 0, and the least δv with J δv = -δJ v."""
    state = State(scene)
    rows = state.rows()
    _, values, right = np.linalg.svd(rows)
    rank = int(np.sum(values > ORDERED * values.max(initial=0.0)))
    basis = right[rank:].T
    carried = []
    for along in basis.T:
        gap = slope(lambda s, along=along: state.moved(s * along).rows() @ state.twist)  # type: ignore[misc]
        carried.append(-state.lifted(rows, gap))
    return Tangent(basis, np.array(carried).reshape(basis.shape[::-1]).T)


class State(NamedTuple):
    """A state of a scene: twists and accelerations (6 nb,), world; by default of the start."""

    scene: Scene
    place: np.ndarray | None = None
    rate: np.ndarray | None = None

    @property
    def pose(self) -> tuple[np.ndarray, np.ndarray]:
        position, orientation = initial_poses(self.scene)
        if self.place is None:
            return position, orientation
        moves = self.place.reshape(-1, 6)
        return position + moves[:, :3], rotations.multiply(rotations.from_vector(moves[:, 3:]), orientation)

    @property
    def twist(self) -> np.ndarray:
        return np.hstack(initial_twists(self.scene)).ravel() if self.rate is None else self.rate

    def moved(self, place: np.ndarray, rate: np.ndarray | None = None) -> State:
        """Return the state displaced by ``place`` along twists, with twists changed by ``rate`` (6 nb,)."""
        return State(self.scene, place, self.twist if rate is None else self.twist + rate)

    def rows(self) -> np.ndarray:
        """Return the rows (m, 6 nb) of joints and couplings."""
        return jacobian(self.scene, 0.0, *self.pose)[0]

    def closing(self, acceleration: np.ndarray) -> np.ndarray:
        """Return J a + J̇ v (m,)."""
        parts = [x.reshape(-1, 2, 3) for x in (self.twist, acceleration)]
        rates = [part[:, k] for part in parts for k in (0, 1)]
        found = closure_accelerations(self.scene, 0.0, *self.pose, *rates)
        return np.concatenate([np.zeros(0), *found.values()])

    def masses(self) -> np.ndarray:
        """Return the mass matrix (6 nb, 6 nb) at the centres of mass, world."""
        inertia = world_inertia(self.scene, rotations.to_matrix(self.pose[1]))
        return mass_matrix(self.scene, inertia)

    def lacking(self, acceleration: np.ndarray) -> np.ndarray:
        """Return M a - f (6 nb,), the forces of joints, of which f has gravity and gyroscopic moments."""
        twists = self.twist.reshape(-1, 6)
        state = (*self.pose, twists[:, :3], twists[:, 3:], NO_ANGLES)
        return self.masses() @ acceleration - applied(self.scene, 0.0, state).ravel()

    def lifted(self, rows: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """Return the least x (6 nb,) in the metric of the masses with J x = wanted."""
        root = np.linalg.cholesky(self.masses())
        spread = np.linalg.solve(root, rows.T).T
        return np.linalg.solve(root.T, np.linalg.lstsq(spread, wanted, rcond=ORDERED)[0])

    def acceleration(self) -> np.ndarray:
        """Return the accelerations (6 nb,) by Gauss's principle."""
        twists = self.twist.reshape(-1, 6)
        return accelerations(self.scene, 0.0, (*self.pose, twists[:, :3], twists[:, 3:], NO_ANGLES)).ravel()


def slope(function: Callable[[float], np.ndarray]) -> np.ndarray:
    """Return the derivative of a function of a displacement (rad or m) at 0, by differences of order 8."""
    return derivative(lambda s: function(float(s[0])), np.array([STEP])) / STEP
