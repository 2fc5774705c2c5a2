"""Limits of joints that act when the motion of an SDF file begins, from rest."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from crosscheck.engines.mujoco.importing.left_out import Part
from crosscheck.judge.constraints import initial_poses, joint_coordinates, joint_rates
from crosscheck.judge.gauss_principle import gauss
from crosscheck.judge.start import started
from mbref.scene import Scene
from mbref.scene.joints import DISPLACEMENT

AT_LIMIT = 1e-9  # rad or m; a coordinate this near to its limit is at the limit
PUSHES = 1e-9  # of the largest acceleration; a smaller acceleration along a coordinate is rounding


def acting(scene: Scene, limits: Mapping[str, tuple[float, float]]) -> Iterator[Part]:
    """Return a part for each joint that begins beyond a limit, or at a limit against which it accelerates.

    ``limits`` has the lower and upper limit (rad or m) of joints, by name.
    """
    is_moved = any(coupling.offset for coupling in scene.coupling)
    if not is_moved and not any(low >= -AT_LIMIT or high <= AT_LIMIT for low, high in limits.values()):
        return
    start = started(scene)
    places, still = initial_poses(start), np.zeros((len(scene.body), 3))
    now = joint_coordinates(scene, np.zeros(1), places[0][None], places[1][None], still[None])
    found = gauss(start)
    forward = joint_rates(start, *places, *np.split(found, 2)) if np.isfinite(found).all() else {}
    least = PUSHES * float(np.abs(found).max(initial=0.0))
    for name, (low, high) in limits.items():
        kind = int(scene.joint_named(name).facts.driven == DISPLACEMENT)
        at = float(now[name][0, kind]) if name in now else 0.0
        push = float(forward[name][kind]) if name in forward else 0.0
        is_beyond = at < low - AT_LIMIT or at > high + AT_LIMIT
        is_pushed = (at <= low + AT_LIMIT and push < -least) or (at >= high - AT_LIMIT and push > least)
        if is_beyond or is_pushed:
            yield Part("limits", f"limit of joint {name!r}, which acts at the start")
