"""Bullet, through PyBullet: multibodies in joint coordinates, with loops closed by impulses that an iterative
solver finds.

Its step is semi-implicit and of first order. A driver is a motor with a prescribed velocity: the mean
velocity over a step, so that the prescribed position is reached at the end of the step.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from crosscheck.engine import Cannot, Engine, Owner, Setting
from crosscheck.engines.bullet.model import STRONGEST, Mechanism
from crosscheck.engines.driver_motion import mean_rate
from crosscheck.engines.fixed_steps import FixedSteps, Loads, scouted_rate, simulated, steps, unended_piece
from crosscheck.engines.initial_velocities import lacks_mass
from crosscheck.engines.pieces import EVERYTHING
from crosscheck.engines.planar_scene import planar_scene
from crosscheck.engines.spanning_tree import spanning_tree
from crosscheck.engines.tree_reactions import LinkMotion
from mbref.scene import Scene
from mbref.trajectory import Trajectory

DEFAULT_STEP, DEFAULT_ITERATIONS = 1 / 240, 50
ITERATIONS = 1000
FINER = 1  # number of further, finer steps, each a third of the previous one: the method is of first order
CLOSES = ("spherical", "revolute")
FAMILIES = {
    "iterated": "1000 iterations; a cut hinge closed by two points, in a planar mechanism by one",
    "defaults": "50 iterations, the library's default; a cut hinge closed by two points",
}
OPTIONS = {"step": "time step, s", "iterations": "iterations of the solver in a step"}


class Bullet(Engine):
    """Bullet (PyPI ``pybullet``)."""

    name = "bullet"
    package = "pybullet"
    modules = ("pybullet",)
    supports = EVERYTHING
    families, options = FAMILIES, OPTIONS

    def refuses(self, scene: Scene) -> Cannot | None:
        """Refuse armatures, scenes without masses whose motion the drivers do not determine completely, and
        loads over time that have pieces."""
        if rotor := next((joint.name for joint in scene.joint if joint.reflected_inertia), ""):
            return Cannot(Owner.ENGINE, f"joint {rotor!r} has an armature, which Bullet's joints do not have")
        return lacks_mass(scene) or unended_piece(scene)

    def settings(self, scene: Scene) -> Sequence[Setting]:
        """Return settings whose steps are chosen by the angle that a body turns in one step."""
        rate = scouted_rate(self, scene, "defaults", iterations=DEFAULT_ITERATIONS)
        fine = steps(scene, rate, finer=FINER)
        plain = sorted({*fine, DEFAULT_STEP}, reverse=True)
        return [
            *(Setting("iterated", {"step": h, "iterations": ITERATIONS}) for h in fine),
            *(Setting("defaults", {"step": h, "iterations": DEFAULT_ITERATIONS}) for h in plain),
        ]

    def serves(self, scene: Scene, family: str) -> bool:
        """Return whether the family exists; every family can run every scene."""
        return family in FAMILIES

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        """Simulate a scene; raises ValueError for an unknown family."""
        import pybullet

        if setting.family == "iterated":
            scene = planar_scene(scene)
        client = pybullet.connect(pybullet.DIRECT)
        try:
            pybullet.resetSimulation()
            return simulated(self, scene, times, setting, lambda: _simulation(scene, setting))
        finally:
            pybullet.disconnect(client)


def _simulation(scene: Scene, setting: Setting) -> FixedSteps:
    tree = spanning_tree(scene, CLOSES)
    world = _World(Mechanism(scene, tree), setting.options["iterations"])
    return FixedSteps(scene, tree, world, setting.options["step"])


class _World:
    """A mechanism in PyBullet's world, with its loads and drivers."""

    def __init__(self, mechanism: Mechanism, iterations: int):
        self.mechanism, self.scene, self.tree = mechanism, mechanism.scene, mechanism.tree
        self.p = mechanism.p
        left = {} if iterations == DEFAULT_ITERATIONS else {"solverResidualThreshold": 0.0}
        self.p.setPhysicsEngineParameter(numSolverIterations=iterations, numSubSteps=0, **left)
        self.driven = [
            (mechanism.joints[self.tree.coordinate(self.scene, d.joint)], d) for d in self.scene.driver
        ]
        self.loads = Loads(self.scene, self.tree, self.motion)

    def step(self, t: float, h: float, count: int) -> None:
        """Take ``count`` steps of length h (s) from time t."""
        p = self.p
        p.setTimeStep(h)
        for n in range(count):
            for joint, driver in self.driven:
                speed = mean_rate(driver, t + n * h, h)
                p.setJointMotorControl2(*joint, p.VELOCITY_CONTROL, targetVelocity=speed, force=STRONGEST)
            self._load(t + n * h)
            p.stepSimulation()

    def _load(self, t: float) -> None:
        loads = self.loads.at(t)
        origins = self.motion().position if any(force.any() for _, force, _ in loads) else ()
        for link, force, moment in loads:
            place = self.mechanism.places[link]
            if len(origins):
                at = origins[link].tolist()
                self.p.applyExternalForce(place.body, place.link, force.tolist(), at, self.p.WORLD_FRAME)
            self.p.applyExternalTorque(place.body, place.link, moment.tolist(), self.p.WORLD_FRAME)

    def motion(self) -> LinkMotion:
        """Return the motion of the links."""
        return self.mechanism.motion()


ENGINE = Bullet()
