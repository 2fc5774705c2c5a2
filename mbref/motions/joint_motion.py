"""Motion in a joint: the angle about and the displacement along its axis, from a trajectory of bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import Joint, Scene
from mbref.scene.joints import ANGLE, DISPLACEMENT, Coordinate


@dataclass(frozen=True, eq=False)
class JointMotion:
    """Motion of the second body of a joint relative to the first, from t = 0, at k sample times.

    Attributes
    ----------
    name : str
        Name of the joint.
    angle, rate : ndarray, shape (k,), or None
        Angle about the axis (rad, full turns counted) and its rate (rad/s), of revolute, cylindrical and
        planar joints. NaN where samples of an engine that counts no turns are too far apart to count them.
    displacement, displacement_rate : ndarray, shape (k,), or None
        Displacement along the axis, m, and its rate, m/s, of sliding joints and of joints of type free.
    rotation : ndarray, shape (k, 3)
        Rotation vector of the second body relative to the first, rad, along the world's axes at t = 0 as they
        are fixed to the first body.
    force, moment : ndarray, shape (k, 3), or None
        Reaction on the second body at its anchor, world frame, N and N m.
    open : ndarray, shape (k,), or None
        Number of reaction components that equilibrium does not determine.
    active : ndarray, shape (k,), or None
        1 where the joint constrains, otherwise 0. None in a scene whose constraints always hold.
    impulse, angular_impulse : ndarray, shape (k, 3), or None
        Sum of the impulses of force (N s) and of moment (N m s) at events up to each sample, on the second
        body at its anchor, world frame. None in a scene whose constraints always hold.
    """

    name: str
    angle: np.ndarray | None
    rate: np.ndarray | None
    displacement: np.ndarray | None
    displacement_rate: np.ndarray | None
    rotation: np.ndarray
    force: np.ndarray | None
    moment: np.ndarray | None
    open: np.ndarray | None = None
    active: np.ndarray | None = None
    impulse: np.ndarray | None = None
    angular_impulse: np.ndarray | None = None

    def __repr__(self) -> str:
        has = [key for key in ("angle", "displacement", "force") if getattr(self, key) is not None]
        return (
            f"<JointMotion of {self.name!r}: {len(self.rotation)} samples of {', '.join([*has, 'rotation'])}>"
        )


def joint_motion(scene: Scene, motion: Trajectory, name: str) -> JointMotion:
    """Return the motion in the joint of that name; raises a KeyError that lists the joints."""
    if name not in {joint.name for joint in scene.joint}:
        raise KeyError(f"no joint {name!r}; joints: {', '.join(joint.name for joint in scene.joint)}")
    joint = scene.joint_named(name)
    turned = [turned_since_start(scene, motion, body) for body in joint.bodies]
    relative = rotations.multiply(rotations.conjugate(turned[0]), turned[1])
    slides = DISPLACEMENT in joint.facts.coordinates
    angle, rate = _angle(scene, motion, joint, turned[0], relative) if joint.facts.turns else (None, None)
    slid, speed = _displacement(scene, motion, joint, turned[0]) if slides else (None, None)
    wrench = (motion.reactions or {}).get(name)
    force, moment = (None, None) if wrench is None else (wrench[:, :3], wrench[:, 3:])
    marks = (motion.open_reactions or {}).get(name)
    turning = rotations.to_vector(relative)
    return JointMotion(name, angle, rate, slid, speed, turning, force, moment, marks, *_events(joint, motion))


def _events(joint: Joint, motion: Trajectory) -> tuple[np.ndarray | None, ...]:
    """Return where a joint constrains (k,), and the sums (k, 3) of its impulses; None without events."""
    if motion.events is None:
        return None, None, None
    total, holds = np.zeros((len(motion.times), 6)), np.full(len(motion.times), int(joint.starts_held))
    for event in motion.events:
        later = motion.times >= event.time
        total[later] += event.impulses.get(joint.name, np.zeros(6))
        if joint.name in (*event.engaged, *event.released):
            holds[later] = joint.name in event.engaged
    return holds, total[:, :3], total[:, 3:]


def along(found: JointMotion, coordinate: Coordinate) -> tuple[np.ndarray, np.ndarray]:
    """Return a joint's angle (rad) or displacement (m), and its rate (k,)."""
    turns = coordinate == ANGLE
    value, rate = (found.angle, found.rate) if turns else (found.displacement, found.displacement_rate)
    return np.asarray(value), np.asarray(rate)


def carried(points: np.ndarray, motion: Trajectory, body: int) -> np.ndarray:
    """Return the world points (k, n, 3) of points (n, 3) in the frame of a body."""
    return motion.position[:, body, None] + rotations.rotate(motion.orientation[:, body, None], points[None])


def positions_of(
    scene: Scene, motion: Trajectory, name: str, points: Sequence[Sequence[float]]
) -> np.ndarray:
    """Return world positions (k, n, 3) of points (n, 3, world, t = 0) that move with a body, or are fixed to
    the ground."""
    b, at_start = scene.body_index(name), np.array(points, dtype=float)
    if b < 0:
        return np.broadcast_to(at_start, (len(motion.times), *at_start.shape))
    body = scene.body[b]
    turned_back = rotations.conjugate(np.array(body.orientation))
    return carried(rotations.rotate(turned_back, at_start - np.array(body.position)), motion, b)


