"""Bullet, through PyBullet: multibodies in joint coordinates, with loops closed by impulses that an iterative
solver finds.

Its step is semi-implicit and of first order. A driver is a motor with a prescribed velocity: the mean
velocity over a step, so that the prescribed position is reached at the end of the step.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from crosscheck.engine import Cannot, Owner, Setting
from crosscheck.engines.bullet.model import STRONGEST, Mechanism
from crosscheck.engines.shared.everything import EVERYTHING
from crosscheck.engines.shared.own_steps import STEP, SteppingEngine, World
from crosscheck.engines.shared.spanning_tree import spanning_tree
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

ITERATED, DEFAULTS = "iterated", "defaults"
CLOSES = ("spherical", "revolute")
FAMILIES = {
    ITERATED: "1000 iterations, whatever the residual; a cut hinge closed by two points, in a planar "
    "mechanism by one",
    DEFAULTS: "50 iterations, the library's default; a cut hinge closed by two points",
}
OPTIONS = STEP | {"iterations": "iterations of the solver in a step"}
OWN_STEPS = {ITERATED: {"iterations": 1000}, DEFAULTS: {"iterations": 50}}
DEFAULT_STEPS = {DEFAULTS: 1 / 240}


class Bullet(SteppingEngine):
    """Bullet (PyPI ``pybullet``)."""

    name = "bullet"
    package = "pybullet"
    modules = ("pybullet",)
    supports = EVERYTHING
    families, options, own_steps, default_steps = FAMILIES, OPTIONS, OWN_STEPS, DEFAULT_STEPS
    finer = 1  # the method is of first order
    scout, planar = DEFAULTS, (ITERATED,)

    def refuses(self, scene: Scene) -> Cannot | None:
        """Refuse armatures, scenes without masses whose motion the drivers do not determine completely, and
        loads over time that have pieces."""
        if rotor := next((joint.name for joint in scene.joint if joint.reflected_inertia), ""):
            return Cannot(Owner.ENGINE, f"joint {rotor!r} has an armature, which Bullet's joints do not have")
        return super().refuses(scene)

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        """Simulate a scene in a client of its own; raises ValueError for an unknown family."""
        import pybullet

        client = pybullet.connect(pybullet.DIRECT)
        try:
            pybullet.resetSimulation()
            return super().run(scene, times, setting)
        finally:
            pybullet.disconnect(client)

    def world(self, scene: Scene, setting: Setting) -> World:
        """Return PyBullet's world of a scene."""
        return _World(Mechanism(scene, spanning_tree(scene, CLOSES)), setting.options["iterations"])


class _World(World):
    """A mechanism in PyBullet's world."""

    def __init__(self, mechanism: Mechanism, iterations: int):
        super().__init__(mechanism)
        self.p = mechanism.p
        left = {} if iterations == OWN_STEPS[DEFAULTS]["iterations"] else {"solverResidualThreshold": 0.0}
        self.p.setPhysicsEngineParameter(numSolverIterations=iterations, numSubSteps=0, **left)

    def begin(self, h: float) -> None:
        self.p.setTimeStep(h)

    def drive(self, joint: Any, rate: float, h: float) -> None:
        self.p.setJointMotorControl2(*joint, self.p.VELOCITY_CONTROL, targetVelocity=rate, force=STRONGEST)

    def push(self, loads: Sequence[tuple[int, np.ndarray, np.ndarray]]) -> None:
        origins = self.motion().position if any(force.any() for _, force, _ in loads) else ()
        for link, force, moment in loads:
            place = self.mechanism.places[link]
            if len(origins):
                at = origins[link].tolist()
                self.p.applyExternalForce(place.body, place.link, force.tolist(), at, self.p.WORLD_FRAME)
            self.p.applyExternalTorque(place.body, place.link, moment.tolist(), self.p.WORLD_FRAME)

    def advance(self, t: float, h: float) -> None:
        self.p.stepSimulation()


ENGINE = Bullet()
