"""Derivatives of accelerations by Pinocchio's own function, computeConstraintDynamicsDerivatives."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from crosscheck.differentiating import Differentiating, OwnDerivatives
from crosscheck.engines.pinocchio.model import Mechanism
from crosscheck.engines.shared.rates import names_of_rates, spins_of_rods
from mbref.scene import Scene

FRAMES = ("LOCAL", "LOCAL_WORLD_ALIGNED")  # reference frames of closures
STABILISED = ", Baumgarte"
CORRECTOR = 100.0, 20.0  # 1/s² and 1/s, of closures with a Baumgarte term
SOLVER = 1e-14, 1e-9, 20  # accuracy, mu and iterations of the proximal solver, which redundant rows need


class Differentiated(Differentiating):
    """Derivatives in two reference frames of the closures, without and with a Baumgarte term."""

    differentiates_by: Mapping[str, str] = {
        f"{frame}{term}": f"computeConstraintDynamicsDerivatives, closures in the frame {frame}{term}"
        for term in ("", STABILISED)
        for frame in FRAMES
    }

    def own_derivatives(self, scene: Scene, function: str, away: np.ndarray | None = None) -> OwnDerivatives:
        """Return the derivatives at the start, displaced by ``away`` along unit velocities."""
        model = _Differentiated(scene, function)
        at = np.zeros(model.nv) if away is None else away
        v, none = model.mechanism.v0, np.zeros(model.nv)
        acceleration, data = model.solved(at, v, none)
        return OwnDerivatives(
            coordinates=names_of_rates(scene, model.mechanism.tree),
            velocity=v,
            acceleration=acceleration,
            by_position=data.ddq_dq.copy(),
            by_velocity=data.ddq_dv.copy(),
            by_force=data.ddq_dtau.copy(),
            bodies=lambda step, rate, change: model.bodies(at + step, rate, change),
            opening=lambda step, rate: model.opening(at + step, rate),
            own=lambda step, rate, force: model.solved(at, rate, force, step, derive=False)[0],
            spins=lambda step, rate: model.spins(at + step, rate),
        )


class _Differentiated:
    """A scene in Pinocchio with its closures in a frame."""

    def __init__(self, scene: Scene, function: str):
        import pinocchio as pin

        self.pin, self.mechanism = pin, Mechanism(scene)
        self.model, self.nv = self.mechanism.model, self.mechanism.model.nv
        self.closures = pin.StdVec_RigidConstraintModel()
        frame = getattr(pin, function.removesuffix(STABILISED))
        for each in self.mechanism.closures:
            ends = (each.joint1_id, each.joint1_placement, each.joint2_id, each.joint2_placement)
            closure = pin.RigidConstraintModel(each.type, self.model, *ends, frame)
            if function.endswith(STABILISED):
                closure.setBaumgarteCorrectorParameters(pin.BaumgarteCorrectorParameters(*CORRECTOR))
            self.closures.append(closure)

    def solved(
        self, at: np.ndarray, v: np.ndarray, force: np.ndarray, step: Any = 0.0, derive: bool = True
    ) -> tuple[np.ndarray, Any]:
        """Return accelerations (nv,) at a displacement and a further step, and the data with derivatives."""
        pin, model, data = self.pin, self.model, self.model.createData()
        q = pin.integrate(model, self.mechanism.q0, at)
        q = pin.integrate(model, q, step + np.zeros(self.nv))
        forces = self._forces()
        solver = pin.ProximalSettings(*SOLVER)
        pin.initConstraintDynamics(model, data, self.closures, forces)
        found = pin.constraintDynamics(model, data, q, v, force, self.closures, forces, solver).copy()
        if derive:
            pin.computeConstraintDynamicsDerivatives(model, data, self.closures, forces, solver)
        return found, data

    def _forces(self) -> Any:
        """Return new data of the closures."""
        found = self.pin.StdVec_RigidConstraintData()
        found.extend([closure.createData() for closure in self.closures])
        return found

    def opening(self, step: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return the rates (m,) at which the closures open."""
        pin, model, data = self.pin, self.model, self.model.createData()
        if not len(self.closures):
            return np.zeros(0)
        pin.computeJointJacobians(model, data, pin.integrate(model, self.mechanism.q0, step))
        forces = self._forces()
        for closure, own in zip(self.closures, forces, strict=True):
            closure.calc(model, data, own)
        return np.asarray(pin.getConstraintsJacobian(model, data, self.closures, forces) @ v)

    def bodies(self, step: np.ndarray, v: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return twists and accelerations (6 nb,) of the bodies."""
        pin, model, data = self.pin, self.model, self.model.createData()
        pin.forwardKinematics(model, data, pin.integrate(model, self.mechanism.q0, step), v, a)
        frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        ends = [self.mechanism.frame(link) for link in self.mechanism.tree.own]
        places = [(joint, pin.SE3(np.eye(3), point)) for joint, point in ends]
        rates = [pin.getFrameVelocity(model, data, *place, frame).vector for place in places]
        changes = [pin.getFrameClassicalAcceleration(model, data, *place, frame).vector for place in places]
        return np.concatenate(rates), np.concatenate(changes)

    def spins(self, step: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return the rates at which rods spin about their own axes."""
        now, first = (self._turning(place, v) for place in (step, 0 * step))
        return spins_of_rods(self.mechanism.tree, now, first)

    def _turning(self, step: np.ndarray, v: np.ndarray) -> Any:
        """Return the function of a link that gives its rotation and angular velocity."""
        pin, model, data = self.pin, self.model, self.model.createData()
        pin.forwardKinematics(model, data, pin.integrate(model, self.mechanism.q0, step), v)
        joints = [self.mechanism.frame(link)[0] for link in range(len(self.mechanism.tree.links))]
        frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED

        def turning(link: int) -> tuple[np.ndarray, np.ndarray]:
            joint = joints[link]
            return data.oMi[joint].rotation, pin.getVelocity(model, data, joint, frame).angular

        return turning
