"""DART: joint coordinates, with loops closed by velocity constraints that an LCP solver satisfies.

DART's step is semi-implicit and of first order. The error reduction parameter of a class of constraints is
global in the process, so every run sets it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from crosscheck.engine import Alternatives, Setting
from crosscheck.engines.dart.model import Mechanism
from crosscheck.engines.shared import terms
from crosscheck.engines.shared.driver_motion import motion
from crosscheck.engines.shared.everything import EVERYTHING
from crosscheck.engines.shared.own_steps import STEP, SteppingEngine, World
from crosscheck.engines.shared.spanning_tree import spanning_tree
from mbref.scene import Scene

DEFAULTS, BALLS = "defaults", "balls"
CLOSES = ("spherical", "revolute")
FAMILIES = {
    terms.FAMILY: terms.ABOUT,
    DEFAULTS: "DART's step and its own constraint for every cut joint, the library's parameters",
    BALLS: "DART's step; cut hinges closed by ball constraints, half of a closure error removed in each "
    "step; nothing falls asleep",
}
OPTIONS = (
    STEP
    | terms.OPTIONS
    | {
        "erp": "fraction of a closure error that a step removes",
        "solver": "boxed solver of the linear complementarity problem: Dantzig, or PGS of many iterations",
    }
)
OWN_STEPS = {DEFAULTS: {"erp": 0.01}, BALLS: {"erp": 0.5}}
DEFAULT_STEPS = {DEFAULTS: 1e-3}
SOLVERS = ("Dantzig", "PGS")
WAY = {"step": 1e-3, "erp": 0.5}
MOST_ITERATIONS, UNCHANGED = 50_000, 1e-10  # of PGS: iterations, and change of an impulse at which it ends
SAME = 1e-5  # largest difference of the solvers' mean accelerations, where PGS converges slowly


JOINT_DEFAULTS = (
    "ErrorReductionParameter",
    "MaxErrorReductionVelocity",
    "ErrorAllowance",
    "ConstraintForceMixing",
)


class Dart(SteppingEngine):
    """DART (PyPI ``dartpy``)."""

    name = "dart"
    package = "dartpy"
    modules = ("dartpy",)
    supports = replace(EVERYTHING, massless_links=True, sums=True)
    families, options, own_steps, default_steps = FAMILIES, OPTIONS, OWN_STEPS, DEFAULT_STEPS
    integrated_here, with_terms = (terms.FAMILY,), Mechanism
    defaults_of = (
        *(f"dartpy.simulation.World().{name}()" for name in ("getTimeStep", "getGravity")),
        *(f"dartpy.constraint.JointConstraint.get{name}()" for name in JOINT_DEFAULTS),
    )
    alternatives = (
        Alternatives({solver: Setting(BALLS, WAY | {"solver": solver}) for solver in SOLVERS}, SAME),
    )
    finer = 2  # the method is of first order
    scout, planar = DEFAULTS, (BALLS,)

    def serves(self, scene: Scene, family: str) -> bool:
        """Return whether a family can run a scene: this adapter gives DART's own steps neither couplings nor
        armatures."""
        is_geared = bool(scene.coupling) or any(joint.reflected_inertia for joint in scene.joint)
        return family == terms.FAMILY or (family in self.own_steps and not is_geared)

    def world(self, scene: Scene, setting: Setting) -> World:
        """Return DART's world of a scene."""
        mechanism = Mechanism(scene, spanning_tree(scene, CLOSES))
        world = _World(mechanism, setting.family == BALLS, setting.options["erp"])
        if setting.options.get("solver", SOLVERS[0]) == "PGS":
            world.use_pgs()
        return world


class _World(World):
    """A mechanism in DART's world, with its closures."""

    def __init__(self, mechanism: Mechanism, as_balls: bool, erp: float):
        super().__init__(mechanism)
        dart = mechanism.dart
        self.world = dart.simulation.World()
        self.world.addSkeleton(mechanism.skeleton)
        self.world.setGravity(np.array(self.scene.gravity))
        for closure in self.tree.closures:
            for constraint in mechanism.constraints(closure, as_balls):
                constraint.setErrorReductionParameter(erp)
                self.world.getConstraintSolver().addConstraint(constraint)
        if as_balls:
            asleep = self.world.getDeactivationOptions()
            asleep.mEnabled = False
            self.world.setDeactivationOptions(asleep)
        for joint, driver in self.driven:
            joint.setActuatorType(dart.dynamics.ActuatorType.ACCELERATION)
            joint.setVelocity(0, motion(driver, 0.0)[1])

    def use_pgs(self) -> None:
        """Replace Dantzig's method by the projected Gauss-Seidel method, iterated to convergence."""
        solver, options = (
            self.world.getConstraintSolver(),
            self.mechanism.dart.constraint.PgsBoxedLcpSolverOption(),
        )
        options.mMaxIteration = MOST_ITERATIONS
        options.mDeltaXThreshold = options.mRelativeDeltaXTolerance = UNCHANGED
        dantzig, pgs = solver.getBoxedLcpSolver(), solver.getSecondaryBoxedLcpSolver()
        pgs.setOption(options)
        solver.setSecondaryBoxedLcpSolver(None)  # a solver cannot be both
        solver.setBoxedLcpSolver(pgs)
        solver.setSecondaryBoxedLcpSolver(dantzig)  # DART sets impulses to zero where no solver converges

    def begin(self, h: float) -> None:
        self.world.setTimeStep(h)

    def drive(self, joint: Any, rate: float, h: float) -> None:
        joint.setCommand(0, (rate - joint.getVelocity(0)) / h)

    def push(self, loads: Sequence[tuple[int, np.ndarray, np.ndarray]]) -> None:
        for link, force, moment in loads:
            node = self.mechanism.nodes[link]
            node.addExtForce(force, np.zeros(3), False, True)
            node.addExtTorque(moment, False)

    def advance(self, t: float, h: float) -> None:
        self.world.step()


ENGINE = Dart()
