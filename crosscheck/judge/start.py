"""Poses at which a scene with offsets of couplings starts to move, checked by the judge's equations."""

from __future__ import annotations

from typing import Any

import numpy as np

from crosscheck.judge.constraints import (
    closure,
    coupling_gaps,
    initial_poses,
    joint_coordinates,
    scene_length,
)
from mbref.scene import Scene, SceneError

MET = 1e-12  # residual over the mechanism's length (m) or over 1 rad; rounding leaves 1e-15


def started(scene: Scene) -> Scene:
    """Return ``scene.assembled()``; the judge's other functions and the engines take scenes without offsets.

    Raises SceneError if no pose obeys the offsets, or if the assembled poses violate a joint or a coupling.
    """
    found = scene.assembled()
    if found is scene:
        return scene
    gaps = {
        name: float(np.abs(rows).max(initial=0.0))
        for name, rows in closure(scene, 0.0, *initial_poses(found)).items()
    }
    gaps |= {name: abs(gap.item()) for name, gap in coupling_gaps(scene, *_sample(scene)).items()}
    for name, gap in gaps.items():
        if not gap <= MET * max(1.0, scene_length(scene)):
            raise SceneError([f"{name}: the poses at the start violate it by {gap:.3g} m or rad"])
    return found


def start_coordinates(scene: Scene) -> dict[str, np.ndarray]:
    """Return angle (rad, full turns counted) and displacement (m) (2,) of every joint with a coordinate, from
    the poses of the scene to its start. Raises the error of ``started``."""
    started(scene)
    return {name: both[0] for name, both in joint_coordinates(scene, *_sample(scene)).items()}


def _sample(scene: Scene) -> tuple[Any, ...]:
    """Return time, poses and spins (1, …) at the start, and the angles with full turns (1,) by joint."""
    position, orientation = initial_poses(scene.assembled())
    turns = {name: np.array([angle]) for name, angle in scene.angles_at_start().items()}
    still = np.zeros((1, len(scene.body), 3))
    return np.zeros(1), position[None], orientation[None], still, turns
