"""Forces and moments of a scene's gravity and loads on its bodies, from poses and velocities.

Arrays keep their precision (double, or extended for the truths); the first index is the sample: (k, nb, ·).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from crosscheck.judge.constraints import inertia_matrices, initial_poses
from crosscheck.judge.time_functions import value
from mbref import rotations
from mbref.scene import GROUND, Force, Moment, PointDamper, RotationalDamper, Scene, Spring, TorsionSpring


@dataclass(frozen=True)
class Motion:
    """Poses and velocities in the world: position, velocity, angular_velocity (k, nb, 3), rotation matrices
    (k, nb, 3, 3), and turn (k, nb).

    ``turn`` is the angle of each body since t = 0 about the axis that all motions of the mechanism have in
    common, NaN without such an axis.
    """

    position: np.ndarray
    rotation: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    turn: np.ndarray


def wrenches(
    scene: Scene, motion: Motion, axis: np.ndarray, t: float = 0.0, since: float | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return force and moment about the centre of mass (k, nb, 3), world, on every body, gravity included.

    ``axis`` (3,) is the unit vector of the rotation axis of ``motion.turn``; without this axis, loads along
    joint coordinates are left out (``joint_loads``).  Functions of time are at ``t`` (s), of the piece that
    acts from ``since`` (s) on.
    """
    mass = np.array([body.mass for body in scene.body])
    force = motion.position * 0 + mass[:, None] * np.array(scene.gravity)
    moment = np.zeros_like(force)
    for load in scene.load:
        if type(load) in ACTIONS and (not isinstance(load, TorsionSpring) or axis.any()):
            ACTIONS[type(load)](scene, at_time(load, t, since), motion, axis, force, moment)
    return force, moment


def at_time(load: Any, t: float, since: float | None = None) -> Any:
    """Return the constant force or moment that a load has at a time (s)."""
    if load.over_time is None:
        return load
    factor, field = value(load.over_time, t, since=since), "force" if isinstance(load, Force) else "moment"
    size = tuple((factor * np.array(getattr(load, field))).tolist())
    return load.model_copy(update={field: size, "factor": None})


def attachment(scene: Scene, name: str, point: Sequence[float]) -> tuple[int, np.ndarray]:
    """Return the index of a body (-1: ground), and a point given in the world at t = 0 in the body's
    frame."""
    if name == GROUND:
        return -1, np.array(point)
    body = scene.body[scene.body_index(name)]
    arm = np.array(point) - np.array(body.position)
    return scene.body_index(name), rotations.rotate(rotations.conjugate(np.array(body.orientation)), arm)


def _moment(
    scene: Scene, load: Moment, motion: Motion, axis: np.ndarray, force: np.ndarray, moment: np.ndarray
) -> None:
    moment[:, scene.body_index(load.body)] += np.array(load.moment)


def _force(
    scene: Scene, load: Force, motion: Motion, axis: np.ndarray, force: np.ndarray, moment: np.ndarray
) -> None:
    body, local = attachment(scene, load.body, load.point)
    _push(body, motion.rotation[:, body] @ local, np.array(load.force), force, moment)


def _spring(
    scene: Scene, load: Spring, motion: Motion, axis: np.ndarray, force: np.ndarray, moment: np.ndarray
) -> None:
    ends = [attachment(scene, *end) for end in zip(load.bodies, load.points, strict=True)]
    (start, start_rate), (stop, stop_rate) = (_point(motion, *end) for end in ends)
    offset = stop - start
    length = np.sqrt(np.sum(offset**2, axis=-1, keepdims=True))
    direction = _direction(np.where(length > 0.0, offset, stop_rate - start_rate))
    rate = np.sum((stop_rate - start_rate) * direction, axis=-1, keepdims=True)
    pull = (load.stiffness * (length - load.natural_length) + load.damping * rate) * direction
    for (body, local), sign in zip(ends, (1, -1), strict=True):
        if body >= 0:
            _push(body, motion.rotation[:, body] @ local, sign * pull, force, moment)


def _rotational_damper(
    scene: Scene,
    load: RotationalDamper,
    motion: Motion,
    axis: np.ndarray,
    force: np.ndarray,
    moment: np.ndarray,
) -> None:
    bodies = [scene.body_index(name) for name in load.bodies]
    first, second = (_spin(motion, body) for body in bodies)
    for body, side in zip(bodies, (1, -1), strict=True):
        if body >= 0:
            moment[:, body] += side * load.damping * (second - first)


