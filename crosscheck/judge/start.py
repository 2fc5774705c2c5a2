"""Poses at which a scene with offsets of couplings starts to move, checked by the judge's equations."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from crosscheck.judge.constraints import (
    closure,
    coupling_gaps,
    initial_poses,
    joint_coordinates,
    scene_length,
)
from crosscheck.judge.pieces import at_start
from mbref.scene import Scene, SceneError

MET = 1e-12  # residual over the mechanism's length (m) or over 1 rad; rounding leaves 1e-15


def started(scene: Scene) -> Scene:
    """Return ``mbref.assembled(scene)``: other functions of the judge, and engines, take no offsets.

    Raises SceneError if no pose obeys the offsets, or if the assembled poses violate a joint or a coupling.
    """
    if not any(coupling.offset for coupling in at_start(scene).coupling):
        return scene
    from mbref import angles_at_start, assembled

    return checked_start(scene, assembled(scene), angles_at_start(scene))


def checked_start(scene: Scene, found: Scene, angles: Mapping[str, float]) -> Scene:
    """Return ``found``, the scene at its start, if its poses obey all joints and couplings.

    ``angles`` (rad, full turns counted) of joints are between the given poses and those found. Raises
    SceneError, which names the joint or coupling.
    """
    sample = _sample(found, angles)
    gaps = {
        name: float(np.abs(rows).max(initial=0.0))
        for name, rows in closure(scene, 0.0, *initial_poses(found)).items()
    }
    gaps |= {name: abs(gap.item()) for name, gap in coupling_gaps(scene, *sample).items()}
    for name, gap in gaps.items():
        if not gap <= MET * max(1.0, scene_length(scene)):
            raise SceneError([f"{name}: the poses at the start violate it by {gap:.3g} m or rad"])
    return found


def start_coordinates(scene: Scene) -> dict[str, np.ndarray]:
    """Return angle (rad, full turns counted) and displacement (m) (2,) of every joint with a coordinate, from
    the poses of the scene to its start. Raises the error of ``started``."""
    from mbref import angles_at_start

    sample = _sample(started(scene), angles_at_start(scene))
    return {name: both[0] for name, both in joint_coordinates(scene, *sample).items()}


def _sample(start: Scene, angles: Mapping[str, float]) -> tuple[Any, ...]:
    """Return time, poses and spins (1, …) of the start, and its angles with full turns (1,) by joint."""
    position, orientation = initial_poses(start)
    turns = {name: np.array([angle]) for name, angle in angles.items()}
    still = np.zeros((1, len(start.body), 3))
    return np.zeros(1), position[None], orientation[None], still, turns
