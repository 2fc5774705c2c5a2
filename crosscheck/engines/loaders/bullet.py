"""PyBullet's readers of URDF, SDF and MJCF."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engines.loaders.loader import MJCF, SDF, URDF, Loaded, Loader
from crosscheck.engines.loaders.machine import (
    FIXED,
    REVOLUTE,
    SCALAR,
    TRANSLATIONAL,
    WORLD,
    Body,
    Joint,
    Machine,
    Statics,
    Vector,
    coefficients,
    matrix,
    vector,
)
from crosscheck.engines.loaders.placing import Place, of_xyzw
from crosscheck.engines.loaders.posed import Pose

TYPES = {0: REVOLUTE, 1: TRANSLATIONAL, 2: "spherical", 3: "planar", 4: FIXED}  # by JOINT_*
UNLIMITED = 1e6  # rad or m, far beyond any motion
BASE = -1  # number of the base among the links


class Bullet(Loader):
    """PyBullet's loaders with the inertia of the file and a fixed base of a URDF."""

    name = "bullet"
    package = "pybullet"
    version = "3.2.7"
    formats = (URDF, SDF, MJCF)
    convention = (
        "a URDF is read with useFixedBase and URDF_USE_INERTIA_FROM_FILE, which keeps its inertias; its"
        " simulation damps the velocities of each link by 0.04 1/s"
    )

    def load(self, path: Path, form: str) -> Loaded:
        """Load the file into an own physics server."""
        import pybullet

        if pybullet.isConnected():
            pybullet.disconnect()
        pybullet.connect(pybullet.DIRECT)
        if form == URDF:
            flags = pybullet.URDF_USE_INERTIA_FROM_FILE
            bodies = [pybullet.loadURDF(str(path), useFixedBase=True, flags=flags)]
        else:
            bodies = list({SDF: pybullet.loadSDF, MJCF: pybullet.loadMJCF}[form](str(path)))
        if not bodies:
            raise ValueError("PyBullet returns no body")
        return Multibodies(pybullet, bodies, form != URDF)


