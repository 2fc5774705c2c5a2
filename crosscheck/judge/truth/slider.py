"""One body on a translational joint to the ground: its displacement is the path's coordinate."""

from __future__ import annotations

import numpy as np

from crosscheck.judge.loads import initial_rotations
from crosscheck.judge.truth.one_dof import Path, Pose
from crosscheck.judge.truth.parallelogram import unit
from mbref.scene import GROUND, Scene, Translational


def slider(scene: Scene) -> Path | None:
    """Return the path of a scene that may be a single slider, or None."""
    if len(scene.body) != 1 or len(scene.joint) != 1 or not isinstance(scene.joint[0], Translational):
        return None
    joint = scene.joint[0]
    axis = unit(joint.axis)
    start, rotation0 = np.array(scene.body[0].position), initial_rotations(scene)

    def poses(q: np.ndarray) -> Pose:
        along = q[:, None, None] * axis
        still = 0 * along
        rotation = rotation0 + 0 * q[:, None, None, None]
        return Pose(start + along, rotation, 0 * q[:, None], axis + still, still, still, still)

    sign = -1.0 if joint.bodies[1] == GROUND else 1.0
    return Path("slider", poses, axis, lambda driver: sign)
