"""DART: joint coordinates, with loops closed by velocity constraints that an LCP solver satisfies.

DART's step is semi-implicit and of first order. The error reduction parameter of a class of constraints is
global in the process, so every run sets it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from crosscheck.engine import Cannot, Engine, Setting
from crosscheck.engines import terms
from crosscheck.engines.dart.model import Mechanism
from crosscheck.engines.driver_motion import mean_rate, motion, stated_rate
from crosscheck.engines.fixed_steps import (
    FixedSteps,
    Loads,
    Simulation,
    scouted_rate,
    simulated,
    steps,
    unended_piece,
)
from crosscheck.engines.initial_velocities import lacks_mass
from crosscheck.engines.pieces import EVERYTHING
from crosscheck.engines.planar_scene import planar_scene
from crosscheck.engines.spanning_tree import spanning_tree
from crosscheck.engines.tree_reactions import LinkMotion
from mbref.scene import Scene
from mbref.trajectory import Trajectory

DEFAULT_STEP = 1e-3  # s
DEFAULT_ERP, STRONG_ERP = 0.01, 0.5  # fraction of a closure error that a step removes
FINER = 2  # number of further, finer steps, each a third of the previous one: the method is of first order
CLOSES = ("spherical", "revolute")
FAMILIES = {
    terms.FAMILY: terms.ABOUT,
    "defaults": "DART's step and its own constraint for every cut joint, the library's parameters",
    "balls": "DART's step; cut hinges closed by ball constraints, half of a closure error removed in "
    "each step",
}
OPTIONS = {
    "step": "time step, s",
    "erp": "fraction of a closure error that a step removes",
    "rtol": "relative tolerance of a step",
    "min_step": "shortest step, s",
}


class Dart(Engine):
    """DART (PyPI ``dartpy``)."""

    name = "dart"
    package = "dartpy"
    modules = ("dartpy",)
    supports = replace(EVERYTHING, massless_links=True)
    families, options, integrated_here = FAMILIES, OPTIONS, (terms.FAMILY,)

    def refuses(self, scene: Scene) -> Cannot | None:
        """Refuse scenes without masses whose motion the drivers do not determine completely, and loads over
        time that have pieces."""
        return lacks_mass(scene) or unended_piece(scene)

    def settings(self, scene: Scene) -> Sequence[Setting]:
        """Return settings by tolerance, and by the angle that a body turns in one step; only settings by
        tolerance if DART's own steps cannot run the scene."""
        if _is_geared(scene):
            return terms.sweep(stated_rate(scene))
        rate = scouted_rate(self, scene, "defaults", erp=DEFAULT_ERP)
        fine = steps(scene, rate, finer=FINER)
        return [
            *terms.sweep(rate),
            *(
                Setting("defaults", {"step": h, "erp": DEFAULT_ERP})
                for h in sorted({*fine, DEFAULT_STEP}, reverse=True)
            ),
            *(Setting("balls", {"step": h, "erp": STRONG_ERP}) for h in fine),
        ]

    def serves(self, scene: Scene, family: str) -> bool:
        """Return whether a family can run a scene: this adapter gives DART's own steps neither couplings nor
        armatures."""
        return family in FAMILIES and (family == terms.FAMILY or not _is_geared(scene))

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        """Simulate a scene; raises ValueError for an unknown family, or a family that cannot run the
        scene."""
        if setting.family in FAMILIES and not self.serves(scene, setting.family):
            raise ValueError("DART's own steps have no couplings and armatures here; family 'terms' has them")
        if setting.family == "balls" and (planar := planar_scene(scene)) is not scene:
            return replace(self.run(planar, times, setting), reactions=None)
        return simulated(self, scene, times, setting, lambda: _simulation(scene, setting))


def _is_geared(scene: Scene) -> bool:
    return bool(scene.coupling) or any(joint.reflected_inertia for joint in scene.joint)


def _simulation(scene: Scene, setting: Setting) -> Simulation:
    if setting.family == terms.FAMILY:
        return terms.Simulation(Mechanism(scene, spanning_tree(scene)), setting)
    mechanism = Mechanism(scene, spanning_tree(scene, CLOSES))
    stepper = _World(mechanism, setting.family, setting.options["erp"])
    return FixedSteps(scene, mechanism.tree, stepper, setting.options["step"])


class _World:
    """A mechanism in DART's world, with its closures and loads."""

    def __init__(self, mechanism: Mechanism, family: str, erp: float):
        self.mechanism, self.scene, self.tree = mechanism, mechanism.scene, mechanism.tree
        dart = mechanism.dart
        self.world = dart.simulation.World()
        self.world.addSkeleton(mechanism.skeleton)
        self.world.setGravity(np.array(self.scene.gravity))
        for closure in self.tree.closures:
            for constraint in mechanism.constraints(closure, as_balls=family == "balls"):
                constraint.setErrorReductionParameter(erp)
                self.world.getConstraintSolver().addConstraint(constraint)
        if family != "defaults":
            asleep = self.world.getDeactivationOptions()
            asleep.mEnabled = False
            self.world.setDeactivationOptions(asleep)
        self.driven = [
            (mechanism.joints[self.tree.coordinate(self.scene, d.joint)], d) for d in self.scene.driver
        ]
        for joint, driver in self.driven:
            joint.setActuatorType(dart.dynamics.ActuatorType.ACCELERATION)
            joint.setVelocity(0, motion(driver, 0.0)[1])
        self.loads = Loads(self.scene, self.tree, self.motion)

    def step(self, t: float, h: float, count: int) -> None:
        """Take ``count`` steps of length h (s) from time t."""
        self.world.setTimeStep(h)
        for n in range(count):
            for joint, driver in self.driven:
                joint.setCommand(0, (mean_rate(driver, t + n * h, h) - joint.getVelocity(0)) / h)
            self._load(t + n * h)
            self.world.step()

    def _load(self, t: float) -> None:
        for link, force, moment in self.loads.at(t):
            node = self.mechanism.nodes[link]
            node.addExtForce(force, np.zeros(3), False, True)
            node.addExtTorque(moment, False)

    def motion(self) -> LinkMotion:
        """Return the motion of the links."""
        return self.mechanism.motion()


ENGINE = Dart()
