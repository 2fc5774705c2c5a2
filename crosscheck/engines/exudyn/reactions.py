"""Joint reactions from Exudyn's sensors, which give raw multipliers of each joint's rotation constraints.

What a joint calls its force acts on the first body, in the first marker's frame; what it calls its
torque are the multipliers of constraints a·b = 0 between an axis a of the first marker's frame and an
axis b of the second's.  Such a constraint puts the moment multiplier × (a × b) on the second body.
"""

from __future__ import annotations

import numpy as np

from mbref import rotations
from mbref.scene import GROUND, Joint, Scene

X, Y, Z = 0, 1, 2
PAIRS = {  # per torque component: the axis of the first frame and the axis of the second kept perpendicular
    "fixed": ((Z, Y), (Z, X), (X, Y)),
    "translational": ((Z, Y), (Z, X), (X, Y)),
    "revolute": ((Z, X), (Z, Y)),
    "cylindrical": ((Z, X), (Z, Y)),
    "universal": (None, None, (X, Y)),
}
SENSED = {"spherical": {"Force": 3}, "distance": {"Force": 1}}


def sensed(joint: Joint) -> dict[str, int]:
    """Names and sizes of the output variables that make up a joint's reaction."""
    return SENSED.get(joint.type, {"ForceLocal": 3, "TorqueLocal": 3})


def joint_frame(joint: Joint) -> np.ndarray:
    """World axes (columns) at t = 0 of a joint's markers: z along the joint's axis, for a translation x.

    A universal joint has x along the axis on the first body and y along the one on the second.
    """
    if joint.type in ("fixed", "spherical", "distance"):
        return np.eye(3)
    if joint.type == "universal":
        x, y = (unit(axis) for axis in joint.axes)
        return np.column_stack([x, y, np.cross(x, y)])
    z = unit(joint.axis)
    x = unit(np.cross(np.eye(3)[np.argmin(np.abs(z))], z))
    y = np.cross(z, x)
    return np.column_stack([z, x, y] if joint.type == "translational" else [x, y, z])


def unit(vector: np.ndarray | tuple[float, ...]) -> np.ndarray:
    """v / |v|."""
    return np.asarray(vector, dtype=float) / np.linalg.norm(vector)


def reactions(
    scene: Scene, moved: np.ndarray, turned: np.ndarray, forces: np.ndarray
) -> dict[str, np.ndarray]:
    """Force and moment (k, 6), world, on each joint's second body at the anchor on that body.

    ``moved`` (k, nb, 3) and ``turned`` (k, nb, 4) are the bodies' displacements and rotations since
    t = 0; ``forces`` (k, ·) the outputs `sensed` of each joint, then the force of each driver.
    """
    turn = rotations.to_matrix(turned)
    found, at = {}, 0
    for joint in scene.joint:
        outputs = []
        for size in sensed(joint).values():
            outputs.append(forces[:, at : at + size])
            at += size
        axes = [_turn(scene, body, turn) @ joint_frame(joint) for body in joint.bodies]
        found[joint.name] = np.concatenate(_wrench(scene, joint, axes, moved, turn, outputs), axis=-1)
    for n, driver in enumerate(scene.driver):
        joint = next(joint for joint in scene.joint if joint.name == driver.joint)
        axis = _turn(scene, joint.bodies[0], turn) @ unit(joint.axis)
        part = slice(0, 3) if joint.type == "translational" else slice(3, 6)
        found[joint.name][:, part] -= forces[:, at + n, None] * axis
    return found


def _wrench(
    scene: Scene, joint: Joint, axes: list[np.ndarray], moved: np.ndarray, turn: np.ndarray,
    outputs: list[np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Force and moment (k, 3) of the joint without its driver; ``axes`` are its frames (k, 3, 3)."""
    moment = np.zeros((len(turn), 3))
    if joint.type == "spherical":
        return -outputs[0], moment
    if joint.type == "distance":
        ends = [_point(scene, *end, moved, turn) for end in zip(joint.bodies, joint.anchors, strict=True)]
        along = ends[1] - ends[0]
        return -outputs[0] * along / np.linalg.norm(along, axis=-1, keepdims=True), moment
    for k, pair in enumerate(PAIRS[joint.type]):
        if pair:
            direction = np.cross(axes[0][:, :, pair[0]], axes[1][:, :, pair[1]])
            moment = moment + outputs[1][:, k, None] * direction
    return -np.einsum("kij,kj->ki", axes[0], outputs[0]), moment


def _turn(scene: Scene, body: str, turn: np.ndarray) -> np.ndarray:
    """Rotation matrices (k, 3, 3) of a body, or the ground, since t = 0."""
    return (
        np.broadcast_to(np.eye(3), (len(turn), 3, 3)) if body == GROUND else turn[:, scene.body_index(body)]
    )


def _point(
    scene: Scene, body: str, point: tuple[float, ...], moved: np.ndarray, turn: np.ndarray
) -> np.ndarray:  # fmt: skip
    """World positions (k, 3) of a point of a body, given at t = 0."""
    if body == GROUND:
        return np.broadcast_to(point, (len(turn), 3))
    k = scene.body_index(body)
    centre = np.array(scene.body[k].position)
    return centre + moved[:, k] + turn[:, k] @ (np.array(point) - centre)
