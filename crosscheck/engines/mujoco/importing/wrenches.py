"""Forces and moments of a scene's loads at a pose, for the comparison with the compiled model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mbref import rotations
from mbref.scene import Scene


def pushes(scene: Scene, pose: tuple[np.ndarray, np.ndarray], motion: np.ndarray) -> np.ndarray:
    """Return weight and the forces of the scene's loads (6 nb,)."""
    found = np.zeros((len(scene.body) + 1, 6))  # the last entry is the ground's
    found[:-1, :3] = np.outer([body.mass or 0.0 for body in scene.body], np.array(scene.gravity))
    actions = {
        "spring": _spring,
        "rotational_damper": _rotational_damper,
        "point_damper": _point_damper,
        **dict.fromkeys(("torsion_spring", "joint_torque"), _turning),
        **dict.fromkeys(("slide_spring", "joint_force"), _sliding),
    }
    for load in scene.load:
        if action := actions.get(load.type):
            for body, wrench in action(scene, load, pose, motion):
                found[body] += wrench
    return found[:-1].reshape(-1)


def _spring(scene: Scene, load: Any, pose: Any, motion: np.ndarray) -> list[tuple[int, np.ndarray]]:
    bodies = [scene.body_index(name) for name in load.bodies]
    places, rates = _points(scene, pose, motion, bodies, load.points)
    apart = places[1] - places[0]
    length = np.linalg.norm(apart)
    along = apart / length if length else np.eye(3)[0]  # MuJoCo's direction of a spring without length
    pull = load.stiffness * (length - load.natural_length) + load.damping * along @ (rates[1] - rates[0])
    return _wrenches(pose, bodies, places, pull * along)


def _rotational_damper(
    scene: Scene, load: Any, pose: Any, motion: np.ndarray
) -> list[tuple[int, np.ndarray]]:
    bodies = [scene.body_index(name) for name in load.bodies]
    first, second = (_spin(motion, b) for b in bodies)
    moment = np.concatenate([np.zeros(3), load.damping * (second - first)])
    return [(bodies[0], moment), (bodies[1], -moment)]


def _point_damper(scene: Scene, load: Any, pose: Any, motion: np.ndarray) -> list[tuple[int, np.ndarray]]:
    bodies = [scene.body_index(name) for name in load.bodies]
    places, rates = _points(scene, pose, motion, bodies, [load.point] * 2)
    seen = rates[1] - rates[0] - np.cross(_spin(motion, bodies[0]), places[1] - places[0])
    return _wrenches(pose, bodies, [places[1]] * 2, load.damping * seen)


def _spin(motion: np.ndarray, body: int) -> np.ndarray:
    """Return the angular velocity of a body, zero of the ground."""
    return motion[body, 3:] if body >= 0 else np.zeros(3)


def _points(scene: Scene, pose: Any, motion: np.ndarray, bodies: Sequence[int], points: Any) -> Any:
    """Return positions and velocities, world, of a point of each body, given at the scene's pose."""
    places, rates = [], []
    for b, point in zip(bodies, np.array(points), strict=True):
        if b < 0:
            places.append(point)
            rates.append(np.zeros(3))
            continue
        arm = _turn(scene, pose, b) @ (point - scene.body[b].position)
        places.append(pose[0][b] + arm)
        rates.append(motion[b, :3] + np.cross(motion[b, 3:], arm))
    return places, rates


def _wrenches(
    pose: Any, bodies: Sequence[int], places: Sequence[np.ndarray], force: np.ndarray
) -> list[tuple[int, np.ndarray]]:
    """Return the wrenches about the bodies' centres of a force on the first body and its opposite on the
    second one."""
    centres = np.vstack([pose[0], np.zeros(3)])  # the last one is the ground's
    return [
        (b, np.concatenate([sign * force, np.cross(place - centres[b], sign * force)]))
        for b, place, sign in zip(bodies, places, (1, -1), strict=True)
    ]


def _turning(scene: Scene, load: Any, pose: Any, motion: np.ndarray) -> list[tuple[int, np.ndarray]]:
    joint = scene.joint_named(load.joint)
    bodies = [scene.body_index(name) for name in joint.bodies]
    turns = [np.eye(3) if b < 0 else _turn(scene, pose, b) for b in bodies]
    start = rotations.unit(joint.directions[0])
    axis = turns[0] @ start
    q = rotations.from_matrix(turns[0].T @ turns[1])
    angle = 2 * np.arctan2(q[1:] @ start, q[0])
    rates = [np.zeros(3) if b < 0 else motion[b, 3:] for b in bodies]
    if load.type == "joint_torque":
        moment = -load.torque
    else:
        moment = load.stiffness * (angle - load.natural_angle) + load.damping * axis @ (rates[1] - rates[0])
    return [
        (b, np.concatenate([np.zeros(3), sign * moment * axis]))
        for b, sign in zip(bodies, (1, -1), strict=True)
    ]


def _sliding(scene: Scene, load: Any, pose: Any, motion: np.ndarray) -> list[tuple[int, np.ndarray]]:
    joint = scene.joint_named(load.joint)
    bodies = [scene.body_index(name) for name in joint.bodies]
    turn = np.eye(3) if bodies[0] < 0 else _turn(scene, pose, bodies[0])
    axis = turn @ rotations.unit(joint.directions[0])
    places, rates = _points(scene, pose, motion, bodies, joint.anchor_pair)
    apart, spin = places[1] - places[0], np.zeros(3) if bodies[0] < 0 else motion[bodies[0], 3:]
    rate = axis @ (rates[1] - rates[0]) + np.cross(spin, axis) @ apart
    if load.type == "joint_force":
        push = -load.force
    else:
        push = load.stiffness * (axis @ apart - load.natural_displacement) + load.damping * rate
    return _wrenches(pose, bodies, [places[1]] * 2, push * axis)


def _turn(scene: Scene, pose: Any, b: int) -> np.ndarray:
    """Return the rotation (3, 3) of a body since the scene's pose."""
    start = rotations.to_matrix(np.array(scene.body[b].orientation))
    return np.asarray(rotations.to_matrix(pose[1][b]) @ start.T)
