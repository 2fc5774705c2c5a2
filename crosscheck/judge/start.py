"""Poses at which a scene with offsets of couplings starts to move, checked by the judge's equations."""

from __future__ import annotations

import numpy as np

from crosscheck.judge.constraints import (
    closure,
    coupling_gaps,
    initial_poses,
    joint_coordinates,
    scene_length,
)
from mbref.scene import Coupling, Scene, SceneError
from mbref.scene_joints import ANGLE

MET = 1e-12  # residual over the mechanism's length (m) or over 1 rad; rounding leaves 1e-15
TURNS = 2 * np.pi * np.arange(-100, 101)  # full turns that one pose of a joint does not show, rad


def started(scene: Scene) -> Scene:
    """Return ``scene.assembled()``; the judge's other functions and the engines take scenes without offsets.

    Raises SceneError if no pose obeys the offsets, or if the assembled poses violate a joint or a coupling.
    """
    found = scene.assembled()
    if found is scene:
        return scene
    position, orientation = initial_poses(found)
    still = np.zeros((1, len(scene.body), 3))
    gaps = {
        name: float(np.abs(rows).max(initial=0.0))
        for name, rows in closure(scene, 0.0, position, orientation).items()
    }
    coupled = coupling_gaps(scene, np.zeros(1), position[None], orientation[None], still)
    gaps |= {c.name: _up_to_turns(scene, c, coupled[c.name].item()) for c in scene.coupling}
    for name, gap in gaps.items():
        if not gap <= MET * max(1.0, scene_length(scene)):
            raise SceneError([f"{name}: the poses at the start violate it by {gap:.3g} m or rad"])
    return found


def _up_to_turns(scene: Scene, coupling: Coupling, gap: float) -> float:
    """Return the least size of a coupling's gap, to which full turns of both joints are added."""
    first, second = (TURNS if kind == ANGLE else np.zeros(1) for _, kind in scene.coupled(coupling))
    return float(np.abs(gap + second[:, None] - coupling.ratio * first).min())


def start_coordinates(scene: Scene) -> dict[str, np.ndarray]:
    """Return angle (rad, within half a turn) and displacement (m) (2,) of every joint with a coordinate at
    the start, counted from the poses of the scene."""
    position, orientation = initial_poses(started(scene))
    still = np.zeros((1, len(scene.body), 3))
    found = joint_coordinates(scene, np.zeros(1), position[None], orientation[None], still)
    return {name: both[0] for name, both in found.items()}
