"""Joint reactions from Exudyn's sensors, which record multipliers of each joint's rotation constraints.

The force of a joint in Exudyn acts on the first body, in the first marker's frame. The components of its
torque are multipliers of constraints a·b = 0 between an axis a of the first marker's frame and an axis b of
the second's. Such a constraint exerts the moment multiplier × (a × b) on the second body.
"""

from __future__ import annotations

import numpy as np

from crosscheck.engines.exudyn.joints import JOINTS, marker_frame
from mbref import rotations
from mbref.rotations import unit
from mbref.scene import GROUND, Joint, Scene


def reactions(
    scene: Scene, moved: np.ndarray, turned: np.ndarray, forces: np.ndarray
) -> dict[str, np.ndarray]:
    """Return force and moment (k, 6), world, on each joint's second body at the anchor on that body.

    ``moved`` (k, nb, 3) and ``turned`` (k, nb, 4) are the bodies' displacements and rotations since
    t = 0; ``forces`` (k, ·) the outputs of each joint in JOINTS, then the force of each driver, coupling and
    armature.
    """
    turn = rotations.to_matrix(turned)
    found, at = {}, 0
    for joint in scene.joint:
        outputs = []
        for size in JOINTS[joint.type].outputs.values():
            outputs.append(forces[:, at : at + size])
            at += size
        axes = [_turn(scene, body, turn) @ marker_frame(joint) for body in joint.bodies]
        found[joint.name] = np.concatenate(_wrench(scene, joint, axes, moved, turn, outputs), axis=-1)
    for n, driver in enumerate(scene.driver):
        joint = scene.joint_named(driver.joint)
        _push(scene, found[joint.name], joint, joint.facts.driven, turn, -forces[:, at + n])
    for n, coupling in enumerate(scene.coupling, at + len(scene.driver)):
        for factor, (joint, kind) in zip(coupling.factors, scene.coupled(coupling), strict=True):
            _push(scene, found[joint.name], joint, kind, turn, factor * forces[:, n])
    rotors = [joint for joint in scene.joint if joint.reflected_inertia]
    for n, joint in enumerate(rotors, at + len(scene.driver) + len(scene.coupling)):
        _push(scene, found[joint.name], joint, joint.facts.driven, turn, -forces[:, n])
    return found


def _push(
    scene: Scene, wrench: np.ndarray, joint: Joint, kind: str | None, turn: np.ndarray, size: np.ndarray
) -> None:
    """Add a force or torque of ``size`` (k,) along a joint's axis on the first body to wrenches (k, 6)."""
    axis = _turn(scene, joint.bodies[0], turn) @ unit(joint.directions[0])
    wrench[:, slice(0, 3) if kind == "displacement" else slice(3, 6)] += size[:, None] * axis


def _wrench(
    scene: Scene,
    joint: Joint,
    axes: list[np.ndarray],
    moved: np.ndarray,
    turn: np.ndarray,
    outputs: list[np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Return force and moment (k, 3) of the joint without its driver; ``axes`` are the joint's frames (k, 3,
    3)."""
    force, *torque = outputs
    moment = np.zeros((len(turn), 3))
    if joint.facts.condition == "constant distance":
        ends = [_point(scene, *end, moved, turn) for end in zip(joint.bodies, joint.anchor_pair, strict=True)]
        along = ends[1] - ends[0]
        return -force * along / np.linalg.norm(along, axis=-1, keepdims=True), moment
    if not torque:
        return -force, moment
    for k, pair in enumerate(JOINTS[joint.type].torques):
        if pair:
            direction = np.cross(axes[0][:, :, pair[0]], axes[1][:, :, pair[1]])
            moment = moment + torque[0][:, k, None] * direction
    return -np.einsum("kij,kj->ki", axes[0], force), moment


def _turn(scene: Scene, body: str, turn: np.ndarray) -> np.ndarray:
    """Return the rotation matrices (k, 3, 3) of a body, or the ground, since t = 0."""
    return (
        np.broadcast_to(np.eye(3), (len(turn), 3, 3)) if body == GROUND else turn[:, scene.body_index(body)]
    )


def _point(
    scene: Scene, body: str, point: tuple[float, ...], moved: np.ndarray, turn: np.ndarray
) -> np.ndarray:
    """Return the world positions (k, 3) of a point of a body, given at t = 0."""
    if body == GROUND:
        return np.broadcast_to(point, (len(turn), 3))
    k = scene.body_index(body)
    centre = np.array(scene.body[k].position)
    return centre + moved[:, k] + turn[:, k] @ (np.array(point) - centre)