class Multibodies(Loaded):
    """Multibodies at the positions 0 of their joints."""

    def __init__(self, pybullet: Any, numbers: list[int], has_gravity: bool):
        self.p, self.has_gravity = pybullet, has_gravity  # of the file's format
        self.links = [(b, j) for b in numbers for j in range(BASE, pybullet.getNumJoints(b))]
        self.start = {b: pybullet.getBasePositionAndOrientation(b) for b in numbers}
        for b, j in self.links:
            if j != BASE and self._type(b, j) in SCALAR:
                pybullet.resetJointState(b, j, 0.0)

    def _type(self, b: int, j: int) -> str:
        return TYPES[self.p.getJointInfo(b, j)[2]]

    def _link(self, b: int, j: int) -> str:
        name = self.p.getBodyInfo(b)[0] if j == BASE else self.p.getJointInfo(b, j)[12]
        return str(name.decode())

    def _inertial(self, b: int, j: int) -> Place:
        """Return the place of a link's centre of mass and principal axes."""
        if j == BASE:
            return of_xyzw(*self.p.getBasePositionAndOrientation(b))
        return of_xyzw(*self.p.getLinkState(b, j, computeForwardKinematics=True)[:2])

    def machine(self) -> Machine:
        return Machine(
            bodies=tuple(self._body(b, j) for b, j in self.links),
            joints=tuple(self._joint(b, j) for b, j in self.links),
            gravity=self._gravity() if self.has_gravity else None,
        )

    def _gravity(self) -> Vector:
        found = self.p.getPhysicsEngineParameters()
        return vector(found[f"gravityAcceleration{axis}"] for axis in "XYZ")

    def _body(self, b: int, j: int) -> Body:
        found = self.p.getDynamicsInfo(b, j)
        moments = np.diag(found[2])
        return self._inertial(b, j).body(self._link(b, j), found[0], np.zeros(3), moments)

    def _joint(self, b: int, j: int) -> Joint:
        own = self._link(b, j)
        if j == BASE:
            is_fixed = self.p.getDynamicsInfo(b, j)[0] == 0.0
            return Joint(
                f"{own} {FIXED if is_fixed else 'free'}", FIXED if is_fixed else "free", (WORLD, own)
            )
        info = self.p.getJointInfo(b, j)
        name, kind, pair = str(info[1].decode()), TYPES[info[2]], (self._link(b, info[16]), own)
        frame = of_xyzw(*self.p.getLinkState(b, j, computeForwardKinematics=True)[4:6])
        anchor = vector(frame.position)
        if kind not in SCALAR:
            axis = self._inertial(b, j).direction(info[13]) if kind == "planar" else None
            return Joint(name, kind, pair, anchor, axis)
        lower, upper = info[8:10] if info[8] <= info[9] else (-math.inf, math.inf)
        return Joint(
            name,
            kind,
            pair,
            anchor,
            self._inertial(b, j).direction(info[13]),
            lower=float(lower),
            upper=float(upper),
            damping=coefficients(info[6]),
            stiffness=(),
            armature=0.0,
            friction=float(info[7]),
            reference=0.0,
        )

    def motion(
        self, pose: Pose, rates: Pose, gravity: Vector, duration: float, step: float
    ) -> dict[str, float]:
        """Simulate with the loader's damping of links; the motors that hold each joint are off."""
        p, single = self.p, [(b, j) for b, j in self.links if j != BASE and self._type(b, j) in SCALAR]
        names = {(b, j): str(p.getJointInfo(b, j)[1].decode()) for b, j in single}
        p.setGravity(*gravity)
        p.setPhysicsEngineParameter(fixedTimeStep=step, numSubSteps=0)
        if any(j != BASE and self._type(b, j) == "spherical" for b, j in self.links):
            raise NotImplementedError("PyBullet's motors of ball joints are not switched off")
        for b, j in self.links:
            p.setCollisionFilterGroupMask(b, j, 0, 0)
            if j == BASE:
                p.resetBasePositionAndOrientation(b, *self.start[b])
                p.resetBaseVelocity(b, [0, 0, 0], [0, 0, 0])
        for at, name in names.items():
            p.resetJointState(*at, pose.get(name, 0.0), rates.get(name, 0.0))
            p.setJointMotorControl2(*at, p.VELOCITY_CONTROL, force=0.0)
            p.changeDynamics(*at, jointLowerLimit=-UNLIMITED, jointUpperLimit=UNLIMITED)
        for _ in range(round(duration / step)):
            p.stepSimulation()
        return {name: float(p.getJointState(*at)[0]) for at, name in names.items()}

    def statics(self, pose: Pose, gravity: Vector) -> Statics:
        self.p.setGravity(*gravity)
        names, masses, torques = list[str](), list[np.ndarray](), list[Any]()
        for b in dict.fromkeys(b for b, _ in self.links):
            moving = [j for own, j in self.links if own == b and j != BASE and self._type(b, j) != FIXED]
            if any(self._type(b, j) not in SCALAR for j in moving) or self.p.getDynamicsInfo(b, BASE)[0]:
                raise NotImplementedError(
                    "mass matrices of free bases and of joints with several coordinates"
                )
            if not moving:
                continue
            own = [str(self.p.getJointInfo(b, j)[1].decode()) for j in moving]
            q, zero = [pose.get(name, 0.0) for name in own], [0.0] * len(moving)
            for j, value in zip(moving, q, strict=True):
                self.p.resetJointState(b, j, value)
            names += own
            masses.append(np.array(self.p.calculateMassMatrix(b, q)))
            torques += self.p.calculateInverseDynamics(b, q, zero, zero)
        whole, start = np.zeros((len(names), len(names))), 0
        for block in masses:
            end = start + len(block)
            whole[start:end, start:end] = block
            start = end
        centres = {self._link(b, j): vector(self._inertial(b, j).position) for b, j in self.links}
        return Statics(tuple(names), matrix(whole), vector(torques), centres)
