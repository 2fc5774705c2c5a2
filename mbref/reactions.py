"""Joint reactions from Lagrange multipliers: -Φ_qᵀ λ of a joint's rows, moved to its anchor."""

from __future__ import annotations

import numpy as np

from mbref import rotations
from mbref.model import Model


def reactions(
    model: Model, times: np.ndarray, q: np.ndarray, v: np.ndarray, multipliers: np.ndarray
) -> dict[str, np.ndarray] | None:
    """Per joint force (N) and moment (N m) (k, 6) on its second body at the anchor, world axes.

    From q (k, nb, 7), v (k, nb, 6) and λ (k, m) at times (k,); None where the scene has no masses.
    """
    if model.kinematic:
        return None
    joints = model.scene.joint
    body, sign = _acted_on(model)
    names = [joint.name for joint in joints]
    rows = np.array([r for r, name in enumerate(model.row_joint) if name in names], dtype=int)
    of = np.array([names.index(model.row_joint[r]) for r in rows], dtype=int)
    wrench = np.zeros((len(times), len(joints), 6))  # about the centre of mass, moments in body axes
    for k, t in enumerate(times):
        jacobian = model.terms(t, q[k].ravel(), v[k].ravel()).jacobian
        blocks = jacobian.reshape(model.m, model.nb, 6)[rows, body[of]]
        np.add.at(wrench[k], of, -(sign[of] * multipliers[k, rows])[:, None] * blocks)
    found = {}
    for j, joint in enumerate(joints):
        b, force = body[j], wrench[:, j, :3]
        arm = model.anchor(joint, q) - q[:, b, :3]
        moment = rotations.rotate(q[:, b, 3:], wrench[:, j, 3:]) - np.cross(arm, force)
        found[joint.name] = np.concatenate([force, moment], axis=1)
    return found


def _acted_on(model: Model) -> tuple[np.ndarray, np.ndarray]:
    """The body of each joint in whose coordinates its wrench is read, and 1, or -1 for the first body."""
    pairs = [tuple(map(model.index, joint.bodies)) for joint in model.scene.joint]
    body = [second if second < model.nb else first for first, second in pairs]
    sign = [1.0 if second < model.nb else -1.0 for _, second in pairs]
    return np.array(body, dtype=int), np.array(sign)
