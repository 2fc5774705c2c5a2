"""Inertia and loads of a scene in the joint coordinates of its tree, by d'Alembert's principle.

A body's part of the mass matrix is columnᵀ · inertia · column and its part of the generalised force is
columnᵀ · (load - inertia · drift); a load of a joint works on the joint's coordinate alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from crosscheck.judge.constraints import inertia_matrices
from crosscheck.judge.reference.tree_closures import Rows
from crosscheck.judge.reference.tree_joints import Placed, Tree
from crosscheck.judge.reference.vectors import apply, cross, dot, matrices, unit
from crosscheck.judge.time_functions import values
from mbref.scene import Force, JointLoad, Moment, PointDamper, RotationalDamper, Spring


class Loads:
    """Masses, inertias, armatures, gravity and loads as arrays; ``measured`` has the rows of joint
    coordinates by kind and joint.

    In a scene without masses, loads are left out, and masses and inertias are 1: drivers determine the
    motion, so these values have no influence.
    """

    def __init__(self, tree: Tree, measured: dict[tuple[str, str], int]):
        scene, numbers = tree.scene, tree.arithmetic
        massive = scene.has_mass()
        self.tree, self.gravity = tree, numbers.array(scene.gravity)
        self.mass = numbers.array([b.mass if massive else 1.0 for b in scene.body])[:, None]
        self.inertia = _inertias(tree) if massive else numbers.array([np.eye(3)] * len(scene.body))
        of: dict[type, list[Any]] = {
            kind: [l for l in scene.load if massive and isinstance(l, kind)] for kind in LOADS
        }
        self.moments, self.forces, self.springs = of[Moment], of[Force], of[Spring]
        self.along, self.turners, self.dampers = of[JointLoad], of[RotationalDamper], of[PointDamper]
        self.acting = np.array([measured[load.coordinate, load.joint] for load in self.along], dtype=int)
        numbers_of = numbers.array([load.action for load in self.along]).reshape(-1, 4)
        self.stiffness, self.damping, self.natural, self.amount = numbers_of.T
        geared = [joint for joint in scene.joint if massive and joint.reflected_inertia]
        self.geared = np.array([measured[str(j.facts.driven), j.name] for j in geared], dtype=int)
        self.armature = numbers.array([joint.reflected_inertia for joint in geared])

    def mass_matrix(self, placed: Placed, coordinates: Rows) -> np.ndarray:
        """Return the mass matrix (K, nv, nv)."""
        return self._mass_matrix(placed, coordinates, self._world_inertia(placed))

    def momentum(
        self, placed: Placed, coordinates: Rows, twists: np.ndarray, rates: np.ndarray
    ) -> np.ndarray:
        """Return the generalised momenta (K, nv) of any twists (6 nb,) of the bodies, and rates (g,) of the
        coordinates with armatures."""
        parts = twists.reshape(-1, 6)
        turning = apply(self._world_inertia(placed), parts[:, 3:])
        sliding = self.mass * parts[:, :3] + 0 * turning
        wrench = self._with_ground(np.concatenate([sliding, turning], axis=-1))
        found = self._project(placed, wrench)
        if not len(self.geared):
            return found
        rows = np.swapaxes(coordinates.jacobian[:, self.geared], 1, 2)
        return found + apply(rows, self.armature * rates)

    def terms(
        self, placed: Placed, coordinates: Rows, rate: np.ndarray, t: np.ndarray, since: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the mass matrix, and forces (K, nv) of loads minus inertia forces without joint
        accelerations.  Functions of time are at times t (K,), of the piece that acts from ``since`` (s) on.
        """
        spin, inertia = placed.spin[:, :-1], self._world_inertia(placed)
        turning = cross(spin, apply(inertia, spin)) + apply(inertia, placed.spin_drift[:, :-1])
        force = self.mass * (self.gravity - placed.drift[:, :-1])
        wrench = self._with_ground(np.concatenate([force, -1 * turning], axis=-1))
        self._act(placed, wrench, t, since)
        total = self._project(placed, wrench)
        if len(self.acting):
            jacobian = coordinates.jacobian[:, self.acting]
            acting = -1 * self.stiffness * (coordinates.value[:, self.acting] - self.natural)
            acting = acting - self.damping * apply(jacobian, rate)
            factors = [self._factor(load, t, since) for load in self.along]
            acting = acting + self.amount * np.stack(factors, axis=1)
            total = total + apply(np.swapaxes(jacobian, 1, 2), acting)
        if len(self.geared):
            turned = coordinates.among(self.geared)
            total = total - apply(np.swapaxes(turned.jacobian, 1, 2), self.armature * turned.drift)
        return self._mass_matrix(placed, coordinates, inertia), total

    @staticmethod
    def _with_ground(wrench: np.ndarray) -> np.ndarray:
        """Return wrenches with a row of zeros for the ground."""
        return np.concatenate([wrench, 0 * wrench[:, :1]], axis=1)

    @staticmethod
    def _project(placed: Placed, wrench: np.ndarray) -> np.ndarray:
        """Return the generalised force (K, nv) of wrenches (K, nb + 1, 6)."""
        return apply(_over_bodies(placed.columns), wrench.reshape(len(wrench), -1))

    def _mass_matrix(self, placed: Placed, coordinates: Rows, inertia: np.ndarray) -> np.ndarray:
        columns = placed.columns[:, :-1]
        turning = columns[..., 3:] @ inertia
        momenta = np.concatenate([self.mass[..., None] * columns[..., :3], turning], axis=-1)
        found = _over_bodies(momenta) @ np.swapaxes(_over_bodies(columns), 1, 2)
        if not len(self.geared):
            return found
        rows = coordinates.jacobian[:, self.geared]
        return found + np.swapaxes(rows, 1, 2) @ (self.armature[:, None] * rows)

    def _factor(self, load: Any, t: np.ndarray, since: float) -> np.ndarray:
        """Return the function of time (K,) that multiplies a load, at times t (K,)."""
        if load.over_time is None:
            return 0 * t + 1
        return values(load.over_time, t, since, arithmetic=self.tree.arithmetic)

    def _act(self, placed: Placed, wrench: np.ndarray, t: np.ndarray, since: float) -> None:
        """Add the loads: forces at points of bodies, and moments."""
        scene = self.tree.scene
        for load in self.moments:
            body = scene.body_index(load.body)
            factor = self._factor(load, t, since)[:, None]
            wrench[:, body, 3:] = wrench[:, body, 3:] + factor * self.tree.arithmetic.array(load.moment)
        for load in self.forces:
            body = scene.body_index(load.body)
            arm, _, _ = self._point(placed, body, load.point)
            factor = self._factor(load, t, since)[:, None]
            _push(wrench, body, arm, factor * self.tree.arithmetic.array(load.force))
        for load in self.springs:
            self._pull(placed, load, wrench)
        for load in self.turners:
            first, second = (scene.body_index(name) for name in load.bodies)
            apart = placed.spin[:, second] - placed.spin[:, first]
            moment = self.tree.arithmetic.number(load.damping) * apart
            wrench[:, first, 3:] = wrench[:, first, 3:] + moment
            wrench[:, second, 3:] = wrench[:, second, 3:] - moment
        for load in self.dampers:
            first, second = (scene.body_index(name) for name in load.bodies)
            arm, place, rate = self._point(placed, second, load.point)
            lever = place - placed.position[:, first]
            rate = rate - placed.velocity[:, first] - cross(placed.spin[:, first], lever)
            force = self.tree.arithmetic.number(load.damping) * rate
            _push(wrench, first, lever, force)
            _push(wrench, second, arm, -1 * force)

    def _pull(self, placed: Placed, load: Spring, wrench: np.ndarray) -> None:
        pair = [self.tree.scene.body_index(name) for name in load.bodies]
        ends = [self._point(placed, body, point) for body, point in zip(pair, load.points, strict=True)]
        offset, rate = ends[1][1] - ends[0][1], ends[1][2] - ends[0][2]
        apart = np.where(
            dot(offset, offset)[:, None] > 0, offset, rate
        )  # ends that meet part along their rate
        length = np.sqrt(dot(apart, apart))[:, None]
        direction = apart / np.where(length > 0, length, 1)
        stiffness, damping, natural = self.tree.arithmetic.array(
            (load.stiffness, load.damping, load.natural_length)
        )
        size = stiffness * (dot(direction, offset) - natural) + damping * dot(direction, rate)
        for body, end, sign in zip(pair, ends, (1, -1), strict=True):
            _push(wrench, body, end[0], sign * size[:, None] * direction)

    def _point(
        self, placed: Placed, body: int, point: Sequence[float]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return vector from the centre, position and velocity (K, 3) of a body-fixed point, given in the
        world at t = 0."""
        arm = apply(placed.rotation[:, body], self.tree.arithmetic.array(point) - self.tree.start[body])
        return (
            arm,
            placed.position[:, body] + arm,
            placed.velocity[:, body] + cross(placed.spin[:, body], arm),
        )

    def _world_inertia(self, placed: Placed) -> np.ndarray:
        rotation = placed.rotation[:, :-1]
        return rotation @ self.inertia @ np.swapaxes(rotation, -1, -2)


LOADS = (Moment, Force, Spring, JointLoad, RotationalDamper, PointDamper)


def _over_bodies(columns: np.ndarray) -> np.ndarray:
    """Return (K, nv, bodies · 6) from columns (K, bodies, nv, 6)."""
    samples, bodies, rates, _ = columns.shape
    return np.swapaxes(columns, 1, 2).reshape(samples, rates, 6 * bodies)


def _push(wrench: np.ndarray, body: int, arm: np.ndarray, force: np.ndarray) -> None:
    wrench[:, body, :3] = wrench[:, body, :3] + force
    wrench[:, body, 3:] = wrench[:, body, 3:] + cross(arm, force)


def _inertias(tree: Tree) -> np.ndarray:
    """Return inertia matrices (nb, 3, 3) along the world's axes at t = 0."""
    scene, numbers = tree.scene, tree.arithmetic
    frames = matrices(unit(numbers.array([b.orientation for b in scene.body])))
    return frames @ numbers.array(inertia_matrices(scene)) @ np.swapaxes(frames, -1, -2)
