"""Bodies of a compiled model that are fixed to each other, merged into one body of a scene."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np

from crosscheck.engines.mujoco.drift import drift
from crosscheck.engines.shared.entries import entry
from mbref import rotations
from mbref.scene import GROUND, Body

WORLD = 0  # MuJoCo's number of the world, and of the group that is fixed to it
PLAIN = 1e-15  # product of inertia / largest moment; smaller products are rounding


@dataclass(frozen=True)
class Piece:
    """A body of the scene: a group, or a massless link that moves with the first joints of a group.

    ``last`` is MuJoCo's number of the last joint that moves the link, or -1 for the group, which all move.
    """

    group: int
    last: int = -1


@dataclass(frozen=True)
class Placed:
    """Centre of mass (3,), orientation (4,) and twist Jacobian (6, nv), world, of a group at a pose."""

    position: np.ndarray
    orientation: np.ndarray
    jacobian: np.ndarray


class Groups:
    """Groups of bodies that no joint separates; the key of a group is the number of its first body."""

    def __init__(self, mujoco: Any, model: Any):
        self.mujoco, self.model = mujoco, model
        mocaps = np.flatnonzero(model.body_mocapid >= 0)  # no joint moves them
        self.of = np.where(np.isin(model.body_weldid, mocaps), WORLD, model.body_weldid).astype(int)
        self.members: dict[int, list[int]] = {}
        for b in range(model.nbody):
            self.members.setdefault(int(self.of[b]), []).append(b)
        self.mass = {g: float(model.body_mass[m].sum()) for g, m in self.members.items()}
        self.mass[WORLD] = np.inf
        self.names = {g: self._name(g) for g in self.members}
        self.pieces = [Piece(g) for g in self.massive]  # the bodies of the scene, carrying ones first
        self.rotors: dict[int, float] = {}  # armatures (kg m²) in the inertias of groups on ball joints

    @property
    def massive(self) -> list[int]:
        """Return the groups with mass, without the world."""
        return [g for g in self.members if g != WORLD and self.mass[g] > 0]

    def keep(self, groups: Collection[int], last: Collection[int]) -> None:
        """Make groups without mass bodies of the scene, and links that some joints are the last to move."""
        found: list[Piece] = []
        for g in self.members:
            found += [Piece(g, j) for j in self.joints(g) if j in last]
            if g in groups or Piece(g) in self.pieces:
                found.append(Piece(g))
        self.pieces = found

    def name(self, piece: Piece) -> str:
        """Return the name of the scene's body: for a link, with the name or number of its last joint."""
        if piece.last < 0:
            return self.names[piece.group]
        joint = self.model.joint(piece.last).name or str(piece.last - self.joints(piece.group)[0] + 1)
        return f"{self.names[piece.group]} link {joint}"

    def parent(self, group: int) -> int:
        """Return the group that carries a group."""
        return int(self.of[self.model.body_parentid[group]])

    def children(self, group: int) -> list[int]:
        """Return the groups that a group carries."""
        return [g for g in self.members if g != WORLD and self.parent(g) == group]

    def joints(self, group: int) -> list[int]:
        """Return MuJoCo's joints between a group and its parent, in order."""
        first = int(self.model.body_jntadr[group])
        return list(range(first, first + int(self.model.body_jntnum[group])))

    def name_of(self, body: int) -> str:
        """Return the scene's body that contains MuJoCo's body."""
        return self.names[int(self.of[body])]

    def main(self, group: int) -> int:
        """Return the body that gives a group its name: the first body if it has mass, otherwise the heaviest
        body."""
        masses = self.model.body_mass
        heaviest = max(self.members[group], key=lambda b: float(masses[b]))
        return group if masses[group] > 0 else int(heaviest)

    def _name(self, group: int) -> str:
        if group == WORLD:
            return GROUND
        b = self.main(group)
        name = self.model.body(b).name or f"body {b}"
        return f"{name} {b}" if name == GROUND else name

    def placed(self, data: Any, piece: Piece) -> Placed:
        """Return a body of the scene at the pose of the data, whose kinematics and centres MuJoCo has
        computed."""
        group = piece.group
        if piece.last < 0:
            orientation = data.xquat[self.main(group)].copy()
        else:
            orientation = self._orientation(data, piece)
        centre = self._centre(data, piece)
        jacobian = np.zeros((6, self.model.nv))
        self.mujoco.mj_jac(self.model, data, jacobian[:3], jacobian[3:], centre, group)
        jacobian[:, self._later(piece)] = 0.0
        return Placed(centre, orientation, jacobian)

    def drift(self, data: Any, piece: Piece) -> np.ndarray:
        """Return the acceleration (6,) of a body of the scene at constant joint velocities."""
        velocities, later = data.qvel.copy(), self._later(piece)
        if later:  # joints that do not move the link are at rest
            data.qvel[later] = 0.0
            self.mujoco.mj_comVel(self.model, data)
        found = drift(self.model, data, piece.group, self._centre(data, piece))
        if later:
            data.qvel[:] = velocities
            self.mujoco.mj_comVel(self.model, data)
        return found

    def _later(self, piece: Piece) -> list[int]:
        """Return the indices of the velocities of a group's joints that do not move the piece."""
        if piece.last < 0:
            return []
        after = [j for j in self.joints(piece.group) if j > piece.last]
        return np.flatnonzero(np.isin(self.model.dof_jntid, after)).tolist()

    def _centre(self, data: Any, piece: Piece) -> np.ndarray:
        """Return the centre of mass (3,), or the next joint's anchor for a link, world."""
        members = self.members[piece.group]
        masses = self.model.body_mass[members]
        if piece.last >= 0:
            return np.array(data.xanchor[piece.last + 1])
        if not masses.sum() > 0:
            return np.array(data.xpos[piece.group])
        return np.asarray(masses @ data.xipos[members] / masses.sum())

    def _orientation(self, data: Any, piece: Piece) -> np.ndarray:
        """Return the orientation (4,) of a link: the group's, without the rotations of later joints."""
        found, kinds = data.xquat[piece.group].copy(), self.mujoco.mjtJoint
        for j in reversed([j for j in self.joints(piece.group) if j > piece.last]):
            kind, q = self.model.jnt_type[j], int(self.model.jnt_qposadr[j])
            if kind == kinds.mjJNT_HINGE:
                angle = data.qpos[q] - self.model.qpos0[q]
                found = rotations.multiply(found, rotations.from_vector(-angle * self.model.jnt_axis[j]))
            elif kind == kinds.mjJNT_BALL:
                found = rotations.multiply(found, data.qpos[q : q + 4] * (1, -1, -1, -1))
        return np.asarray(found)

    def body(self, data: Any, piece: Piece, twist: np.ndarray | None) -> Body:
        """Return a body of the scene, with the velocities of a twist (6,) if the caller gives a twist."""
        at, group = self.placed(data, piece), piece.group
        mass = 0.0 if piece.last >= 0 else self.mass[group]
        turn = rotations.to_matrix(at.orientation)
        inertia = turn.T @ self._inertia(data, group, at.position) @ turn if mass else np.zeros((3, 3))
        inertia = (inertia + inertia.T) / 2
        plain = np.abs(inertia - np.diag(np.diag(inertia))).max() <= PLAIN * np.abs(inertia).max()
        return entry(
            f"body {self.name(piece)!r}",
            Body,
            name=self.name(piece),
            mass=mass,
            inertia=(np.diag(inertia) if plain else inertia).tolist(),
            position=at.position.tolist(),
            orientation=at.orientation.tolist(),
            velocity=None if twist is None else twist[:3].tolist(),
            angular_velocity=None if twist is None else twist[3:].tolist(),
        )

    def _inertia(self, data: Any, group: int, centre: np.ndarray) -> np.ndarray:
        """Return the world inertia (3, 3) about the group's centre of mass, by Steiner's theorem."""
        total = self.rotors.get(group, 0.0) * np.eye(3)
        for b in self.members[group]:
            axes, arm = data.ximat[b].reshape(3, 3), data.xipos[b] - centre
            total += axes @ np.diag(self.model.body_inertia[b]) @ axes.T
            total += self.model.body_mass[b] * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        return total
