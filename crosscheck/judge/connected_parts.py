"""Gauss's principle for mechanisms of any size: connected parts one by one, each by one QR factorisation with
pivoting, whose cost is a small fraction of the cost of singular values."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.linalg import qr, solve_triangular
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from crosscheck.judge.constraints import inertia_matrices, initial_poses, jacobian, scene_length
from crosscheck.judge.gauss_motion import has_singular_mass
from crosscheck.judge.gauss_principle import bias, gauss, unbound
from crosscheck.judge.tolerances import RANK
from mbref import rotations
from mbref.scene import Scene


class Part(NamedTuple):
    """Part of a mechanism that no joint connects with the rest: its columns of the Jacobian, and its rows."""

    columns: np.ndarray
    rows: np.ndarray


class Rows(NamedTuple):
    """Factors of constraint rows J (m, n) of rank r: J[order[:r]] = triangle.T @ basis.T.

    ``basis`` (n, r) is orthonormal. ``clearance`` is the least pivot over the largest one, for rows of unit
    length: a measure of the distance from singular positions.
    """

    basis: np.ndarray
    triangle: np.ndarray
    order: np.ndarray
    sizes: np.ndarray
    clearance: float

    @property
    def rank(self) -> int:
        return self.basis.shape[1]

    def solved(self, wanted: np.ndarray) -> np.ndarray:
        """Return x (n,) of least norm with J x = wanted (m,) in the independent rows."""
        first = (wanted / self.sizes)[self.order[: self.rank]]
        found: np.ndarray = self.basis @ solve_triangular(self.triangle, first, trans="T")
        return found


def parts(rows: np.ndarray) -> Iterator[Part]:
    """Return the parts of a mechanism whose Jacobian (m, 6 nb) is ``rows``: bodies that rows connect."""
    touched = np.abs(rows).reshape(len(rows), rows.shape[1] // 6, 6).max(axis=2) > 0
    count, label = connected_components(csr_array(touched.T.astype(float) @ touched), directed=False)
    of_row = label[touched.argmax(axis=1)]
    for k in range(count):
        yield Part(np.flatnonzero(np.repeat(label == k, 6)), np.flatnonzero(of_row == k))


def factored(rows: np.ndarray) -> Rows:
    """Return the factors of constraint rows (m, n); pivots below RANK of the largest belong to redundant
    rows."""
    sizes = np.linalg.norm(rows, axis=1)
    sizes = np.where(sizes > 0, sizes, 1.0)
    if not len(rows):
        return Rows(np.zeros((rows.shape[1], 0)), np.zeros((0, 0)), np.zeros(0, int), sizes, 1.0)
    basis, triangle, order = qr((rows / sizes[:, None]).T, mode="economic", pivoting=True)
    pivots = np.abs(np.diag(triangle))
    r = int(np.sum(pivots > RANK * pivots[0]))
    return Rows(basis[:, :r], triangle[:r, :r], order, sizes, float(pivots[r - 1] / pivots[0]))


def least_constraint(scene: Scene) -> np.ndarray:
    """Return accelerations at t = 0 by Gauss's principle in the form of `stacked`; bodies must have masses.

    Singular mass matrices, and armatures, which couple bodies, need the singular values of `gauss`.
    """
    if has_singular_mass(scene) or any(joint.reflected_inertia for joint in scene.joint):
        return gauss(scene)
    pose = initial_poses(scene)
    turn = rotations.to_matrix(pose[1])
    inertia = turn @ inertia_matrices(scene) @ np.swapaxes(turn, 1, 2)
    inverses = np.zeros((len(turn), 6, 6))  # W⁻¹ with WᵀW the mass matrix
    inverses[:, :3, :3] = np.eye(3) / np.sqrt([body.mass or 1.0 for body in scene.body])[:, None, None]
    inverses[:, 3:, 3:] = np.linalg.inv(np.swapaxes(np.linalg.cholesky(inertia), 1, 2))
    free = np.einsum("bji,bj->bi", inverses, unbound(scene)[1].reshape(-1, 6)).ravel()
    rows = jacobian(scene, 0.0, *pose)[0]
    weighted = np.einsum("rbi,bij->rbj", rows.reshape(len(rows), len(turn), 6), inverses).reshape(rows.shape)
    wanted = -bias(scene) - weighted @ free
    for part in parts(rows):
        held = factored(weighted[np.ix_(part.rows, part.columns)])
        free[part.columns] += held.solved(wanted[part.rows])
    found = np.einsum("bij,bj->bi", inverses, free.reshape(-1, 6))
    return np.concatenate([found[:, :3], scene_length(scene) * found[:, 3:]])
