"""Mechanisms that fall as one rigid piece: no joint moves, so that a run verifies nothing but gravity."""

from __future__ import annotations

import numpy as np

from crosscheck.judge.constraints import initial_twists, scene_length
from crosscheck.judge.gauss_principle import gauss
from mbref.scene import GROUND, Scene

ROUNDING = 1e-9  # fraction of gravity, or of the speed: smaller differences are rounding


def falls_freely(scene: Scene) -> bool:
    """Return whether all bodies begin with one velocity, without turning, and gravity alone moves them.

    No joint or load connects them to the ground, and all relative positions stay as they are.
    """
    gravity = float(np.linalg.norm(scene.gravity))
    held = any(GROUND in part.bodies for part in (*scene.joint, *scene.load) if hasattr(part, "bodies"))
    if held or not gravity or scene.driver or not scene.has_mass():
        return False
    velocity, angular_velocity = initial_twists(scene)
    speed = np.abs(velocity).max()
    apart = max(np.ptp(velocity, axis=0).max(), scene_length(scene) * np.abs(angular_velocity).max())
    if apart > ROUNDING * speed:
        return False
    linear, angular = np.split(gauss(scene), 2)  # the second part is times the scene's length
    return bool(max(np.abs(linear - scene.gravity).max(), np.abs(angular).max()) <= ROUNDING * gravity)
