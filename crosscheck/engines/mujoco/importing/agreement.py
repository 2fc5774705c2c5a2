"""Comparison of a scene with the compiled model from which it was read, in the model's joint coordinates.

Poses and velocities of the scene's bodies come from the model's kinematics. Masses, weight, springs and rows
of joints come from the scene alone, with the judge's equations. B is the Jacobian of the bodies' twists, and
Bᵀ M B their mass matrix in joint coordinates.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from crosscheck.engines.mujoco.importing.groups import Groups
from crosscheck.engines.mujoco.importing.left_out import joint_name
from crosscheck.engines.mujoco.importing.posing import Poses
from crosscheck.engines.mujoco.importing.wrenches import pushes
from crosscheck.judge.constraints import closure, inertia_matrices, jacobian
from crosscheck.judge.joint_coordinates import reflected
from mbref import rotations
from mbref.scene import Scene, SceneError

AGREE = 1e-8  # largest difference / largest entry; rounding of inertias and poses leaves less than 1e-10
RANK = 1e-8  # fraction of the largest singular value of rows of length one
BLURRED = 1e3  # factor on RANK within which a singular value may be rounding of the axes in the file
SHORT = 1e-2  # of rad and of the extent: shorter rows, which may be rounding, are not made length one
CANCELLED = 1e-4  # of the extent in m: rows shorter than it may be rounding of coordinates as large
RANDOM_POSES = 2
TRIES = 12  # random poses tried for each comparison, since not every pose can be closed
REACH = 0.25  # rad, or fraction of the extent: largest change of a coordinate in a random pose


class Agreement:
    """Comparison at the poses of a model; every method raises SceneError that names the part."""

    def __init__(self, mujoco: Any, model: Any, groups: Groups, poses: Poses):
        self.mujoco, self.model, self.groups, self.poses = mujoco, model, groups, poses
        bits = mujoco.mjtDisableBit
        model.opt.disableflags |= bits.mjDSBL_CONTACT | bits.mjDSBL_LIMIT | bits.mjDSBL_FRICTIONLOSS
        model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE

    def check(self, scene: Scene, tree: Sequence[str]) -> None:
        """Compare at the pose of the scene and at random closed poses; ``tree`` names the tree's joints."""
        start, random = self.poses.data.qpos.copy(), np.random.default_rng(0)
        self._at_pose(scene, tree, random)
        for _ in range(RANDOM_POSES):
            if self._random_pose(start, random):
                self._at_pose(scene, tree, random)
        self.poses.data.qpos[:] = start
        self.poses.place()

    def _random_pose(self, start: np.ndarray, random: np.random.Generator) -> bool:
        """Move to a random closed pose near the start; returns False if none was found."""
        data, reach = self.poses.data, REACH * self.poses.scale
        for k in range(TRIES):
            data.qpos[:] = start
            step = random.uniform(-reach, reach, self.model.nv) * 0.7**k
            self.mujoco.mj_integratePos(self.model, data.qpos, step, 1.0)
            self.poses.place()
            try:
                self.poses.close()
            except SceneError:
                continue
            return True
        return False

    def _at_pose(self, scene: Scene, tree: Sequence[str], random: np.random.Generator) -> None:
        data = self.poses.data
        data.qvel[:] = random.uniform(-1.0, 1.0, self.model.nv)
        self.mujoco.mj_tendon(self.model, data)
        self.mujoco.mj_makeConstraint(self.model, data)
        self.mujoco.mj_transmission(self.model, data)
        self.mujoco.mj_fwdVelocity(self.model, data)
        self.mujoco.mj_fwdActuation(self.model, data)
        placed = [self.groups.placed(data, g) for g in self.groups.pieces]
        pose = np.array([p.position for p in placed]), np.array([p.orientation for p in placed])
        twists = np.vstack([p.jacobian for p in placed])
        self._masses(scene, pose, twists)
        self._forces(scene, pose, twists)
        self._tree(scene, tree, pose, twists)
        self._loops(scene, tree, pose, twists)

    def _masses(self, scene: Scene, pose: tuple[np.ndarray, np.ndarray], twists: np.ndarray) -> None:
        still = np.zeros_like(pose[0])
        mass = _masses(scene, pose[1]) + reflected(scene, *pose, still, still).mass
        ours = twists.T @ mass @ twists
        if np.abs(ours).max() == 0.0:
            joint = joint_name(self.model, int(self.model.dof_jntid[0]))
            raise SceneError([f"joint {joint}: its bodies have no inertia about or along its axis"])
        self._same(ours, self.poses.mass(), "mass matrix")

    def _forces(self, scene: Scene, pose: tuple[np.ndarray, np.ndarray], twists: np.ndarray) -> None:
        """Compare bias forces, with weight and springs."""
        data = self.poses.data
        motion = (twists @ data.qvel).reshape(-1, 6)
        drift, armatures = self._drift(), reflected(scene, *pose, motion[:, :3], motion[:, 3:])
        mass = _masses(scene, pose[1])
        inertial = _inertial(mass, motion, drift) + armatures.mass @ drift - armatures.force
        forces = inertial - pushes(scene, pose, motion)
        parts = np.abs(forces) + _gyroscopic(mass, motion)
        largest = (np.abs(twists).T @ parts).max()  # of parts that may cancel
        theirs = data.qfrc_bias - data.qfrc_passive - data.qfrc_actuator
        self._same(twists.T @ forces, theirs, "bias forces", largest)

    def _drift(self) -> np.ndarray:
        """Return the accelerations (6 nb,) of the bodies' twists at constant joint velocities: Ḃ q̇."""
        return np.concatenate([self.groups.drift(self.poses.data, piece) for piece in self.groups.pieces])

    def _same(self, ours: np.ndarray, theirs: np.ndarray, what: str, largest: float = 0.0) -> None:
        scale = max(np.abs(theirs).max(), np.abs(ours).max(), largest)
        apart = np.atleast_2d(np.abs(ours - theirs).T).max(axis=0)
        if (worst := apart.max()) > AGREE * scale:
            joint = joint_name(self.model, int(self.model.dof_jntid[int(apart.argmax())]))
            raise SceneError(
                [
                    f"joint {joint}: the scene's {what} and the file's differ by {worst / scale:.3g} "
                    "of the largest entry"
                ]
            )

    def _tree(
        self, scene: Scene, tree: Sequence[str], pose: tuple[np.ndarray, np.ndarray], twists: np.ndarray
    ) -> None:
        """Check that the joints of the tree hold at every pose, and allow only the motion of the joint
        coordinates."""
        bare = scene.with_(joint=[j for j in scene.joint if j.name in tree], coupling=(), driver=())
        for name, residual in closure(bare, 0.0, *pose).items():
            if (gap := np.abs(residual).max(initial=0.0)) > AGREE * max(1.0, self.poses.extent):
                raise SceneError(
                    [f"joint {name!r}: the file's motion violates the scene's joint by {gap:.3g}"]
                )
        rows, _ = jacobian(bare, 0.0, *pose)
        moved = np.abs(rows @ twists).max(axis=1, initial=0.0)
        if moved.max(initial=0.0) > AGREE * max(1.0, self.poses.extent):
            raise SceneError(["the scene's joints forbid motion that the file's joints allow"])
        sizes = np.tile(np.repeat([self.poses.extent, 1.0], 3), len(scene.body))
        rows, moves = rows * sizes, twists / sizes[:, None] * self.poses.scale
        free, own = rows.shape[1] - rank(_unit(rows, 0.0)), rank(moves)
        if free != own:
            raise SceneError([f"the scene's joints allow {free} motions without loops, the file's {own}"])

    def _loops(
        self, scene: Scene, tree: Sequence[str], pose: tuple[np.ndarray, np.ndarray], twists: np.ndarray
    ) -> None:
        """Check that rows of loops and of locked coordinates have the row space of the file's rows, in joint
        coordinates."""
        scale = self.poses.scale
        least = max(SHORT * min(1.0, self.poses.extent), CANCELLED * self.poses.extent)
        ours = _unit(jacobian(scene, 0.0, *pose)[0] @ twists * scale, least)
        theirs = _unit(np.vstack([self._equalities(), self.poses.jacobian()]) * scale, least)
        ranks = _ranks(ours, theirs)
        if len(set(ranks)) > 1:
            raise SceneError(
                [f"loops: the scene's rows have rank {ranks[0]}, the file's {ranks[1]}, together {ranks[2]}"]
            )

    def _equalities(self) -> np.ndarray:
        """Return MuJoCo's rows (m, nv) of the equalities that the scene has."""
        data, model = self.poses.data, self.model
        rows = data.efc_type[: data.nefc] == self.mujoco.mjtConstraint.mjCNSTR_EQUALITY
        return np.asarray(data.efc_J[: data.nefc * model.nv].reshape(data.nefc, model.nv)[rows])


