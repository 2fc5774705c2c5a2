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
from crosscheck.judge.constraints import closure, inertia_matrices, jacobian
from crosscheck.judge.joint_coordinates import reflected
from mbref import rotations
from mbref.scene import Scene, SceneError

AGREE = 1e-8  # largest difference / largest entry; rounding of inertias and poses leaves less than 1e-10
RANK = 1e-8  # fraction of the largest singular value of rows of length one
RANDOM_POSES = 2
TRIES = 12  # random poses tried for each comparison, since not every pose can be closed
REACH = 0.25  # rad, and fraction of the extent: largest change of a coordinate in a random pose


class Agreement:
    """Comparison at the poses of a model; every method raises SceneError that names the part."""

    def __init__(self, mujoco: Any, model: Any, groups: Groups, poses: Poses):
        self.mujoco, self.model, self.groups, self.poses = mujoco, model, groups, poses
        bits = mujoco.mjtDisableBit
        model.opt.disableflags |= bits.mjDSBL_CONTACT | bits.mjDSBL_LIMIT | bits.mjDSBL_FRICTIONLOSS
        model.opt.disableflags |= bits.mjDSBL_ACTUATION
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
        data, reach = self.poses.data, REACH * min(1.0, self.poses.extent)
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
        self.mujoco.mj_fwdVelocity(self.model, data)
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
        forces = inertial - _pushes(scene, pose, motion)
        parts = np.abs(forces) + _gyroscopic(mass, motion)
        largest = (np.abs(twists).T @ parts).max()  # of parts that may cancel
        self._same(twists.T @ forces, data.qfrc_bias - data.qfrc_passive, "bias forces", largest)

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
        free, own = rows.shape[1] - rank(rows), rank(twists)
        if free != own:
            raise SceneError([f"the scene's joints allow {free} motions without loops, the file's {own}"])

    def _loops(
        self, scene: Scene, tree: Sequence[str], pose: tuple[np.ndarray, np.ndarray], twists: np.ndarray
    ) -> None:
        """Check that rows of loops and of locked coordinates have the row space of the file's rows, in joint
        coordinates."""
        ours = jacobian(scene, 0.0, *pose)[0] @ twists
        theirs = np.vstack([self._equalities(), self.poses.jacobian()])
        least = RANK * min(1.0, self.poses.extent)
        ours, theirs = _unit(ours, least), _unit(theirs, least)
        ranks = rank(ours), rank(theirs), rank(np.vstack([ours, theirs]))
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
    """Return rows of length one, without rows that are not longer than ``least``."""
    sizes = np.linalg.norm(rows, axis=1)
    return np.asarray(rows[sizes > least] / sizes[sizes > least, None])


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


def _pushes(scene: Scene, pose: tuple[np.ndarray, np.ndarray], motion: np.ndarray) -> np.ndarray:
    """Return weight and forces of the scene's springs (6 nb,); actuators are off in the comparison."""
    found = np.zeros((len(scene.body) + 1, 6))  # the last entry is the ground's
    found[:-1, :3] = np.outer(_body_masses(scene), np.array(scene.gravity))
    actions = {"spring": _spring, "torsion_spring": _torsion, "slide_spring": _slide}
    for load in scene.load:
        if action := actions.get(load.type):
            for body, wrench in action(scene, load, pose, motion):
                found[body] += wrench
    return found[:-1].reshape(-1)


def _spring(scene: Scene, load: Any, pose: Any, motion: np.ndarray) -> list[tuple[int, np.ndarray]]:
    bodies = [scene.body_index(name) for name in load.bodies]
    places, rates = _points(scene, pose, motion, bodies, load.points)
    apart = places[1] - places[0]
    length = np.linalg.norm(apart)
    along = apart / length
    pull = load.stiffness * (length - load.natural_length) + load.damping * along @ (rates[1] - rates[0])
    return _wrenches(pose, bodies, places, pull * along)


def _points(scene: Scene, pose: Any, motion: np.ndarray, bodies: Sequence[int], points: Any) -> Any:
    """Return positions and velocities, world, of a point of each body, given at the scene's pose."""
    places, rates = [], []
    for b, point in zip(bodies, np.array(points), strict=True):
        if b < 0:
            places.append(point)
            rates.append(np.zeros(3))
            continue
        arm = _turn(scene, pose, b) @ (point - scene.body[b].position)
        places.append(pose[0][b] + arm)
        rates.append(motion[b, :3] + np.cross(motion[b, 3:], arm))
    return places, rates


def _wrenches(
    pose: Any, bodies: Sequence[int], places: Sequence[np.ndarray], force: np.ndarray
) -> list[tuple[int, np.ndarray]]:
    """Return the wrenches about the bodies' centres of a force on the first body and its opposite on the
    second one."""
    centres = np.vstack([pose[0], np.zeros(3)])  # the last one is the ground's
    return [
        (b, np.concatenate([sign * force, np.cross(place - centres[b], sign * force)]))
        for b, place, sign in zip(bodies, places, (1, -1), strict=True)
    ]


def _torsion(scene: Scene, load: Any, pose: Any, motion: np.ndarray) -> list[tuple[int, np.ndarray]]:
    joint = scene.joint_named(load.joint)
    bodies = [scene.body_index(name) for name in joint.bodies]
    turns = [np.eye(3) if b < 0 else _turn(scene, pose, b) for b in bodies]
    start = np.array(joint.directions[0]) / np.linalg.norm(joint.directions[0])
    axis = turns[0] @ start
    q = rotations.from_matrix(turns[0].T @ turns[1])
    angle = 2 * np.arctan2(q[1:] @ start, q[0])
    rates = [np.zeros(3) if b < 0 else motion[b, 3:] for b in bodies]
    moment = load.stiffness * (angle - load.natural_angle) + load.damping * axis @ (rates[1] - rates[0])
    return [
        (b, np.concatenate([np.zeros(3), sign * moment * axis]))
        for b, sign in zip(bodies, (1, -1), strict=True)
    ]


def _slide(scene: Scene, load: Any, pose: Any, motion: np.ndarray) -> list[tuple[int, np.ndarray]]:
    joint = scene.joint_named(load.joint)
    bodies = [scene.body_index(name) for name in joint.bodies]
    turn = np.eye(3) if bodies[0] < 0 else _turn(scene, pose, bodies[0])
    axis = turn @ np.array(joint.directions[0]) / np.linalg.norm(joint.directions[0])
    places, rates = _points(scene, pose, motion, bodies, joint.anchor_pair)
    apart, spin = places[1] - places[0], np.zeros(3) if bodies[0] < 0 else motion[bodies[0], 3:]
    rate = axis @ (rates[1] - rates[0]) + np.cross(spin, axis) @ apart
    push = (load.stiffness * (axis @ apart - load.natural_displacement) + load.damping * rate) * axis
    return _wrenches(pose, bodies, [places[1]] * 2, push)


def _turn(scene: Scene, pose: Any, b: int) -> np.ndarray:
    """Return the rotation (3, 3) of a body since the scene's pose."""
    start = rotations.to_matrix(np.array(scene.body[b].orientation))
    return np.asarray(rotations.to_matrix(pose[1][b]) @ start.T)