def position_of(scene: Scene, motion: Trajectory, name: str, point: Sequence[float]) -> np.ndarray:
    """Return ``positions_of`` one point: (k, 3)."""
    return np.asarray(positions_of(scene, motion, name, [point])[:, 0])


def velocity_of(scene: Scene, motion: Trajectory, name: str, point: tuple[float, float, float]) -> np.ndarray:
    """Return world velocities (k, 3), m/s, of a point (world, t = 0) that moves with a body, or is fixed to
    the ground."""
    b = scene.body_index(name)
    if b < 0:
        return np.zeros((len(motion.times), 3))
    arm = position_of(scene, motion, name, point) - motion.position[:, b]
    return np.asarray(motion.velocity[:, b] + rotations.cross(motion.angular_velocity[:, b], arm))


def turned_since_start(scene: Scene, motion: Trajectory, name: str) -> np.ndarray:
    """Return rotations (k, 4) of a body since the scene's orientation at t = 0."""
    b = scene.body_index(name)
    if b < 0:
        return np.tile(np.array([1.0, 0.0, 0.0, 0.0]), (len(motion.times), 1))
    start = rotations.conjugate(np.array(scene.body[b].orientation))
    return rotations.multiply(motion.orientation[:, b], start)


def _angle(
    scene: Scene, motion: Trajectory, joint: Joint, first: np.ndarray, relative: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the angle about the axis and its rate. Full turns are as the run counted them, otherwise counted
    from the samples."""
    axis = rotations.unit(joint.directions[0])
    spins = [angular_velocity_of(scene, motion, name) for name in joint.bodies]
    rate = np.einsum("ki,ki->k", spins[1] - spins[0], rotations.rotate(first, axis[None]))
    wrapped = 2 * np.arctan2(relative[:, 1:] @ axis, relative[:, 0])
    counted = (motion.angles or {}).get(joint.name)
    if counted is None:
        return _counted(motion.times, wrapped, rate), rate
    return wrapped + 2 * np.pi * np.round((counted - wrapped) / (2 * np.pi)), rate


def _counted(times: np.ndarray, angle: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Return angles (k,), given up to full turns, with turns counted by the mean rate (k,) between samples.

    The first sample is within half a turn of the start. The result is NaN from the first sample on at which
    the rates leave a choice.
    """
    before, step = np.concatenate([rate[:1], rate[:-1]]), np.diff(times, prepend=0.0)
    turns = np.round((step * (before + rate) / 2 - np.diff(angle, prepend=0.0)) / (2 * np.pi))
    doubt = step * np.abs(rate - before)
    doubt[:1] = step[:1] * np.abs(rate[:1])
    return np.where(np.cumsum(doubt >= np.pi) > 0, np.nan, angle + 2 * np.pi * np.cumsum(turns))


def angular_velocity_of(scene: Scene, motion: Trajectory, name: str) -> np.ndarray:
    """Return the angular velocity (k, 3) of a body, rad/s, world axes; zero for the ground."""
    b = scene.body_index(name)
    return np.zeros((len(motion.times), 3)) if b < 0 else motion.angular_velocity[:, b]


def angular_acceleration_of(scene: Scene, motion: Trajectory, name: str) -> np.ndarray:
    """Return the angular acceleration (k, 3) of a body, rad/s², world axes; zero for the ground. The motion
    has accelerations."""
    b = scene.body_index(name)
    return np.zeros((len(motion.times), 3)) if b < 0 else np.asarray(motion.angular_acceleration)[:, b]


def acceleration_of(
    scene: Scene, motion: Trajectory, name: str, point: tuple[float, float, float]
) -> np.ndarray:
    """Return world accelerations (k, 3), m/s², of a point (world, t = 0) that moves with a body, or is fixed
    to the ground. The motion has accelerations."""
    b = scene.body_index(name)
    if b < 0:
        return np.zeros((len(motion.times), 3))
    arm, spin = position_of(scene, motion, name, point) - motion.position[:, b], motion.angular_velocity[:, b]
    turning = rotations.cross(angular_acceleration_of(scene, motion, name), arm)
    inwards = rotations.cross(spin, rotations.cross(spin, arm))
    return np.asarray(np.asarray(motion.acceleration)[:, b] + turning + inwards)


def _displacement(
    scene: Scene, motion: Trajectory, joint: Joint, first: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return (r₂ - r₁)·axis (k,), m, of anchors and the axis that the first body carries, and its rate."""
    ends = list(zip(joint.bodies, joint.anchor_pair, strict=True))
    places = [position_of(scene, motion, *end) for end in ends]
    speeds = [velocity_of(scene, motion, *end) for end in ends]
    axis = rotations.rotate(first, rotations.unit(joint.directions[0])[None])
    turning = rotations.cross(angular_velocity_of(scene, motion, joint.bodies[0]), axis)
    apart = places[1] - places[0]
    rate = np.einsum("ki,ki->k", speeds[1] - speeds[0], axis) + np.einsum("ki,ki->k", apart, turning)
    return np.einsum("ki,ki->k", apart, axis), rate
