"""Scenes whose drivers come to a dead position are compared up to there: no engine can follow them beyond."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from crosscheck.judge.dead_position import Pose, dead_position
from crosscheck.judge.truth import NoSolution, truth_for
from crosscheck.study.truths import DENSE, evaluated
from mbref.scene import Scene

# part of the time of a dead position at which a comparison ends: velocities grow without bound towards that
# time, as one over the root of what is left of it
PART = 0.98


class Followed(NamedTuple):
    """A scene with an end up to which it follows its drivers, sample times (k,), and the time ``dead`` (s) of
    the dead position (None: it follows the drivers to its own end)."""

    scene: Scene
    times: np.ndarray
    dead: float | None = None


def followed(scene: Scene, times: np.ndarray, reference_time: float) -> Followed:
    """Return a scene and its sample times (k,) up to a dead position of its drivers.

    The true motion is looked for within ``reference_time`` (CPU seconds); where it ends, the judge's joint
    equations decide whether the drivers can be followed. A dead position before the second sample changes
    nothing.
    """
    dead = _dead_position(scene, times, reference_time) if scene.driver else None
    if dead is None:
        return Followed(scene, times)
    end = float(f"{PART * dead:.3g}")
    even = np.array_equal(times, np.linspace(0.0, scene.duration, len(times)))
    kept = np.linspace(0.0, end, len(times)) if even else times[times <= end]
    return (
        Followed(scene.with_(duration=end), kept, dead)
        if kept.max(initial=0.0) > 0
        else Followed(scene, times)
    )


def _dead_position(scene: Scene, times: np.ndarray, reference_time: float) -> float | None:
    truth, wanted = truth_for(scene, reference_time), evaluated(scene, times)
    if truth is None:
        return None
    try:
        truth.poses(wanted)
    except NoSolution as end:
        known = wanted[wanted <= end.until]
        if not known.max(initial=0.0) > 0:
            return None
        last = truth.poses(known[-1:])
        pose = Pose(last.position[0], last.orientation[0])
        # two parts further: the joints still hold at the dead position, which may be a time of the truth
        return dead_position(
            scene, pose, known[-1], min(known[-1] + 2 * scene.duration / DENSE, scene.duration)
        )
    return None
