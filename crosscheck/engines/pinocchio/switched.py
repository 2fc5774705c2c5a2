"""Runs of Pinocchio through the intervals of joints: constraint models that are added and removed.

``impulseDynamics`` gives the joint velocities after an impact, for the Jacobian of all constraint models. Its
form for the models themselves leaves out the velocity of the second joint (Pinocchio 4.1.0). Driven
coordinates have large armatures, so that impulses do not change their rates.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from crosscheck.engine import Setting
from crosscheck.engines.pinocchio.simulation import Simulation
from crosscheck.engines.shared.sampling import Sample
from crosscheck.engines.shared.spanning_tree import GROUND_LINK
from crosscheck.engines.shared.switched import SwitchedRun, always
from crosscheck.engines.shared.tree_reactions import sample_of
from crosscheck.judge.pieces import holds
from mbref.scene import GROUND, Coupling, Joint, Scene

SERVED = ("dop853", "tuned")  # families that serve scenes with intervals
DAMPING = 1e-12  # of an impact, kg⁻¹ or (kg m²)⁻¹, which redundant constraints need


class ConstraintRun(SwitchedRun):
    """A run of Pinocchio whose constraint models are added and removed."""

    def __init__(self, scene: Scene, setting: Setting):
        super().__init__(scene)
        self.run = Simulation(always(scene), setting)
        self._first = list(self.run.closures)
        self._held = {part.name: self._model(part) for part in self._joints() if holds(part, 0.0)}
        self._hold()

    def _joints(self) -> list[Joint]:
        return [part for part in self.parts if not isinstance(part, Coupling)]

    def advance(self, t0: float, t1: float) -> None:
        self.run.advance(t0, t1)

    def sample(self, t: float) -> Sample:
        run = self.run
        moved = run.link_motion(t, *run.split(t, run.y))
        return sample_of(run.mechanism.scene, run.mechanism.tree, moved, None)

    def switch(self, engaged: Sequence[Joint | Coupling], released: Sequence[Joint | Coupling]) -> None:
        run = self.run
        run.pin.forwardKinematics(run.model, run.data, run.y[: run.nq])
        for part in released:
            del self._held[part.name]
        for part in engaged:
            if not isinstance(part, Coupling):
                self._held[part.name] = self._model(part, run.data.oMi)
        self._hold()

    def _hold(self) -> None:
        """Let the closures of the tree and the switched constraints hold."""
        self.run.hold([*self._first, *self._held.values()])

    def _model(self, joint: Joint, poses: Any = None) -> Any:
        """Return the constraint model of a joint, at its file's anchors or at the pose of this moment: world
        placements of all Pinocchio joints."""
        pin, mechanism = self.run.pin, self.run.mechanism
        ends = []
        for name, point in zip(joint.bodies, joint.anchor_pair, strict=True):
            place = mechanism.scene.body_index(name) if name != GROUND else GROUND_LINK
            number = 0 if name == GROUND else mechanism.joint[mechanism.tree.link_of(place)]
            ends.append((number, pin.SE3(np.eye(3), np.array(point) - mechanism.origin[number])))
        (one, first), (other, second) = ends
        if poses is not None:
            second = poses[other].inverse() * (poses[one] * first)
        kind = pin.ContactType.CONTACT_6D if joint.type == "fixed" else pin.ContactType.CONTACT_3D
        return pin.RigidConstraintModel(
            kind, mechanism.model, one, first, other, second, pin.ReferenceFrame.LOCAL
        )

    def jump(self, t: float) -> None:
        run = self.run
        q, v = run.split(t, run.y)
        _, jacobian = run.closure_errors(q)
        after = run.pin.impulseDynamics(run.model, run.data, q, v, jacobian, 0.0, DAMPING)
        run.y = np.concatenate((q, after))

    def energy(self) -> float:
        run = self.run
        rates = run.y[run.nq :].copy()
        rates[[i for i, _ in run.mechanism.driven]] = 0.0  # whose armatures are large
        return float(run.pin.computeKineticEnergy(run.model, run.data, run.y[: run.nq], rates))
