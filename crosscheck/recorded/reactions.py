"""Columns of joint reactions, such as A.force.x in N, as far as redundant constraints determine them."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from crosscheck.judge.coupling_laws import unwound
from crosscheck.judge.joint_reactions import shared_wrenches
from crosscheck.judge.reaction_balance import with_exact_reactions
from crosscheck.judge.tolerances import RANK
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

COMPONENTS = tuple(f"{kind}.{axis}" for kind in ("force", "moment") for axis in "xyz")


def reaction_names(scene: Scene) -> list[str]:
    """Return the names of the columns of reactions; none if a body has no mass."""
    return [f"{joint.name}.{c}" for joint in scene.joint for c in COMPONENTS] if scene.has_mass() else []


def reactions(scene: Scene, motion: Trajectory, wanted: Collection[str]) -> dict[str, np.ndarray]:
    """Return the wanted columns (k,): forces and moments on the second body at the anchor, world axes, SI.

    Components that redundant constraints leave open at a sample are left out.
    """
    names = [name for name in reaction_names(scene) if name in wanted]
    if not names or motion.acceleration is None or not motion.times.size:
        return {}
    found = with_exact_reactions(scene, motion).reactions or {}
    poses = zip(motion.times.tolist(), motion.position, motion.orientation, strict=True)
    shared = [shared_wrenches(own, *pose) for own, pose in zip(unwound(scene, motion), poses, strict=True)]
    columns: dict[str, np.ndarray] = {}
    for joint, wrenches in found.items():
        is_open = [np.linalg.norm(bases[joint], axis=1) > RANK for bases in shared]
        for name, column, left in zip(COMPONENTS, wrenches.T, np.any(is_open, axis=0), strict=True):
            if not left and f"{joint}.{name}" in names:
                columns[f"{joint}.{name}"] = column
    return columns
