"""A mechanism without redundant rows: joints are replaced by joints with fewer rows as long as no degree of
freedom is added.

Redundant rows whose anchors and axes are rounded contradict each other by about 1e-16. With its doubles taken
as exact, such a mechanism moves according to one set of independent rows or another, and no motion with more
digits exists.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from crosscheck.judge.constraints import initial_poses, jacobian, scene_length
from crosscheck.judge.deadline import ask
from crosscheck.judge.gauss_principle import rank as rank_at_start
from crosscheck.judge.reference.tree_joints import used_coordinates
from mbref.scene import JOINT_TYPES, Joint, Scene, Universal

WEAKER = {
    "revolute": ("spherical", "planar", "cylindrical"),
    "translational": ("cylindrical",),
    "universal": ("spherical",),
    "fixed": ("spherical",),
}
"""Types whose rows are among those of a type, with the same anchor and axis; the fewest rows first."""
REMOVED = "removed"
# smallest singular value without / with the removed rows; a smaller ratio forbids the removal
KEPT = 0.02
Pose = tuple[float, np.ndarray, np.ndarray]
"""Time, positions (nb, 3) and orientations (nb, 4)."""


def isostatic(scene: Scene, along: Sequence[Pose] = ()) -> Scene:
    """Return the scene with redundant joints removed or replaced by weaker joints, the last joints first. The
    rank at t = 0 and at poses along the motion is unchanged.  Joints whose coordinate is used are unchanged;
    if such joints have redundant rows, the scene is unchanged."""
    poses = [(0.0, *initial_poses(scene)), *along]
    rank = rank_at_start(scene)
    least = [_singular_value(scene, rank, pose) for pose in poses]
    needed = {name for _, name in used_coordinates(scene)}

    def serves(trial: Scene) -> bool:
        ask()
        if rank_at_start(trial) != rank:
            return False
        return all(
            _singular_value(trial, rank, pose) > KEPT * s for pose, s in zip(poses, least, strict=True)
        )

    def without(trial: Scene, joints: Sequence[Joint]) -> Scene | None:
        if len(jacobian(trial, *poses[0])[0]) == rank:
            return trial
        if not joints:
            return None
        weaker = (_with(trial, joints[0], others) for others in _weaker(joints[0]))
        found = (without(other, joints[1:]) for other in weaker if serves(other))
        return next((other for other in found if other), None) or without(trial, joints[1:])

    return without(scene, [joint for joint in reversed(scene.joint) if joint.name not in needed]) or scene


def replaced(scene: Scene, by: Scene) -> dict[str, str]:
    """Return the joints of a scene that another scene lacks or replaces by weaker joints, by name: their new
    type or REMOVED."""
    types = {joint.name: joint.type for joint in by.joint}
    kept = {joint.name: types.get(joint.name, REMOVED) for joint in scene.joint}
    return {joint.name: kept[joint.name] for joint in scene.joint if kept[joint.name] != joint.type}


def _weaker(joint: Joint) -> Iterator[tuple[Joint, ...]]:
    """Return the possible replacements of a joint: no joint, then weaker joints.

    For a revolute joint the last replacements are universal joints, which also turn about one of two
    directions normal to the hinge's axis.
    """
    yield ()
    axis, anchor = next(iter(joint.directions), None), next(iter(joint.anchor_pair))
    for kind in WEAKER.get(joint.type, ()):
        places = {"anchor": anchor, "axis": axis}
        yield (JOINT_TYPES[kind].at(joint.name, joint.bodies, **places),)
    if joint.type == "revolute" and axis is not None:
        across = np.cross(np.eye(3)[np.argmin(np.abs(axis))], axis)
        for normal in (across, np.cross(axis, across)):
            x, y, z = normal.tolist()
            yield (Universal(name=joint.name, bodies=joint.bodies, anchor=anchor, axes=(axis, (x, y, z))),)


def _with(scene: Scene, joint: Joint, others: tuple[Joint, ...]) -> Scene:
    """Return the scene with other joints in place of one joint."""
    parts = [others if j.name == joint.name else (j,) for j in scene.joint]
    return scene.with_(joint=tuple(j for part in parts for j in part))


def _singular_value(scene: Scene, number: int, pose: Pose) -> float:
    """Return a singular value of the rows by its number: number 1 is the largest, number 0 gives infinity."""
    return float(_singular_values(scene, pose)[number - 1]) if number else np.inf


def _singular_values(scene: Scene, pose: Pose) -> np.ndarray:
    """Return the singular values of the rows, with velocities over the scene's length."""
    rows, length = jacobian(scene, *pose)[0], scene_length(scene)
    scaled = rows * np.tile(np.repeat([length, 1.0], 3), len(scene.body))
    sizes = np.linalg.norm(scaled, axis=1, keepdims=True)
    return np.linalg.svd(scaled / sizes, compute_uv=False) if len(rows) else np.zeros(0)
