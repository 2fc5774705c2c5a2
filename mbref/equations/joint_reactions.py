"""Joint reactions from Lagrange multipliers: -Φ_qᵀ λ of a joint's rows, moved to its anchor."""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from mbref import rotations
from mbref.equations.model import Model
from mbref.equations.structure import MOST_KEPT, Structure
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
    names = tuple(joint.name for joint in model.scene.joint)
    if not names:
        return {}
    body, side, of, starts = _places(model.structure, names)
    rows, sign = np.arange(of.size), np.where(side == 1, -1.0, 1.0)[of]
    pulls = blocks.reshape(len(q), model.m, 2, 6)[:, rows, side[of]]
    wrench = np.add.reduceat((sign * multipliers[:, rows])[..., None] * pulls, starts, axis=1)
    pose, force = q[:, body], wrench[..., :3]  # about the centre of mass, moments in body axes
    arm = model.anchors(q) - pose[..., :3]
    moment = rotations.rotate(pose[..., 3:], wrench[..., 3:]) - rotations.cross(arm, force)
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
    names = tuple(joint.name for joint in model.scene.joint)
    _, _, of, starts = _places(model.structure, names)
    ends = [*starts, of.size][1:]
    return {
        name: np.sum(_singular_values(vanishing[:, first:end]) > SHARE, axis=1)
        for name, first, end in zip(names, starts, ends, strict=True)
    }


def _singular_values(matrices: np.ndarray) -> np.ndarray:
    """Those (k, …) of matrices (k, r, c): the length of a single column."""
    if matrices.shape[-1] < 2:
        return np.sqrt((matrices * matrices).sum(axis=1))
    return np.asarray(np.linalg.svd(matrices, compute_uv=False))


class Places(NamedTuple):
    """Of every joint the body in whose coordinates its wrench is read, its place, 0 or 1, and its rows."""

    body: np.ndarray
    side: np.ndarray
    of: np.ndarray  # the joint of each row
    starts: np.ndarray  # the first row of each joint: those of a joint stand together, in its order


@functools.lru_cache(maxsize=MOST_KEPT)
def _places(structure: Structure, names: tuple[str, ...]) -> Places:
    """The places of joints of these names, which are the first in the structure."""
    of = np.array([names.index(name) for name in structure.row_joint if name in names], dtype=int)
    starts = np.searchsorted(of, np.arange(len(names)))
    bodies = structure.row_bodies[starts]
    side = (bodies[:, 1] < structure.nb).astype(int)
    return Places(bodies[np.arange(len(names)), side], side, of, starts)
