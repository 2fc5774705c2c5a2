"""A planar mechanism with the fewest joint coordinates: joints that allow more than planar motion are
replaced.

In a planar motion a universal joint acts as a hinge, and a hinge that closes a loop can be replaced by a
point. A scene is replaced only if its joints and the new joints leave equally many velocities, so that both
allow equal motions.
"""

from __future__ import annotations

import functools

import numpy as np

from crosscheck.engines.shared.initial_velocities import RANK_TOLERANCE
from crosscheck.engines.shared.spanning_tree import spanning_tree
from crosscheck.judge.constraints import initial_poses, initial_twists, jacobian
from mbref.rotations import unit
from mbref.scene import (
    Fixed,
    Joint,
    JointLoad,
    Revolute,
    Scene,
    Spherical,
    Translational,
    Universal,
)

PARALLEL = 1e-12  # sine of an angle between axes; smaller angles count as zero
AT_REST = 1e-12  # velocity out of the plane / velocity in the plane; smaller ratios count as zero


def planar_scene(scene: Scene) -> Scene:
    """Return the form of a planar scene that has the fewest coordinates: the given scene, or the scene with
    hinges instead of other joints."""
    return _hinged_scene(scene) or scene


@functools.lru_cache(maxsize=64)
def _hinged_scene(scene: Scene) -> Scene | None:
    """Return the scene with hinges; None if the given scene has as few coordinates."""
    normals = [joint.directions[0] for joint in scene.joint if isinstance(joint, Revolute)]
    if not normals or not _starts_within(scene, normal := unit(normals[0])):
        return None
    found = [scene]
    for kept in ((Spherical,), ()):  # a cut spherical joint closes a loop by a point without replacement
        joints = [joint if isinstance(joint, kept) else _hinged(joint, normal) for joint in scene.joint]
        if all(joint is not None for joint in joints):
            found.append(_closed_by_points(scene.with_(joint=joints)))
    best = min(found, key=lambda planar: spanning_tree(planar).nv)
    return best if best is not scene and _freedoms(best) == _freedoms(scene) else None


def _starts_within(scene: Scene, normal: np.ndarray) -> bool:
    """Return whether no body has a velocity out of the plane at t = 0."""
    linear, angular = initial_twists(scene)
    size = max(abs(linear).max(), abs(angular).max())
    out = max(abs(linear @ normal).max(), abs(np.cross(angular, normal)).max())
    return bool(out <= AT_REST * size)


def _hinged(joint: Joint, normal: np.ndarray) -> Joint | None:
    """Return the joint reduced to its freedom in the plane; None if this freedom is unknown."""
    axes = [unit(axis) for axis in joint.directions]
    across = [bool(np.linalg.norm(np.cross(axis, normal)) < PARALLEL) for axis in axes]
    along = [bool(abs(axis @ normal) < PARALLEL) for axis in axes]

    def hinge() -> Joint:
        anchor, _ = joint.anchor_pair
        return Revolute(name=joint.name, bodies=joint.bodies, anchor=anchor, axis=tuple(normal.tolist()))

    if isinstance(joint, Fixed) or (isinstance(joint, Revolute) and across[0]):
        return joint
    if isinstance(joint, Translational) and along[0]:
        return joint
    is_hinge = isinstance(joint, Spherical) or (isinstance(joint, Universal) and any(across))
    return hinge() if is_hinge else None


def _closed_by_points(scene: Scene) -> Scene:
    """Return the scene whose cut hinges are replaced by points."""
    acting = {driver.joint for driver in scene.driver}
    acting |= {load.joint for load in scene.load if isinstance(load, JointLoad)}
    acting |= {name for coupling in scene.coupling for name in coupling.joints}
    acting |= {joint.name for joint in scene.joint if joint.reflected_inertia}
    cut = {closure.joint for closure in spanning_tree(scene).closures if closure.kind == "weld"}
    joints = [
        Spherical(name=joint.name, bodies=joint.bodies, anchor=joint.anchor)
        if j in cut and isinstance(joint, Revolute) and joint.name not in acting
        else joint
        for j, joint in enumerate(scene.joint)
    ]
    return scene.with_(joint=joints)


def _freedoms(scene: Scene) -> int:
    """Return the number of independent velocities that the joints, without drivers, leave at t = 0."""
    free = scene.with_(driver=())
    rows, _ = jacobian(free, 0.0, *initial_poses(free))
    return 6 * len(scene.body) - int(np.linalg.matrix_rank(rows, RANK_TOLERANCE))
