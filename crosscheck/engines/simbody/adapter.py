"""Simbody, through OpenSim: joint coordinates, with constraints satisfied to the tolerance after every
accepted step.

Redundant closures are allowed (multipliers of least norm). The families are Simbody's error-controlled
integrators. The only option of a family is ``accuracy``, the tolerance of one step. OpenSim reports no
numbers of steps, so the cost lacks the numbers of steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from crosscheck.engine import Alternatives, Cannot, Engine, Owner, Setting
from crosscheck.engines.shared.fixed_steps import simulated
from crosscheck.engines.shared.initial_velocities import lacks_mass
from crosscheck.engines.shared.sampling import Counts, Failed, Sample
from crosscheck.engines.shared.spanning_tree import GROUND_LINK
from crosscheck.engines.shared.tree_reactions import LinkMotion, sample_of, wrench
from crosscheck.engines.simbody.model import SUPPORTS, Mechanism
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import Scene, Spring

INTEGRATORS = {"merson": "RungeKuttaMerson", "feldberg": "RungeKuttaFeldberg", "cpodes": "CPodes"}
FAMILIES = {
    "merson": "Simbody's error-controlled Runge-Kutta-Merson",
    "feldberg": "Simbody's error-controlled Runge-Kutta-Fehlberg",
    "cpodes": "Simbody's CPodes, multistep with projection",
}
OPTIONS = {"accuracy": "tolerance of one step"}
ACCURACIES = (1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10)


class Simbody(Engine):
    """Simbody in the package OpenSim (PyPI ``opensim``)."""

    name = "simbody"
    package = "opensim"
    modules = ("opensim",)
    supports = SUPPORTS
    families, options = FAMILIES, OPTIONS
    alternatives = (Alternatives({name: Setting(name, {"accuracy": 1e-9}) for name in INTEGRATORS}, 1e-5),)

    def refuses(self, scene: Scene) -> Cannot | None:
        """Refuse armatures, springs of no length at the start, drivers that add a sine to a polynomial, and
        scenes without masses whose motion is not prescribed in full."""
        if rotor := next((j.name for j in scene.joint if j.reflected_inertia), ""):
            return Cannot(
                Owner.ENGINE, f"joint {rotor!r} has an armature, which Simbody's joints do not have"
            )
        mixed = [d.joint for d in scene.driver if d.sine and any(d.polynomial[1:])]
        if mixed:
            reason = "OpenSim's sum of a polynomial and a sine has a wrong second derivative; it would drive"
            return Cannot(Owner.ENGINE, f"{reason} {', '.join(mixed)}")
        for k, load in enumerate(scene.load):
            if isinstance(load, Spring) and load.points[0] == load.points[1]:
                reason = f"the ends of load[{k}] meet, where Simbody's force between points is not finite"
                return Cannot(Owner.ENGINE, reason)
        return lacks_mass(scene)

    def settings(self, scene: Scene) -> Sequence[Setting]:
        """Return settings by accuracy for each integrator."""
        return [Setting(family, {"accuracy": a}) for family in INTEGRATORS for a in ACCURACIES]

    def own_code(self, scene: Scene, setting: Setting) -> str:
        """Return the statements that set up the ``manager = opensim.Manager(model)``."""
        kind = f"opensim.Manager.IntegratorMethod_{INTEGRATORS[setting.family]}"
        accuracy = f"manager.setIntegratorAccuracy({setting.options['accuracy']!r})"
        return f"manager.setIntegratorMethod({kind}); {accuracy}"

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        """Simulate a scene; raises ValueError for an unknown family."""
        return simulated(self, scene, times, setting, lambda: _SimbodySimulation(scene, setting))


class _SimbodySimulation:
    """One simulation: the mechanism, its state and the integrator."""

    def __init__(self, scene: Scene, setting: Setting):
        self.scene, self.mechanism = scene, Mechanism(scene)
        self.state = self.mechanism.start()
        opensim = self.mechanism.opensim
        self.manager = manager = opensim.Manager(self.mechanism.model)
        manager.setIntegratorMethod(
            getattr(opensim.Manager, f"IntegratorMethod_{INTEGRATORS[setting.family]}")
        )
        manager.setIntegratorAccuracy(setting.options["accuracy"])
        manager.setWriteToStorage(False)
        manager.setPerformAnalyses(False)
        manager.setRecordStatesTrajectory(False)
        manager.initialize(self.state)
        self.counts = Counts()

    def advance(self, t0: float, t1: float) -> None:
        """Move the state from t0 to t1; raises Failed."""
        try:
            self.state = self.manager.integrate(t1)
        except RuntimeError as error:
            reached = self.manager.getState().getTime()
            raise Failed(Outcome.STEP_FAILED, reached, _sentence(error)) from None

    def sample(self, t: float) -> Sample:
        """Return poses, velocities, accelerations and reactions."""
        motion = self._motion()
        closing = self._closing(motion) if self.scene.has_mass() else None
        return sample_of(self.scene, self.mechanism.tree, motion, closing)

    def _motion(self) -> LinkMotion:
        """Return the motion of the links."""
        state, bodies = self.state, self.mechanism.bodies
        self.mechanism.model.realizeAcceleration(state)
        of = {
            name: np.array([_three(getattr(body, f"get{name}InGround")(state)) for body in bodies])
            for name in (
                "Position",
                "LinearVelocity",
                "AngularVelocity",
                "LinearAcceleration",
                "AngularAcceleration",
            )
        }
        coordinates = [self.mechanism.coordinates[k] for k in range(self.mechanism.tree.nv)]
        return LinkMotion(
            rotation=np.array([_matrix(body.getTransformInGround(state).R()) for body in bodies]),
            position=of["Position"],
            velocity=of["LinearVelocity"],
            angular_velocity=of["AngularVelocity"],
            acceleration=of["LinearAcceleration"],
            angular_acceleration=of["AngularAcceleration"],
            coordinates=np.array([coordinate.getValue(state) for coordinate in coordinates]),
            rates=np.array([coordinate.getSpeedValue(state) for coordinate in coordinates]),
        )

    def _closing(self, motion: LinkMotion) -> list[np.ndarray]:
        """Return, for each closure of the tree, the wrench on its second link about the world's origin."""
        found = []
        for closure, constraint in zip(self.mechanism.tree.closures, self.mechanism.closures, strict=True):
            second = closure.links[1]
            labels, values = constraint.getRecordLabels(), constraint.getRecordValues(self.state)
            name = f"_{self.mechanism.frame(second).getName()}_Fx"
            at = next(k for k in range(labels.getSize()) if labels.get(k).endswith(name))
            force, moment = np.array([values.get(at + k) for k in range(6)]).reshape(2, 3)
            origin = motion.position[second] if second != GROUND_LINK else np.zeros(3)
            # OpenSim records the wrench that the bodies exert on the joint
            found.append(-wrench(force, origin, moment))
        return found


def _three(vector: Any) -> list[float]:
    return [vector.get(n) for n in range(3)]


def _matrix(rotation: Any) -> list[list[float]]:
    return [[rotation.get(i, j) for j in range(3)] for i in range(3)]


def _sentence(error: RuntimeError) -> str:
    """Return the line of OpenSim's report that states the error."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return next((line for line in lines if "advance" in line or "rror" in line), lines[0])


ENGINE = Simbody()
