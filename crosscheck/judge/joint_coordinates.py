"""Joint coordinates from poses: the angle about and the displacement along a joint's axis. Armatures of these
coordinates.

Coordinates are of the second body relative to the first, zero at t = 0.  Arrays have any leading shape (…),
and the ground as their last body.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from crosscheck.judge.driver_rows import twist, wrapped
from crosscheck.judge.joint_residuals import (
    JointFrames,
    anchor_acceleration,
    anchor_velocity,
    grounded,
    in_world,
    joint_frames,
    relative_acceleration,
    relative_twist,
    resolve,
    with_ground,
)
from mbref import rotations
from mbref.scene import Scene
from mbref.scene.joints import ANGLE, DISPLACEMENT

COORDINATES = (ANGLE, DISPLACEMENT)  # columns of joint coordinates


def coordinate_rates(
    joint: JointFrames,
    position: np.ndarray,
    orientation: np.ndarray,
    velocity: np.ndarray,
    angular_velocity: np.ndarray,
) -> np.ndarray:
    """Return the rates (…, 2) of angle and displacement along the axis, seen from the first body."""
    arms, offset, frames = in_world(joint, position, orientation)
    dv, w = anchor_velocity(joint, arms, velocity, angular_velocity)
    linear, angular = relative_twist(frames, offset, dv, w)
    return np.stack([angular[..., 2], linear[..., 2]], axis=-1)


def coordinate_accelerations(
    joint: JointFrames,
    position: np.ndarray,
    orientation: np.ndarray,
    velocity: np.ndarray,
    angular_velocity: np.ndarray,
    acceleration: np.ndarray,
    angular_acceleration: np.ndarray,
) -> np.ndarray:
    """Return the time derivatives (…, 2) of ``coordinate_rates``."""
    arms, offset, frames = in_world(joint, position, orientation)
    dv, w = anchor_velocity(joint, arms, velocity, angular_velocity)
    da, dw = anchor_acceleration(joint, arms, w, acceleration, angular_acceleration)
    linear, angular = relative_acceleration(frames, offset, (dv, da), w, dw)
    return np.stack([angular[..., 2], linear[..., 2]], axis=-1)


def coordinates(
    joint: JointFrames,
    times: np.ndarray,
    position: np.ndarray,
    orientation: np.ndarray,
    angular_velocity: np.ndarray,
    counts: Mapping[str, np.ndarray] | None = None,
) -> np.ndarray:
    """Return the angle about the axis and the displacement along it (k, 2) since t = 0, over k samples.

    The pose gives the angle up to full turns. Full turns are as the engine counted them, if ``counts`` has
    its angles (k,) by joint, otherwise counted between samples.
    """
    _, offset, frames = in_world(joint, position, orientation)
    turned = twist(rotations.multiply(rotations.conjugate(frames[0]), frames[1]))
    w = [angular_velocity[..., b, :] for b in joint.bodies]
    rate = resolve(frames[0], w[1] - w[0])[..., 2]
    known = (counts or {}).get(joint.name)
    angle = counted(times, turned, rate) if known is None else known + wrapped(turned - known)
    return np.stack([angle, resolve(frames[0], offset)[:, 2]], axis=1)


def pose_coordinates(joint: JointFrames, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
    """Return the angle about the axis, within half a turn, and the displacement along it (…, 2) at poses."""
    _, offset, frames = in_world(joint, position, orientation)
    turned = twist(rotations.multiply(rotations.conjugate(frames[0]), frames[1]))
    return np.stack([wrapped(turned), resolve(frames[0], offset)[..., 2]], axis=-1)


def counted(times: np.ndarray, angle: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Return angles (k,) with full turns counted by means of the rates (k,); the given angles are known up to
    full turns and zero at t = 0.

    Between samples the change nearest to the trapezoidal rule is chosen. The result is NaN from the first
    sample on at which the rates differ too much for this choice.
    """
    if not times.size:
        return np.zeros(0)
    before, step = np.concatenate([rate[:1], rate[:-1]]), np.diff(times, prepend=0.0)
    expected = step * (rate + before) / 2
    change = expected + wrapped(np.diff(angle, prepend=0.0) - expected)
    near = np.lib.stride_tricks.sliding_window_view(np.pad(rate, 2, mode="edge"), 5, axis=0)
    doubt = step * (near.max(axis=-1) - near.min(axis=-1))
    doubt[:1] = np.abs(step[:1] * rate[:1])
    turns = np.round((np.cumsum(change) - angle) / (2 * np.pi))  # whole numbers: no rounding adds up
    return np.where(np.cumsum(doubt >= np.pi) > 0, np.nan, angle + 2 * np.pi * turns)


def coordinate_jacobian(scene: Scene, name: str, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
    """Return (2, 6 nb): the rates of a joint's angle and displacement for unit twists of the bodies (see
    ``jacobian``)."""
    n = 6 * len(scene.body)
    joint = next(joint for joint in joint_frames(scene) if joint.name == name)
    pose, unit = with_ground(position, orientation), np.eye(n).reshape(n, -1, 6)
    return coordinate_rates(joint, *pose, grounded(unit[..., :3]), grounded(unit[..., 3:])).T


@dataclass(frozen=True)
class Reflected:
    """Coordinates with armatures at a pose: their sizes (c,), kg m² or kg, and their Jacobian J (c, 6 nb).

    J times the twists (velocity and angular velocity, world, body after body) gives the coordinates' rates.
    ``drift`` (c,) is the part of their second derivatives that does not depend on accelerations.
    """

    joints: tuple[str, ...]
    inertia: np.ndarray
    jacobian: np.ndarray
    drift: np.ndarray

    @property
    def mass(self) -> np.ndarray:
        """Return the armatures' part (6 nb, 6 nb) of the mass matrix of the twists."""
        return np.asarray(self.jacobian.T @ (self.inertia[:, None] * self.jacobian))

    @property
    def force(self) -> np.ndarray:
        """Return the armatures' force (6 nb,) on bodies without accelerations."""
        return np.asarray(-self.jacobian.T @ (self.inertia * self.drift))


def reflected(
    scene: Scene,
    position: np.ndarray,
    orientation: np.ndarray,
    velocity: np.ndarray,
    angular_velocity: np.ndarray,
) -> Reflected:
    """Return the armatures of a scene at one pose and its twists, arrays (nb, ·)."""
    geared = [joint for joint in scene.joint if joint.reflected_inertia]
    names = tuple(joint.name for joint in geared)
    frames = {joint.name: joint for joint in joint_frames(scene)}
    motion = *with_ground(position, orientation), grounded(velocity), grounded(angular_velocity)
    still = grounded(np.zeros((len(scene.body), 3)))
    jacobian, drift = np.zeros((len(geared), 6 * len(scene.body))), np.zeros(len(geared))
    for k, joint in enumerate(geared):
        column = COORDINATES.index(joint.facts.driven)
        jacobian[k] = coordinate_jacobian(scene, joint.name, position, orientation)[column]
        drift[k] = coordinate_accelerations(frames[joint.name], *motion, still, still)[column]
    return Reflected(names, np.array([joint.reflected_inertia for joint in geared]), jacobian, drift)
