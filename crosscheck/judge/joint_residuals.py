"""Residuals of one joint at three levels, from the poses, velocities and accelerations of two joint frames.

A joint frame is fixed in each of the two bodies; its third axis is along the joint's axis, and the frames
coincide at t = 0.  The frames of a universal joint share the origin only, and each follows its own axis.
The residuals are the components of the relative displacement (m, resolved in the first frame) and of the
relative rotation (rad) that the joint forbids; the driver's residual stands last.  Arrays have any leading
shape (…), and the ground as their last body.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from crosscheck.judge import driver_rows, wheels
from mbref import rotations
from mbref.rotations import cross
from mbref.scene import GROUND, Driver, Joint, JointFacts, RollingWheel, Scene, refuse_intervals

Z = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class JointFrames:
    """Data of a joint for array computations: its facts, body indices (-1: ground), frames on the bodies, and
    driver."""

    name: str
    facts: JointFacts
    bodies: tuple[int, ...]
    points: np.ndarray  # (2, 3) frame origins, in the body frames
    frames: np.ndarray  # (2, 4) frame orientations, frame to body
    length: float  # length of a distance joint or radius of a wheel, otherwise 0
    driver: Driver | None

    @property
    def keeps_distance(self) -> bool:
        """Return whether the origins of the two frames keep their distance."""
        return self.facts.condition == "constant distance"

    @property
    def keeps_axes_perpendicular(self) -> bool:
        """Return whether the third axes of the two frames stay perpendicular."""
        return self.facts.condition == "perpendicular axes"

    @property
    def slides(self) -> bool:
        """Return whether a driver prescribes the displacement instead of the angle."""
        return self.facts.driven == "displacement"


@functools.lru_cache(maxsize=64)
def joint_frames(scene: Scene) -> tuple[JointFrames, ...]:
    """Return the frames of the joints of a scene, in its order; raises SceneError for intervals."""
    refuse_intervals(scene)
    drivers = {driver.joint: driver for driver in scene.driver}
    return tuple(_packed(scene, joint, drivers.get(joint.name)) for joint in scene.joint)


def _packed(scene: Scene, joint: Joint, driver: Driver | None) -> JointFrames:
    anchors = np.array(joint.anchor_pair)
    frames = np.array([_frame(axis) for axis in _third_axes(joint)])
    if driver and driver.turn:
        frames[:] = 1.0, 0.0, 0.0, 0.0  # turns are about axes of the world at t = 0
    if isinstance(joint, RollingWheel):
        frames[0] = _frame(joint.normal, joint.without_slip[0])
    points = anchors.copy()
    for k, name in enumerate(joint.bodies):
        if name != GROUND:
            body = scene.body[scene.body_index(name)]
            back = rotations.conjugate(np.array(body.orientation))
            points[k] = rotations.rotate(back, anchors[k] - body.position)
            frames[k] = rotations.multiply(back, frames[k])
    indices = tuple(scene.body_index(name) for name in joint.bodies)
    length = float(np.linalg.norm(anchors[1] - anchors[0]))
    return JointFrames(joint.name, joint.facts, indices, points, frames, length, driver)


def _third_axes(joint: Joint) -> Sequence[Sequence[float]]:
    """Return the third axis (world) of the frame on the first and on the second body."""
    axes = joint.directions or ((0.0, 0.0, 1.0),)
    return (axes[0], axes[-1])


def _frame(axis: Sequence[float], first: Sequence[float] | None = None) -> np.ndarray:
    """Return the quaternion of a frame whose third axis is along `axis`, and whose first axis may be
    given."""
    z = np.array(axis, dtype=float) / np.linalg.norm(axis)
    x = cross(z, np.eye(3)[np.argmin(np.abs(z))]) if first is None else np.array(first)
    x /= np.linalg.norm(x)
    return rotations.from_matrix(np.column_stack([x, cross(z, x), z]))


def are_lengths(joint: JointFrames) -> np.ndarray:
    """Return the mask (rows,) of a joint's residuals: True for lengths (m), False for angles (rad)."""
    facts = joint.facts
    if joint.keeps_distance or joint.facts.velocity_rows:
        return np.ones(facts.rows, dtype=bool)
    angles = len(facts.forbidden_rotations) + joint.keeps_axes_perpendicular
    driver = [joint.slides] * (joint.driver.rows if joint.driver else 0)
    return np.array([True] * len(facts.forbidden_translations) + [False] * angles + driver)


