"""Rotation of a whole mechanism with its driver: the frame in which a steady motion is at rest."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mbref import rotations
from mbref.equations.model import Model
from mbref.scene import GROUND, Body, Scene, SceneError

PARALLEL_TO_GRAVITY = 1e-12  # sine of the angle between gravity and the driver's axis
TURNED_BY = 1.0  # rad; rotation after which the equations are compared with the start
UNCHANGED = 1e-9  # largest change of accelerations / scale of accelerations, and of |Φ| / mechanism's length


class Turning(NamedTuple):
    """Frame that turns with a driver: angular velocity (3,) rad/s, a point (3,) of its axis, the driver's
    joint and its armature (kg m²)."""

    spin: np.ndarray
    point: np.ndarray
    joint: str
    armature: float = 0.0

    @property
    def rate(self) -> float:
        """Angular speed, rad/s; zero at rest."""
        return float(np.linalg.norm(self.spin))

    def velocities(self, model: Model, q: np.ndarray) -> np.ndarray:
        """Return the velocities (n,) of bodies at rest in the frame: r' in the world, ω' along body axes."""
        found = np.zeros((model.nb, 6))
        if not self.rate:
            return found.ravel()
        position, orientation = _poses(model, q)
        count = len(position)
        found[:count, :3] = np.cross(self.spin, position - self.point)
        found[:count, 3:] = rotations.rotate(rotations.conjugate(orientation), self.spin)
        return found.ravel()

    def relative(self, model: Model, q: np.ndarray, rate: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the accelerations (n,) in the frame, for velocities ``rate`` (n,) in the frame and
        accelerations ``a`` (n,).

        r'' - 2 Ω × r' - Ω × (Ω × r) for positions, and ω̇' + ω' × Ω along body axes for orientations.
        """
        if not self.rate:
            return a
        position, orientation = _poses(model, q)
        found, moved = a.reshape(model.nb, 6).copy(), rate.reshape(model.nb, 6)[: len(position)]
        inwards = np.cross(self.spin, np.cross(self.spin, position - self.point))
        found[: len(position), :3] -= 2 * np.cross(self.spin, moved[:, :3]) + inwards
        along = rotations.rotate(rotations.conjugate(orientation), self.spin)
        found[: len(position), 3:] += np.cross(moved[:, 3:], along)
        return found.ravel()

    def turned(self, model: Model, q: np.ndarray, angle: float) -> np.ndarray:
        """Return the coordinates (7 nb,) after a rotation of the mechanism by an angle (rad)."""
        half = self._quaternion(angle)
        found, count = q.reshape(model.nb, 7).copy(), len(model.scene.body)
        found[:count, :3] = self.point + rotations.rotate(half, found[:count, :3] - self.point)
        found[:count, 3:] = rotations.multiply(half, found[:count, 3:])
        return found.ravel()

    def turned_rates(self, model: Model, v: np.ndarray, angle: float) -> np.ndarray:
        """Return velocities or accelerations (n,) after a rotation; angular ones are along body axes."""
        found, count = v.reshape(model.nb, 6).copy(), len(model.scene.body)
        found[:count, :3] = rotations.rotate(self._quaternion(angle), found[:count, :3])
        return found.ravel()

    def _quaternion(self, angle: float) -> np.ndarray:
        """Return the unit quaternion (4,) of a rotation by an angle (rad) about the axis."""
        return rotations.from_vector(angle * self.spin / self.rate)

    def with_armature(self, scene: Scene, armature: float) -> Scene:
        """Return the scene with another armature of the driver's joint.

        At a constant rate the armature has no effect. Without it the model has no rotor, which would not turn
        as the bodies do.
        """
        change = {"armature": armature}
        joints = [j.model_copy(update=change) if j.name == self.joint else j for j in scene.joint]
        return scene.with_(joint=joints) if self.armature else scene

    def bodies(self, scene: Scene) -> list[Body]:
        """Return the bodies of a scene with the velocities of the turning mechanism; without ones at rest."""
        if not self.rate:
            none = {"velocity": None, "angular_velocity": None}
            return [body.model_copy(update=none) for body in scene.body]
        spin = tuple(self.spin.tolist())
        velocities = [tuple(np.cross(self.spin, body.position - self.point).tolist()) for body in scene.body]
        return [
            body.model_copy(update={"velocity": velocity, "angular_velocity": spin})
            for body, velocity in zip(scene.body, velocities, strict=True)
        ]


def _poses(model: Model, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return positions (nb, 3) and quaternions (nb, 4) of the scene's bodies, without a ground body."""
    position, orientation = np.split(q.reshape(model.nb, 7)[: len(model.scene.body)], [3], axis=1)
    return position, orientation


def turning(scene: Scene) -> Turning:
    """Return the frame in which a steady motion of the scene is at rest.

    Raises
    ------
    SceneError
        If a driver moves otherwise than at a constant rate about an axis that is fixed to the ground and
        parallel to gravity, or several drivers move.
    """
    moving = [driver for driver in scene.driver if not driver.is_constant]
    if not moving:
        return Turning(np.zeros(3), np.zeros(3), "")
    driver, joint = moving[0], scene.joint_named(moving[0].joint)
    is_constant = driver.is_polynomial and not any(driver.polynomial[2:])
    if len(moving) > 1 or not is_constant or joint.facts.driven != "angle" or GROUND not in joint.bodies:
        raise SceneError(
            [
                f"driver[{driver.joint}]: moves; needed are drivers that stand still, or one that turns a "
                "body relative to the ground at a constant rate"
            ]
        )
    axis = rotations.unit(joint.directions[0])
    if np.linalg.norm(np.cross(scene.gravity, axis)) > PARALLEL_TO_GRAVITY * np.linalg.norm(scene.gravity):
        raise SceneError(
            [f"driver[{driver.joint}]: its axis is not parallel to gravity, so the motion is not steady"]
        )
    sign = 1.0 if joint.bodies[0] == GROUND else -1.0
    spin, point = sign * driver.polynomial[1] * axis, np.array(joint.anchor_pair[0])
    return Turning(spin, point, driver.joint, joint.reflected_inertia)
