"""Damped springs whose ends meet in a pose: where they can part in several directions, small motions are not
linear, because the damping force acts along the line of the ends."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from crosscheck.judge.constraints import scene_length
from crosscheck.judge.small_motions.posed import Carried
from mbref.scene import Scene, SceneError, Spring

MEETING = 1e-11  # distance of the ends / length of the mechanism, up to which they meet
ONE_LINE = (
    1e-4  # second / first singular value of the directions of parting, up to which they are on one line
)


def refuse_damped_meeting(
    scene: Scene, pose: tuple[np.ndarray, np.ndarray], displaced: Sequence[tuple[np.ndarray, np.ndarray]]
) -> None:
    """Raise SceneError for a damped spring whose ends meet at a pose, and part in several directions at
    displaced poses. Poses are positions (nb, 3) and orientations (nb, 4)."""
    for k, load in enumerate(scene.load):
        if not isinstance(load, Spring) or not load.damping:
            continue
        here, *there = (_between(Carried(scene, *each), load) for each in (pose, *displaced))
        if np.linalg.norm(here) > MEETING * scene_length(scene):
            continue
        values = np.linalg.svd(np.array(there).reshape(-1, 3) - here, compute_uv=False)
        if len(values) > 1 and values[1] > ONE_LINE * values[0]:
            fault = f"load[{k}]: the ends of the damped spring meet at an equilibrium"
            raise SceneError([f"{fault}, where small motions are not linear"])


def _between(carried: Carried, load: Spring) -> np.ndarray:
    """Return the vector (3,), m, between the ends of a spring."""
    first, second = (np.array(carried.point(*end)) for end in zip(load.bodies, load.points, strict=True))
    return np.asarray(second - first)
