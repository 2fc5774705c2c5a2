"""Dead positions: times up to which a mechanism can follow its drivers, found by the judge's joint equations.

At a dead position a driver asks for a pose beyond the reach of the mechanism, as a slider behind the point at
which crank and rod are in line. The mechanism has no motion beyond that time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from crosscheck.judge.constraints import closure, jacobian, joint_coordinates, length_rows, scene_length
from crosscheck.judge.coupling_laws import law_value
from crosscheck.judge.driver_rows import wrapped
from mbref import rotations
from mbref.scene import Scene
from mbref.scene.joints import DISPLACEMENT

NEWTON = 15  # iterations; a regular pose needs about five
PARTS = 16  # least number of steps of time, so that no driver leaves the reach and returns within a step
MET = 1e-10  # residual over the mechanism's length (m) or over 1 rad that counts as zero
FARTHEST = 0.5  # of the mechanism's length, or rad; a longer step leads to another assembly of the mechanism
FINEST = 2.0**-17  # step of time over the asked interval, below which the position is dead


class Pose(NamedTuple):
    """Positions (nb, 3) and orientations (nb, 4) of all bodies."""

    position: np.ndarray
    orientation: np.ndarray


def dead_position(scene: Scene, pose: Pose, begin: float, end: float) -> float | None:
    """Return the time (s) of a dead position between two times; None if the mechanism follows its drivers.

    The pose at ``begin`` is continued to ``end`` by Newton's method, in steps of time that are halved where
    it fails. The free coordinates of the mechanism move as little as possible.
    """
    longest = (end - begin) / PARTS
    time, step = begin, longest
    while time < end:
        moved = _moved(scene, pose, min(time + step, end))
        if moved is None:
            step /= 2
            if step < FINEST * (end - begin):
                return time
        else:
            time, pose, step = min(time + step, end), moved, min(2 * step, longest)
    return None


def _moved(scene: Scene, start: Pose, time: float) -> Pose | None:
    """Return the nearest pose that obeys joints, drivers and couplings at a time; None if none is found."""
    pose, length = start, scene_length(scene)
    lengths = length_rows(scene)
    names = [*(joint.name for joint in scene.joint), *(coupling.name for coupling in scene.coupling)]
    scale = np.concatenate([np.where(lengths[name], length, 1.0) for name in names])
    units = np.tile(np.repeat([length, 1.0], 3), len(scene.body))
    travelled = 0.0
    for _ in range(NEWTON):
        residual = _residual(scene, start, pose, time) / scale
        if np.abs(residual).max(initial=0.0) <= MET:
            return pose
        rows = jacobian(scene, time, *pose)[0] * units / scale[:, None]
        change = np.linalg.lstsq(rows, -residual, rcond=None)[0].reshape(-1, 2, 3)
        travelled += float(np.linalg.norm(change, axis=2).max())
        if not travelled <= FARTHEST:
            return None
        turns = rotations.from_vector(change[:, 1])
        pose = Pose(pose.position + length * change[:, 0], rotations.multiply(turns, pose.orientation))
    return None


def _residual(scene: Scene, start: Pose, pose: Pose, time: float) -> np.ndarray:
    """Return the residuals (rows,) of joints with drivers at a time, then of couplings since the start."""
    of_joints = closure(scene, time, *pose)
    before, after = _coordinates(scene, start), _coordinates(scene, pose)
    moved = {n: [wrapped(after[n][0] - before[n][0]), after[n][1] - before[n][1]] for n in after}
    gaps = []
    for coupling in scene.coupling:
        gap = 0.0
        for (joint, kind), law in zip(scene.coupled(coupling), coupling.laws, strict=True):
            column = int(kind == DISPLACEMENT)
            first = before[joint.name][column]
            gap += law_value(law, first + moved[joint.name][column]) - law_value(law, first)
        gaps.append(gap)
    return np.concatenate([*(of_joints[joint.name] for joint in scene.joint), gaps])


def _coordinates(scene: Scene, pose: Pose) -> dict[str, np.ndarray]:
    """Return angle (rad, up to full turns) and displacement (m) of each joint with a coordinate."""
    still = np.zeros((1, len(scene.body), 3))
    found = joint_coordinates(scene, np.zeros(1), pose.position[None], pose.orientation[None], still)
    return {name: both[0] for name, both in found.items()}