def _point_damper(
    scene: Scene, load: PointDamper, motion: Motion, axis: np.ndarray, force: np.ndarray, moment: np.ndarray
) -> None:
    bodies = [scene.body_index(name) for name in load.bodies]
    place, rate = _point(motion, *attachment(scene, load.bodies[1], load.point))
    first = bodies[0]
    if first >= 0:
        arm = place - motion.position[:, first]
        rate = rate - motion.velocity[:, first] - cross(_spin(motion, first), arm)
    for body, side in zip(bodies, (1, -1), strict=True):
        if body >= 0:
            _push(body, place - motion.position[:, body], side * load.damping * rate, force, moment)


def _spin(motion: Motion, body: int) -> np.ndarray:
    """Return the angular velocity (k, 3) of a body, zero of the ground."""
    return motion.angular_velocity[:, body] if body >= 0 else 0 * motion.angular_velocity[:, 0]


def _direction(vectors: np.ndarray) -> np.ndarray:
    """Return vectors (K, 3) of unit length, and of length zero without a direction."""
    length = np.sqrt(np.sum(vectors**2, axis=1, keepdims=True))
    return np.asarray(vectors / np.where(length > 0.0, length, 1.0))


def _torsion_spring(
    scene: Scene, load: TorsionSpring, motion: Motion, axis: np.ndarray, force: np.ndarray, moment: np.ndarray
) -> None:
    joint = scene.joint_named(load.joint)
    along = rotations.unit(joint.directions[0])
    bodies = [scene.body_index(name) for name in joint.bodies]
    sign = np.round(along @ axis)
    turn, about = sign * motion.turn, sign * axis
    angle = rate = np.zeros(len(motion.position), motion.position.dtype)
    for body, side in zip(bodies, (-1, 1), strict=True):
        if body >= 0:
            angle = angle + side * turn[:, body]
            rate = rate + side * (motion.angular_velocity[:, body] @ about)
    resistance = load.stiffness * (angle - load.natural_angle) + load.damping * rate
    for body, side in zip(bodies, (-1, 1), strict=True):
        if body >= 0:
            moment[:, body] -= side * (resistance[:, None] * about)


ACTIONS: dict[type, Callable[..., None]] = {
    Moment: _moment,
    Force: _force,
    Spring: _spring,
    RotationalDamper: _rotational_damper,
    PointDamper: _point_damper,
    TorsionSpring: _torsion_spring,
}


def _point(motion: Motion, body: int, local: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return world position and velocity (k, 3) of a body-fixed point."""
    if body < 0:
        return np.broadcast_to(local, motion.position[:, 0].shape), np.zeros_like(motion.position[:, 0])
    arm = motion.rotation[:, body] @ local
    return motion.position[:, body] + arm, motion.velocity[:, body] + cross(
        motion.angular_velocity[:, body], arm
    )


def _push(body: int, arm: np.ndarray, push: np.ndarray, force: np.ndarray, moment: np.ndarray) -> None:
    force[:, body] += push
    moment[:, body] += cross(arm, np.broadcast_to(push, arm.shape))


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return vector products (…, 3)."""
    return a[..., [1, 2, 0]] * b[..., [2, 0, 1]] - a[..., [2, 0, 1]] * b[..., [1, 2, 0]]


def world_inertia(scene: Scene, rotation: np.ndarray) -> np.ndarray:
    """Return inertia matrices (…, nb, 3, 3) about the centres of mass along world axes, for rotations (…, nb,
    3, 3)."""
    return rotation @ inertia_matrices(scene) @ np.swapaxes(rotation, -1, -2)


def mass_matrix(scene: Scene, inertia: np.ndarray) -> np.ndarray:
    """Return the mass matrix (6 nb, 6 nb) of velocities and angular velocities, body after body, for inertias
    (nb, 3, 3) along world axes."""
    found = np.zeros((6 * len(inertia), 6 * len(inertia)))
    for b, body in enumerate(scene.body):
        found[6 * b : 6 * b + 3, 6 * b : 6 * b + 3] = (body.mass or 0.0) * np.eye(3)
        found[6 * b + 3 : 6 * b + 6, 6 * b + 3 : 6 * b + 6] = inertia[b]
    return found


def initial_rotations(scene: Scene) -> np.ndarray:
    """Return rotation matrices (nb, 3, 3), body to world, at t = 0."""
    return rotations.to_matrix(initial_poses(scene)[1])