def position_rows(
    joint: JointFrames, t: np.ndarray, position: np.ndarray, orientation: np.ndarray
) -> np.ndarray:
    """Return residuals (…, rows), m and rad, for positions (…, nb + 1, 3) and quaternions (…, nb + 1, 4)."""
    _, offset, frames = in_world(joint, position, orientation)
    if joint.keeps_distance:
        return np.linalg.norm(offset, axis=-1, keepdims=True) - joint.length
    relative = rotations.multiply(rotations.conjugate(frames[0]), frames[1])
    local = resolve(frames[0], offset)
    if joint.facts.velocity_rows:  # the rows of slip have no residual of positions
        found = np.zeros((*local.shape[:-1], joint.facts.rows))
        found[..., 0] = wheels.height(_axis(frames), local, joint.length)
        return found
    rows = [local[..., list(joint.facts.forbidden_translations)]]
    if joint.keeps_axes_perpendicular:
        rows.append(np.arcsin(np.clip(rotations.to_matrix(relative)[..., 2, 2:], -1, 1)))
    elif joint.facts.forbidden_rotations:
        rows.append(_tilt(relative) if joint.facts.free_rotations else _rotation_vector(relative))
    if joint.driver:
        rows.append(driver_rows.residual(joint.driver, joint.slides, t, local, relative))
    return np.concatenate(rows, axis=-1)


def velocity_rows(
    joint: JointFrames,
    t: np.ndarray,
    position: np.ndarray,
    orientation: np.ndarray,
    velocity: np.ndarray,
    angular_velocity: np.ndarray,
) -> np.ndarray:
    """Return the forbidden components (…, rows) of the frames' relative twist, for world velocities (…, nb +
    1, 3)."""
    arms, offset, frames = in_world(joint, position, orientation)
    dv, w = anchor_velocity(joint, arms, velocity, angular_velocity)
    if joint.keeps_distance:
        return _dot(offset, dv) / np.linalg.norm(offset, axis=-1, keepdims=True)
    if joint.facts.velocity_rows:
        seen = relative_twist(frames, offset, dv, w)
        return wheels.slip(_axis(frames), joint.length, *seen)[..., : joint.facts.rows]
    crossing = [_dot(w[1] - w[0], _crossing(frames)[0])] if joint.keeps_axes_perpendicular else []
    return _rows(joint, *relative_twist(frames, offset, dv, w), crossing, t, 1)


