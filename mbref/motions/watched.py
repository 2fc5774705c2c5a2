"""Numbers of a motion that conditions watch: coordinates that reach a value, and reactions that release."""

from __future__ import annotations

import numpy as np

from mbref.motions.joint_motion import along, joint_motion, position_of, velocity_of
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene
from mbref.scene.conditions import Release, When

NO_DISTANCE = 1e-300  # m; avoids a division by zero where points coincide


def watched(scene: Scene, when: When, motion: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """Return the coordinate of a condition (rad or m) and its rate (k,)."""
    if when.joint is not None:
        kind = when.coordinate or scene.joint_named(when.joint).facts.main
        return along(joint_motion(scene, motion, when.joint), kind)
    ends = list(zip(when.bodies or (), when.points or (), strict=True))
    first, second = (position_of(scene, motion, *end) for end in ends)
    speeds = [velocity_of(scene, motion, *end) for end in ends]
    length = np.linalg.norm(second - first, axis=1)
    rate = np.einsum("ki,ki->k", second - first, speeds[1] - speeds[0]) / np.maximum(length, NO_DISTANCE)
    return length, rate


def loaded(release: Release, wrench: np.ndarray) -> np.ndarray:
    """Return the force (N) or moment (N m) (k,) that releases, of reactions (k, 6) of a joint."""
    part = wrench[:, :3] if release.force else wrench[:, 3:]
    if release.component is None:
        return np.asarray(np.linalg.norm(part, axis=1))
    sign = -1.0 if release.component.startswith("-") else 1.0
    return sign * part[:, "xyz".index(release.component[-1])]
