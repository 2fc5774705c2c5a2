"""Difference of accelerations and of unique reactions between two runs that should agree."""

from __future__ import annotations

import numpy as np

from crosscheck.judge.constraints import scene_length
from crosscheck.judge.coupling_laws import unwound
from crosscheck.judge.joint_reactions import LEAST, shared_wrenches
from crosscheck.judge.tolerances import RANK
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

Part = tuple[float, str]


def pushes_apart(scene: Scene, expected: Trajectory, found: Trajectory, rank: float = RANK) -> Part:
    """Return the larger of the relative differences of accelerations and of reactions, and the name of the
    quantity. A difference is relative to the largest expected value. Both runs have equal sample times.
    Quantities that one of the runs does not give are not compared. ``rank`` is the argument of
    `shared_wrenches`.
    """
    accelerations = accelerations_apart(scene, expected, found), "accelerations"
    return max(accelerations, _reactions(scene, expected, found, rank))


def accelerations_apart(scene: Scene, expected: Trajectory, found: Trajectory) -> float:
    """Return the difference of accelerations, relative to the largest expected acceleration; 0 if a run gives
    no accelerations.

    Angular accelerations are multiplied by the scene's length. The scale is at least the scene's length over
    its duration squared.
    """
    length, parts = scene_length(scene), []
    for name, unit in (("acceleration", 1.0), ("angular_acceleration", length)):
        first, second = getattr(expected, name), getattr(found, name)
        if first is not None and second is not None:
            parts.append(
                (unit * np.abs(first).max(initial=0.0), unit * np.abs(first - second).max(initial=0.0))
            )
    scale = max([length / scene.duration**2, *(size for size, _ in parts)])
    return float(np.max([0.0, *(apart for _, apart in parts)]) / scale)


def _reactions(scene: Scene, expected: Trajectory, found: Trajectory, rank: float) -> Part:
    """Return the difference of reactions at the last sample, for joints of both runs, in their unique
    components.

    Moments are divided by the scene's length.
    """
    first, second = expected.reactions or {}, found.reactions or {}
    common = [name for name in first if name in second]
    if not common or not scene.has_mass():
        return 0.0, "reactions"
    units = np.repeat([1.0, scene_length(scene)], 3)
    weight = LEAST * sum(body.mass or 0.0 for body in scene.body)
    scale = max([weight, *(float(np.linalg.norm(w[-1] / units)) for w in first.values())])
    scene = unwound(scene, found)[-1]
    shared = shared_wrenches(scene, found.times[-1], found.position[-1], found.orientation[-1], rank)
    worst = 0.0
    for name in common:
        apart = (second[name][-1] - first[name][-1]) / units
        worst = max(worst, float(np.linalg.norm(apart - shared[name] @ (shared[name].T @ apart))))
    return worst / scale, "reactions"
