"""Joint reactions from Lagrange multipliers: -Φ_qᵀ λ of a joint's rows, moved to its anchor."""

from __future__ import annotations

import numpy as np

from mbref import rotations
from mbref.equations.diagnosis import scaled_jacobian
from mbref.equations.model import Model

MOST_ROWS = 120  # singular values of more rows at every sample take longer than the run
OPEN = 1e-6  # singular value, to the largest, of a combination of unit rows that counts as vanished
SHARE = 1e-6  # weight of a joint in such a combination below which it takes no part


def reactions(
    model: Model, times: np.ndarray, q: np.ndarray, v: np.ndarray, multipliers: np.ndarray
) -> dict[str, np.ndarray] | None:
    """Per joint force (N) and moment (N m) (k, 6) on its second body at the anchor, world axes.

    From q (k, nb, 7), v (k, nb, 6) and λ (k, m) at times (k,); None where the scene has no masses.
    """
    if model.kinematic:
        return None
    joints = model.scene.joint
    body, side = _acted_on(model)
    sign = np.where(side == 1, 1.0, -1.0)
    number = {joint.name: j for j, joint in enumerate(joints)}
    rows = np.array([r for r, name in enumerate(model.row_joint) if name in number], dtype=int)
    of = np.array([number[model.row_joint[r]] for r in rows], dtype=int)
    wrench = np.zeros((len(times), len(joints), 6))  # about the centre of mass, moments in body axes
    for k, t in enumerate(times):
        blocks = model.blocks(t, q[k].ravel(), v[k].ravel()).jacobian.reshape(model.m, 2, 6)
        np.add.at(wrench[k], of, -(sign[of] * multipliers[k, rows])[:, None] * blocks[rows, side[of]])
    found = {}
    for j, joint in enumerate(joints):
        b, force = body[j], wrench[:, j, :3]
        arm = model.anchor(joint, q) - q[:, b, :3]
        moment = rotations.rotate(q[:, b, 3:], wrench[:, j, 3:]) - np.cross(arm, force)
        found[joint.name] = np.concatenate([force, moment], axis=1)
    return found


def open_dimensions(model: Model, times: np.ndarray, q: np.ndarray) -> dict[str, np.ndarray] | None:
    """Per joint the dimensions (k,) of its reaction that equilibrium does not determine at each sample.

    Redundant rows leave reactions open always, a singular position where the motion passes it: there a
    combination of rows vanishes, a left null vector of Φ_q (Wojtyra, J. Theor. Appl. Mech. 43, 2005).  From
    q (k, nb, 7) at times (k,); None where the scene has no masses, or more than MOST_ROWS rows.
    """
    if model.kinematic or model.m > MOST_ROWS:
        return None
    rows = [scaled_jacobian(model, t, q[k].ravel()) for k, t in enumerate(times)]
    left, values, _ = np.linalg.svd(np.array(rows).reshape(len(times), model.m, model.n))
    rank = np.sum(values > OPEN * values.max(axis=1, initial=0.0)[:, None], axis=1)
    vanishing = left * (np.arange(model.m) >= rank[:, None])[:, None, :]
    of_joint = np.array(model.row_joint)
    return {
        joint.name: np.sum(_singular_values(vanishing[:, of_joint == joint.name]) > SHARE, axis=1)
        for joint in model.scene.joint
    }


def _singular_values(matrices: np.ndarray) -> np.ndarray:
    return np.asarray(np.linalg.svd(matrices, compute_uv=False))


def _acted_on(model: Model) -> tuple[np.ndarray, np.ndarray]:
    """The body of each joint in whose coordinates its wrench is read, and its place, 0 or 1, in the joint."""
    pairs = np.array([tuple(map(model.index, joint.bodies)) for joint in model.scene.joint], dtype=int)
    pairs = pairs.reshape(-1, 2)
    side = (pairs[:, 1] < model.nb).astype(int)
    return pairs[np.arange(len(pairs)), side], side