def relative_twist(
    frames: list[np.ndarray], offset: np.ndarray, dv: np.ndarray, w: list[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Return velocity and angular velocity (…, 3) of the second frame, seen from the first frame."""
    return resolve(frames[0], dv - cross(w[0], offset)), resolve(frames[0], w[1] - w[0])


def acceleration_rows(
    joint: JointFrames,
    t: np.ndarray,
    position: np.ndarray,
    orientation: np.ndarray,
    velocity: np.ndarray,
    angular_velocity: np.ndarray,
    acceleration: np.ndarray,
    angular_acceleration: np.ndarray,
) -> np.ndarray:
    """Return the time derivative (…, rows) of `velocity_rows`, for world accelerations (…, nb + 1, 3)."""
    arms, offset, frames = in_world(joint, position, orientation)
    dv, w = anchor_velocity(joint, arms, velocity, angular_velocity)
    da, dw = anchor_acceleration(joint, arms, w, acceleration, angular_acceleration)
    if joint.keeps_distance:
        length = np.linalg.norm(offset, axis=-1, keepdims=True)
        along = _dot(offset, dv) / length
        return (_dot(offset, da) + _dot(dv, dv) - along**2) / length
    if joint.facts.velocity_rows:
        seen = relative_twist(frames, offset, dv, w)
        rate = relative_acceleration(frames, offset, (dv, da), w, dw)
        return wheels.slip_rate(_axis(frames), joint.length, seen, rate)[..., : joint.facts.rows]
    crossing = [_crossing_acceleration(frames, w, dw)] if joint.keeps_axes_perpendicular else []
    return _rows(joint, *relative_acceleration(frames, offset, (dv, da), w, dw), crossing, t, 2)


def relative_acceleration(
    frames: list[np.ndarray],
    offset: np.ndarray,
    parting: tuple[np.ndarray, np.ndarray],
    w: list[np.ndarray],
    dw: list[np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Return the time derivatives (…, 3) of ``relative_twist``; ``parting`` is the relative acceleration of
    the origins."""
    dv, da = parting
    seen = da - cross(dw[0], offset) - 2 * cross(w[0], dv) + cross(w[0], cross(w[0], offset))
    return resolve(frames[0], seen), resolve(frames[0], dw[1] - dw[0] - cross(w[0], w[1]))


def _axis(frames: list[np.ndarray]) -> np.ndarray:
    """Return the third axis (…, 3) of the second frame, seen from the first frame."""
    return resolve(frames[0], rotations.rotate(frames[1], Z))


def in_world(
    joint: JointFrames, position: np.ndarray, orientation: np.ndarray
) -> tuple[list[np.ndarray], np.ndarray, list[np.ndarray]]:
    """Return vectors from the centres to the origins (…, 3), the vector between the origins, and frame
    quaternions."""
    p = [orientation[..., b, :] for b in joint.bodies]
    arms = [rotations.rotate(p[k], joint.points[k]) for k in (0, 1)]
    offset = difference(position[..., b, :] + arms[k] for k, b in enumerate(joint.bodies))
    return arms, offset, [rotations.multiply(p[k], joint.frames[k]) for k in (0, 1)]


def anchor_velocity(
    joint: JointFrames, arms: list[np.ndarray], velocity: np.ndarray, angular_velocity: np.ndarray
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return v₂ - v₁ (…, 3) of the two anchors, and the angular velocities (…, 3) of both bodies."""
    w = [angular_velocity[..., b, :] for b in joint.bodies]
    dv = difference(velocity[..., b, :] + cross(w[k], arms[k]) for k, b in enumerate(joint.bodies))
    return dv, w


def anchor_acceleration(
    joint: JointFrames,
    arms: list[np.ndarray],
    w: list[np.ndarray],
    acceleration: np.ndarray,
    angular_acceleration: np.ndarray,
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return a₂ - a₁ (…, 3) of the two anchors, and both angular accelerations (…, 3)."""
    dw = [angular_acceleration[..., b, :] for b in joint.bodies]
    da = difference(
        acceleration[..., b, :] + cross(dw[k], arms[k]) + cross(w[k], cross(w[k], arms[k]))
        for k, b in enumerate(joint.bodies)
    )
    return da, dw


def _rows(
    joint: JointFrames,
    linear: np.ndarray,
    angular: np.ndarray,
    crossing: list[np.ndarray],
    t: np.ndarray,
    derivative: int,
) -> np.ndarray:
    """Return the rows of a rate: forbidden translations, forbidden rotations (or the universal joint's row),
    then the driver."""
    facts = joint.facts
    rows = [linear[..., list(facts.forbidden_translations)], angular[..., list(facts.forbidden_rotations)]]
    rows += crossing
    if joint.driver:
        rows.append(driver_rows.rate(joint.driver, joint.slides, t, derivative, (linear, angular)))
    return np.concatenate(rows, axis=-1)


def _crossing(frames: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """Return the unit normal of a universal joint's two axes, the sine of the angle between them, and the
    axes (world)."""
    axes = [rotations.rotate(frame, Z) for frame in frames]
    normal = cross(axes[1], axes[0])
    size = np.linalg.norm(normal, axis=-1, keepdims=True)
    return normal / size, size, axes


def _crossing_acceleration(frames: list[np.ndarray], w: list[np.ndarray], dw: list[np.ndarray]) -> np.ndarray:
    normal, size, axes = _crossing(frames)
    turning = cross(cross(w[1], axes[1]), axes[0]) + cross(axes[1], cross(w[0], axes[0]))
    turning = (turning - normal * _dot(normal, turning)) / size
    return _dot(dw[1] - dw[0], normal) + _dot(w[1] - w[0], turning)


def resolve(frame: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Return world vectors (…, 3) in the axes of frames (…, 4)."""
    return rotations.rotate(rotations.conjugate(frame), vector)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.sum(a * b, axis=-1, keepdims=True)


def difference(pair: Iterable[np.ndarray]) -> np.ndarray:
    """Return the second of two arrays minus the first."""
    first, second = pair
    return second - first


def _rotation_vector(q: np.ndarray) -> np.ndarray:
    """Return rotation vectors (…, 3), length ≤ π, of unit quaternions."""
    q = np.where(q[..., :1] < 0, -q, q)
    size = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    return 2 * np.arctan2(size, q[..., :1]) * q[..., 1:] / np.maximum(size, np.finfo(float).tiny)


def _tilt(q: np.ndarray) -> np.ndarray:
    """Return the first two components (…, 2) of the shortest rotation vector from one third axis to the
    other."""
    x, y, z = np.moveaxis(rotations.to_matrix(q)[..., 2], -1, 0)
    sine = np.hypot(x, y)
    size = np.maximum(sine, np.finfo(float).tiny)
    # any direction if the axes are opposite
    unit = np.stack([np.where(sine > 0, -y / size, 1.0), x / size], axis=-1)
    return unit * np.arctan2(sine, z)[..., None]


def with_ground(position: np.ndarray, orientation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and normalised quaternions with the ground appended."""
    p = np.asarray(orientation, dtype=float)
    ground = np.broadcast_to([1.0, 0.0, 0.0, 0.0], p[..., :1, :].shape)
    return grounded(position), np.concatenate(
        [p / np.linalg.norm(p, axis=-1, keepdims=True), ground], axis=-2
    )


def grounded(array: np.ndarray) -> np.ndarray:
    """Return (…, nb + 1, 3): a row of zeros for the ground is appended, so that index -1 is the ground."""
    array = np.asarray(array, dtype=float)
    return np.concatenate([array, np.zeros_like(array[..., :1, :])], axis=-2)
