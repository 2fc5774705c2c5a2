"""Bodies of a compiled model that are fixed to each other, merged into one body of a scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mbref import rotations
from mbref.scene import GROUND, Body

WORLD = 0  # MuJoCo's number of the world, and of the group that is fixed to it
PLAIN = 1e-15  # product of inertia / largest moment; smaller products are rounding


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

    @property
    def massive(self) -> list[int]:
        """Return the groups with mass, without the world: the bodies of the scene."""
        return [g for g in self.members if g != WORLD and self.mass[g] > 0]

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

    def placed(self, data: Any, group: int) -> Placed:
        """Return a group at the pose of the data, whose kinematics and centres MuJoCo has computed."""
        masses = self.model.body_mass[self.members[group]]
        centre = masses @ data.xipos[self.members[group]] / masses.sum()
        jacobian = np.zeros((6, self.model.nv))
        self.mujoco.mj_jac(self.model, data, jacobian[:3], jacobian[3:], centre, group)
        return Placed(centre, data.xquat[self.main(group)].copy(), jacobian)

    def body(self, data: Any, group: int, twist: np.ndarray | None) -> Body:
        """Return a group as a body of a scene, with the velocities of a twist (6,) if the caller gives a
        twist."""
        at = self.placed(data, group)
        turn = rotations.to_matrix(at.orientation)
        inertia = turn.T @ self._inertia(data, group, at.position) @ turn
        inertia = (inertia + inertia.T) / 2
        plain = np.abs(inertia - np.diag(np.diag(inertia))).max() <= PLAIN * np.abs(inertia).max()
        return Body(
            name=self.names[group],
            mass=self.mass[group],
            inertia=(np.diag(inertia) if plain else inertia).tolist(),
            position=at.position.tolist(),
            orientation=at.orientation.tolist(),
            velocity=None if twist is None else twist[:3].tolist(),
            angular_velocity=None if twist is None else twist[3:].tolist(),
        )

    def _inertia(self, data: Any, group: int, centre: np.ndarray) -> np.ndarray:
        """Return the world inertia (3, 3) about the group's centre of mass, by Steiner's theorem."""
        total = np.zeros((3, 3))
        for b in self.members[group]:
            axes, arm = data.ximat[b].reshape(3, 3), data.xipos[b] - centre
            total += axes @ np.diag(self.model.body_inertia[b]) @ axes.T
            total += self.model.body_mass[b] * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        return total
