"""Accelerations of bodies at constant joint velocities.

MuJoCo's ``mj_jacDot`` does not give them for a slide behind a ball joint of one body: it takes the velocity
of the whole body for the velocity of the ball's axes.
"""

from __future__ import annotations

from typing import Any

import numpy as np


def drift(model: Any, data: Any, body: int, point: np.ndarray) -> np.ndarray:
    """Return J̇ q̇ (6,), m/s² and rad/s², world, of a body at a point (3,) that moves with it.

    Needs MuJoCo's ``mj_comPos`` and ``mj_comVel``, whose motions are about the centre of mass of the tree.
    """
    total, b = np.zeros(6), body  # rotational part first
    while b:  # up to the world
        first = int(model.body_dofadr[b])
        dofs = slice(first, first + int(model.body_dofnum[b])) if first >= 0 else slice(0)
        total += data.cdof_dot[dofs].T @ data.qvel[dofs]
        b = int(model.body_parentid[b])
    arm = point - data.subtree_com[model.body_rootid[body]]
    spin, velocity = np.split(data.cvel[body], 2)
    inwards = np.cross(spin, velocity + np.cross(spin, arm))
    return np.concatenate([total[3:] + np.cross(total[:3], arm) + inwards, total[:3]])
