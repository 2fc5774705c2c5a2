"""Joint reactions from Lagrange multipliers: -Φ_qᵀ λ of a joint's rows, moved to its anchor."""

from __future__ import annotations

import numpy as np

from mbref import rotations
from mbref.equations.model import Model
from mbref.equations.units import row_lengths

MOST_ROWS = 120  # singular values of more rows at every sample take longer than the run
OPEN = 1e-6  # singular value, to the largest, of a combination of unit rows that counts as vanished
SHARE = 1e-6  # weight of a joint in such a combination below which it takes no part


def reactions(
    model: Model, q: np.ndarray, blocks: np.ndarray, multipliers: np.ndarray
) -> dict[str, np.ndarray] | None:
    """Per joint force (N) and moment (N m) (k, 6) on its second body at the anchor, world axes.

    From q (k, nb, 7), the blocks (k, m, 12) of Φ_q and λ (k, m); None where the scene has no masses.
    """
    if model.kinematic:
        return None
    names = [joint.name for joint in model.scene.joint]
    if not names:
        return {}
    body, side = _acted_on(model)
    of = np.array([names.index(name) for name in model.row_joint if name in names], dtype=int)
    rows, sign = np.arange(of.size), np.where(side == 1, -1.0, 1.0)[of]
    pulls = blocks.reshape(len(q), model.m, 2, 6)[:, rows, side[of]]
    starts = np.searchsorted(of, np.arange(len(names)))  # the rows of a joint stand together, in its order
    wrench = np.add.reduceat((sign * multipliers[:, rows])[..., None] * pulls, starts, axis=1)
    pose, force = q[:, body], wrench[..., :3]  # about the centre of mass, moments in body axes
    arm = model.anchors(q) - pose[..., :3]
    moment = rotations.rotate(pose[..., 3:], wrench[..., 3:]) - np.cross(arm, force)
    found = np.concatenate([force, moment], axis=-1)
    return {name: found[:, j] for j, name in enumerate(names)}


def open_dimensions(model: Model, blocks: np.ndarray) -> dict[str, np.ndarray] | None:
    """Per joint the dimensions (k,) of its reaction that equilibrium does not determine at each sample.

    Redundant rows leave reactions open always, a singular position where the motion passes it: there a
    combination of rows vanishes, a left null vector of Φ_q (Wojtyra, J. Theor. Appl. Mech. 43, 2005).  From
    the blocks (k, m, 12) of Φ_q; None where the scene has no masses, or more than MOST_ROWS rows.
    """
    if model.kinematic or model.m > MOST_ROWS:
        return None
    jacobian = model.dense(blocks)
    left, values, _ = np.linalg.svd(jacobian / row_lengths(jacobian)[..., None])
    rank = np.sum(values > OPEN * values.max(axis=1, initial=0.0)[:, None], axis=1)
    least = int(rank.min(initial=model.m))
    vanishing = (left * (np.arange(model.m) >= rank[:, None])[:, None, :])[..., least:]
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
