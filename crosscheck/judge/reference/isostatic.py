"""A mechanism without its redundant rows: joints replaced by weaker ones as long as no freedom is added.

Redundant rows whose anchors and axes are rounded contradict each other by about 1e-16, and a mechanism as its
doubles have it then moves on one set of independent rows or on another, but has no motion to more digits.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from crosscheck.judge.constraints import initial_poses, jacobian
from crosscheck.judge.tolerances import RANK
from mbref.scene import JOINT_TYPES, Joint, Scene

WEAKER = {"revolute": ("spherical", "planar", "cylindrical"), "translational": ("cylindrical",),
          "universal": ("spherical",), "fixed": ("spherical",)}  # fmt: skip
"""Types whose rows are among those of a type, with the same anchor and axis; the fewest rows first."""
REMOVED = "removed"


def isostatic(scene: Scene) -> Scene:
    """The scene with redundant joints removed or replaced by weaker ones, the last joints first; its rank at
    t = 0 stays the same.  Joints with a driver or a torsion spring are kept."""
    rank = _rank(scene)
    needed = {d.joint for d in scene.driver} | {l.joint for l in scene.load if l.type == "torsion_spring"}
    for joint in reversed(scene.joint):
        if joint.name not in needed:
            trials = (_with(scene, joint, other) for other in _weaker(joint))
            scene = next((trial for trial in trials if _rank(trial) == rank), scene)
    return scene


def replaced(scene: Scene, by: Scene) -> dict[str, str]:
    """The joints of a scene that another one lacks or has weaker ones for, by name: their type or REMOVED."""
    types = {joint.name: joint.type for joint in by.joint}
    kept = {joint.name: types.get(joint.name, REMOVED) for joint in scene.joint}
    return {joint.name: kept[joint.name] for joint in scene.joint if kept[joint.name] != joint.type}


def _weaker(joint: Joint) -> Iterator[tuple[Joint, ...]]:
    """No joint, and then the weaker ones."""
    yield ()
    for kind in WEAKER.get(joint.type, ()):
        places = {"anchor": joint.anchor_pair[0], "axis": next(iter(joint.directions), None)}
        yield (JOINT_TYPES[kind].at(joint.name, joint.bodies, **places),)


def _with(scene: Scene, joint: Joint, others: tuple[Joint, ...]) -> Scene:
    """The scene with others in place of a joint."""
    parts = [others if j.name == joint.name else (j,) for j in scene.joint]
    return scene.with_(joint=tuple(j for part in parts for j in part))


def _rank(scene: Scene) -> int:
    """Rank of the rows at t = 0, with drivers."""
    rows, _ = jacobian(scene, 0.0, *initial_poses(scene))
    if not len(rows):
        return 0
    values = np.linalg.svd(rows, compute_uv=False)
    return int((values > RANK * values[0]).sum())
