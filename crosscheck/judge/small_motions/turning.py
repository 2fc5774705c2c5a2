"""Steady motion of a scene: rest, or rotation of the whole mechanism with its driver at a constant rate."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from crosscheck.judge.joint_residuals import joint_frames
from mbref import rotations
from mbref.scene import GROUND, Scene, SceneError

PARALLEL = 1e-12  # sine of the angle between gravity and the driver's axis


class Turning(NamedTuple):
    """Angular velocity (3,) rad/s of a mechanism as a whole, and a point (3,) of its axis, world."""

    spin: np.ndarray
    point: np.ndarray

    @property
    def rate(self) -> float:
        """Return the rate, rad/s; zero at rest."""
        return float(np.linalg.norm(self.spin))

    def twists(self, position: np.ndarray) -> np.ndarray:
        """Return velocity and angular velocity (nb, 6) of bodies at positions (nb, 3)."""
        velocity = np.cross(self.spin, position - self.point)
        return np.hstack([velocity, np.broadcast_to(self.spin, velocity.shape)])


REST = Turning(np.zeros(3), np.zeros(3))


def turning(scene: Scene) -> Turning:
    """Return the steady motion that the scene's drivers prescribe.

    Raises
    ------
    SceneError
        If a body has no mass, a load varies, or the drivers prescribe another motion than one constant
        rotation relative to the ground about an axis along gravity.
    """
    if not scene.has_mass():
        without = next(body.name for body in scene.body if body.mass is None)
        raise SceneError([f"body[{without}].mass: is missing; small motions need the mass of every body"])
    for k, load in enumerate(scene.load):
        if load.over_time and not load.over_time.is_constant:
            raise SceneError([f"load[{k}].factor: varies; small motions need loads that stay the same"])
    moving = [driver for driver in scene.driver if not driver.is_constant]
    if not moving:
        return REST
    name = moving[0].joint
    joint, frames = scene.joint_named(name), next(j for j in joint_frames(scene) if j.name == name)
    rates = moving[0].polynomial[1:]
    is_steady = len(moving) == 1 and moving[0].is_polynomial and not any(rates[1:])
    if not is_steady or frames.slides or GROUND not in joint.bodies:
        raise SceneError(
            [
                f"driver[{name}]: small motions need drivers that stand still, or one that turns a body "
                "relative to the ground at a constant rate"
            ]
        )
    sign = 1.0 if joint.bodies[0] == GROUND else -1.0
    axis = rotations.unit(joint.directions[0])
    if np.linalg.norm(np.cross(scene.gravity, axis)) > PARALLEL * np.linalg.norm(scene.gravity):
        raise SceneError([f"driver[{name}]: its axis is not along gravity, so the motion is not steady"])
    return Turning(sign * float(rates[0]) * axis, np.array(joint.anchor_pair[0]))
