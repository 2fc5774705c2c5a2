"""One body without joints: Newton and Euler, with position, momentum, quaternion, angular momentum as state.

Angular momentum is a state in the world frame, so that it is constant to rounding when no moment acts.
"""

from __future__ import annotations

import numpy as np

from crosscheck.judge.constraints import inertia_matrices, scene_length
from crosscheck.judge.loads import Motion, cross, wrenches
from crosscheck.judge.tolerances import TRUTH_DYNAMIC
from crosscheck.judge.truth.one_dof import trajectory
from crosscheck.judge.truth.picard import REAL, Solution
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene, TorsionSpring

NO_TURN = np.zeros(3)


class FreeBody:
    """Truth of a scene with one free body under gravity, forces, moments and springs to the ground."""

    name = "free_body"
    accuracy = TRUTH_DYNAMIC

    def __init__(self, scene: Scene):
        body = scene.body[0]
        self._scene, self._mass = scene, body.mass
        moments, axes = np.linalg.eigh(inertia_matrices(scene)[0].astype(float))
        self._moments, self._axes = moments.astype(REAL), axes
        q = np.array(body.orientation, dtype=REAL)
        q /= np.sqrt(np.sum(q * q))
        spin = np.array(body.angular_velocity or (0.0,) * 3, dtype=REAL)
        velocity = np.array(body.velocity or (0.0,) * 3, dtype=REAL)
        angular = (self._inertia(_matrix(q[None])) @ spin)[0]
        start = np.concatenate([np.array(body.position, dtype=REAL), velocity, q, angular])
        pace = float(np.sqrt(np.sum(spin * spin)) + np.sqrt(np.sum(velocity**2)) / scene_length(scene))
        self._solution = Solution(self._derivative, start, 0.5 / (pace + 1 / scene.duration))

    def poses(self, times: np.ndarray) -> Trajectory:
        """Return the trajectory at times (k,) ≥ 0."""
        times = np.asarray(times, dtype=float)
        state = self._solution(times)
        motion, force, moment = self._loaded(state)
        momentum = state[:, 10:13]
        spin = motion.angular_velocity[:, 0]
        rate = self._spin_of(motion.rotation[:, 0], moment[:, 0] - cross(spin, momentum))
        return trajectory(
            self._scene,
            self.name,
            times,
            motion.position,
            motion.rotation,
            (motion.velocity, motion.angular_velocity),
            (force / self._mass, rate[:, None]),
        )

    def _derivative(self, state: np.ndarray) -> np.ndarray:
        motion, force, moment = self._loaded(state)
        w, q = motion.angular_velocity[:, 0], state[:, 6:10]
        scalar = -np.sum(w * q[:, 1:], axis=1, keepdims=True)
        turning = np.concatenate([scalar, w * q[:, :1] + cross(w, q[:, 1:])], axis=1) / 2
        return np.concatenate([state[:, 3:6], force[:, 0] / self._mass, turning, moment[:, 0]], axis=1)

    def _loaded(self, state: np.ndarray) -> tuple[Motion, np.ndarray, np.ndarray]:
        rotation = _matrix(state[:, 6:10])
        spin = self._spin_of(rotation, state[:, 10:13])
        motion = Motion(
            state[:, None, :3], rotation[:, None], state[:, None, 3:6], spin[:, None], state[:, :1] * np.nan
        )
        return motion, *wrenches(self._scene, motion, NO_TURN)

    def _inertia(self, rotation: np.ndarray) -> np.ndarray:
        principal = rotation @ self._axes
        return (principal * self._moments) @ np.swapaxes(principal, -1, -2)

    def _spin_of(self, rotation: np.ndarray, momentum: np.ndarray) -> np.ndarray:
        """Return the inverse inertia times vectors (k, 3), world."""
        principal = rotation @ self._axes
        local = np.einsum("kij,ki->kj", principal, momentum) / self._moments
        return np.einsum("kij,kj->ki", principal, local)


def free_body(scene: Scene) -> FreeBody | None:
    """Return the truth of a scene with one free body that has mass and three positive principal moments, or
    None."""
    if len(scene.body) != 1 or scene.joint or not scene.has_mass():
        return None
    if any(isinstance(load, TorsionSpring) for load in scene.load):
        return None
    moments = np.linalg.eigvalsh(inertia_matrices(scene)[0])
    return FreeBody(scene) if moments[0] > 1e-9 * moments[2] else None


def _matrix(q: np.ndarray) -> np.ndarray:
    """Return rotation matrices (k, 3, 3) of quaternions (k, 4) of nearly unit length, in their precision."""
    w, x, y, z = (q / np.sqrt(np.sum(q * q, axis=1, keepdims=True))).T
    rows = [
        [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]
    return np.moveaxis(np.array(rows), -1, 0)