def rank(rows: np.ndarray) -> int:
    """Return the number of independent rows."""
    if not rows.size:
        return 0
    sizes = np.linalg.svd(rows, compute_uv=False)
    return int(np.sum(sizes > RANK * sizes[0]))


def _unit(rows: np.ndarray, least: float) -> np.ndarray:
    """Return rows over their length, or over ``least`` if they are shorter."""
    return np.asarray(rows / np.maximum(np.linalg.norm(rows, axis=1), least)[:, None])


def _ranks(ours: np.ndarray, theirs: np.ndarray) -> tuple[int, int, int]:
    """Return the ranks of both sets of rows, of length one at most, and of all rows together.

    Axes that rounding alone turns out of parallel leave singular values of its size, which differ between
    both sets. Therefore one limit serves all three ranks: the middle of the widest gap between the
    singular values near RANK.
    """
    values = [np.linalg.svd(m, compute_uv=False) if m.size else np.zeros(0) for m in (ours, theirs)]
    both = np.vstack([ours, theirs])
    values.append(np.linalg.svd(both, compute_uv=False) if both.size else np.zeros(0))
    low, high = RANK / BLURRED, RANK * BLURRED
    near = [float(v) for v in np.concatenate(values) if low < v < high]
    marks = np.log(sorted([low, *near, high]))
    widest = int(np.argmax(np.diff(marks)))
    limit = float(np.exp((marks[widest] + marks[widest + 1]) / 2))
    first, second, third = (int(np.sum(v > limit)) for v in values)
    return first, second, third


