"""A planar mechanism with the fewest joint coordinates: joints that allow more than its motion are exchanged.

A universal joint whose motion stays in a plane is a hinge there, and a hinge that closes a planar loop need
only be a point.  A scene is rewritten where its joints leave as many velocities as the joints of the
rewritten
one: the motions that the latter allows are then all that it has.
"""

from __future__ import annotations

import numpy as np

from crosscheck.engines.geometry import unit
from crosscheck.engines.initial_velocities import RANK_TOLERANCE
from crosscheck.engines.spanning_tree import spanning_tree
from crosscheck.judge.constraints import initial_poses, initial_twists, jacobian
from mbref.scene import (
    Fixed,
    Joint,
    Revolute,
    Scene,
    Spherical,
    TorsionSpring,
    Translational,
    Universal,
)

PARALLEL = 1e-12  # sine of an angle between axes that counts as none
AT_REST = 1e-12  # m/s and rad/s out of the plane, of those within


def planar_scene(scene: Scene) -> Scene:
    """The scene with the fewest coordinates in its plane; the scene itself where none has fewer."""
    normals = [joint.directions[0] for joint in scene.joint if isinstance(joint, Revolute)]
    if not normals or not _starts_within(scene, normal := unit(np.array(normals[0]))):
        return scene
    found = [scene]
    for kept in ((Spherical,), ()):  # a cut spherical joint is already a point closure
        joints = [joint if isinstance(joint, kept) else _hinged(joint, normal) for joint in scene.joint]
        if all(joint is not None for joint in joints):
            found.append(_closed_by_points(scene.with_(joint=joints)))
    best = min(found, key=lambda planar: spanning_tree(planar).nv)
    return best if _freedoms(best) == _freedoms(scene) else scene


def _starts_within(scene: Scene, normal: np.ndarray) -> bool:
    """Whether no body leaves the plane or tilts out of it at t = 0."""
    linear, angular = initial_twists(scene)
    size = max(abs(linear).max(), abs(angular).max())
    out = max(abs(linear @ normal).max(), abs(np.cross(angular, normal)).max())
    return bool(out <= AT_REST * size)


def _hinged(joint: Joint, normal: np.ndarray) -> Joint | None:
    """The joint with the freedom that it has in the plane; None where it is not known to have any."""
    axes = [unit(np.array(axis)) for axis in joint.directions]
    across = [bool(np.linalg.norm(np.cross(axis, normal)) < PARALLEL) for axis in axes]
    along = [bool(abs(axis @ normal) < PARALLEL) for axis in axes]

    def hinge() -> Joint:
        return Revolute(
            name=joint.name, bodies=joint.bodies, anchor=joint.anchor_pair[0], axis=tuple(normal.tolist())
        )

    if isinstance(joint, Fixed) or (isinstance(joint, Revolute) and across[0]):
        return joint
    if isinstance(joint, Translational) and along[0]:
        return joint
    is_hinge = isinstance(joint, Spherical) or (isinstance(joint, Universal) and any(across))
    return hinge() if is_hinge else None


def _closed_by_points(scene: Scene) -> Scene:
    """The scene whose cut hinges are points."""
    acting = {driver.joint for driver in scene.driver}
    acting |= {load.joint for load in scene.load if isinstance(load, TorsionSpring)}
    acting |= {name for coupling in scene.coupling for name in coupling.joints}
    acting |= {joint.name for joint in scene.joint if joint.reflected_inertia}
    cut = {closure.joint for closure in spanning_tree(scene).closures if closure.kind == "weld"}
    joints = [
        Spherical(name=joint.name, bodies=joint.bodies, anchor=joint.anchor_pair[0])
        if j in cut and isinstance(joint, Revolute) and joint.name not in acting
        else joint
        for j, joint in enumerate(scene.joint)
    ]
    return scene.with_(joint=joints)


def _freedoms(scene: Scene) -> int:
    """The number of velocities that the joints leave at t = 0, drivers aside."""
    free = scene.with_(driver=())
    rows, _ = jacobian(free, 0.0, *initial_poses(free))
    return 6 * len(scene.body) - int(np.linalg.matrix_rank(rows, RANK_TOLERANCE))