def _masses(scene: Scene, orientation: np.ndarray) -> np.ndarray:
    """Return the mass matrix (6 nb, 6 nb) of the twists of the centres of mass, world."""
    found = np.zeros((6 * len(scene.body),) * 2)
    turns = rotations.to_matrix(orientation)
    for k, (mass, inertia) in enumerate(zip(_body_masses(scene), inertia_matrices(scene), strict=True)):
        found[6 * k : 6 * k + 3, 6 * k : 6 * k + 3] = mass * np.eye(3)
        found[6 * k + 3 : 6 * k + 6, 6 * k + 3 : 6 * k + 6] = turns[k] @ inertia @ turns[k].T
    return found


def _body_masses(scene: Scene) -> np.ndarray:
    """Return the masses (nb,), which all bodies of a file have."""
    return np.array([body.mass for body in scene.body], float)


def _gyroscopic(mass: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Return |ω| |J ω| for each moment (6 nb,); the moment ω × J ω of a ball is rounding of this size."""
    found = np.zeros_like(motion)
    spin = np.concatenate([found[:, :3], motion[:, 3:]], axis=1)
    momentum = (mass @ spin.ravel()).reshape(-1, 6)
    found[:, 3:] = (np.linalg.norm(spin, axis=1) * np.linalg.norm(momentum, axis=1))[:, None]
    return found.ravel()


def _inertial(mass: np.ndarray, motion: np.ndarray, drift: np.ndarray) -> np.ndarray:
    """Return M Ḃ q̇ and the gyroscopic moments (6 nb,)."""
    found = (mass @ drift).reshape(-1, 6)
    for k, twist in enumerate(motion):
        inertia = mass[6 * k + 3 : 6 * k + 6, 6 * k + 3 : 6 * k + 6]
        found[k, 3:] += np.cross(twist[3:], inertia @ twist[3:])
    return found.reshape(-1)
