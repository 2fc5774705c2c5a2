"""Drake: joint coordinates, with loops closed by constraints of the discrete plant, which Drake's SAP solver
satisfies.

Drake's step is of first order. The solver of the discrete plant ends the process if a ball constraint
connects a body to the world (1.51.1, 1.58.0), so loops are cut between moving links. A continuous plant has
no constraints. crosscheck integrates the equations of the continuous plant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from crosscheck.engine import Cannot, Engine, Setting
from crosscheck.engines import terms
from crosscheck.engines.drake.model import Mechanism
from crosscheck.engines.driver_motion import stated_rate
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
from crosscheck.engines.sampling import Failed
from crosscheck.engines.spanning_tree import GROUND_LINK, Tree, spanning_tree
from crosscheck.engines.tree_reactions import LinkMotion
from mbref.scene import GROUND, Scene
from mbref.trajectory import Outcome, Trajectory

DISCRETE = "discrete"
FINER = 1  # number of further, finer steps, each a third of the previous one: the method is of first order
CLOSES = ("spherical", "revolute")
FAMILIES = {
    terms.FAMILY: terms.ABOUT,
    DISCRETE: "Drake's discrete plant and SAP solver; cut hinges closed by ball constraints, all other "
    "cut joints by welds of the two parts of a split body",
}
OPTIONS = {
    "step": "time step, s",
    "rtol": "relative tolerance of a step",
    "min_step": "shortest step, s",
}


class Drake(Engine):
    """Drake (PyPI ``drake``)."""

    name = "drake"
    package = "drake"
    modules = ("pydrake.multibody.plant", "pydrake.multibody.tree")
    supports = EVERYTHING
    families, options, integrated_here = FAMILIES, OPTIONS, (terms.FAMILY,)

    def refuses(self, scene: Scene) -> Cannot | None:
        """Refuse scenes without masses whose motion the drivers do not determine completely, and loads over
        time that have pieces."""
        return lacks_mass(scene) or unended_piece(scene)

    def settings(self, scene: Scene) -> Sequence[Setting]:
        """Return settings by tolerance for the continuous plant, and settings by step for the discrete plant.

        The discrete plant has no drivers, so driven scenes have no settings by step.
        """
        if scene.driver:
            return terms.sweep(stated_rate(scene))
        rate = scouted_rate(self, scene, DISCRETE)
        return [
            *terms.sweep(rate),
            *(Setting(DISCRETE, {"step": h}) for h in steps(scene, rate, finer=FINER)),
        ]

    def serves(self, scene: Scene, family: str) -> bool:
        """Return whether a family can run a scene; the discrete plant has no drivers."""
        return family == terms.FAMILY or (family == DISCRETE and not scene.driver)

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        """Simulate a scene; raises ValueError for an unknown family, or a family that cannot run the
        scene."""
        if setting.family == DISCRETE and scene.driver:
            raise ValueError("Drake's discrete plant prescribes no motion of a joint")
        if setting.family == DISCRETE and (planar := planar_scene(scene)) is not scene:
            return self.run(planar, times, setting)
        return simulated(self, scene, times, setting, lambda: _simulation(scene, setting))


def _simulation(scene: Scene, setting: Setting) -> Simulation:
    if setting.family == terms.FAMILY:
        return terms.Simulation(Mechanism(scene, spanning_tree(scene)), setting)
    tree = _cut_between_links(scene)
    return FixedSteps(scene, tree, _Plant(scene, tree, setting.options["step"]), setting.options["step"])


def _cut_between_links(scene: Scene) -> Tree:
    """Return a spanning tree without closures to the ground, since joints at the ground are cut last.

    If such a joint must be cut, it carries a part of the split body.
    """
    kept = scene.with_(joint=tuple(sorted(scene.joint, key=lambda joint: GROUND not in joint.bodies)))
    tree = spanning_tree(kept, CLOSES)
    if any(GROUND_LINK in closure.links for closure in tree.closures):
        tree = spanning_tree(kept, ())
    order = [[joint.name for joint in scene.joint].index(joint.name) for joint in kept.joint]
    return replace(
        tree,
        links=tuple(replace(k, joint=order[k.joint]) if k.joint >= 0 else k for k in tree.links),
        closures=tuple(replace(c, joint=order[c.joint]) for c in tree.closures),
    )


class _Plant:
    """Discrete plants, one for each length of step, which is fixed when a plant is made."""

    def __init__(self, scene: Scene, tree: Tree, step: float):
        self.scene, self.tree = scene, tree
        self.plants: dict[float, Mechanism] = {}
        self.now = self._of(step)
        self.loads = Loads(scene, tree, self.motion)

    def _of(self, step: float) -> Mechanism:
        key = float(f"{step:.12g}")
        if key not in self.plants:
            self.plants[key] = Mechanism(self.scene, self.tree, step)
        return self.plants[key]

    def step(self, t: float, h: float, count: int) -> None:
        """Take ``count`` steps of length h (s) from time t."""
        other = self._of(h)
        other.context.SetDiscreteState(self.now.context.get_discrete_state().Clone())
        self.now = other
        port = other.plant.get_applied_spatial_force_input_port()
        for n in range(count):
            if n == 0 or self.loads.constant is None:
                port.FixValue(other.context, self._external(t + n * h))
            try:
                after = other.plant.EvalUniquePeriodicDiscreteUpdate(other.context)
            except RuntimeError as error:
                raise Failed(Outcome.STEP_FAILED, t + n * h, f"Drake stopped: {error}") from None
            other.context.SetDiscreteState(after)

    def _external(self, t: float) -> Any:
        from pydrake.common.value import Value
        from pydrake.multibody.math import SpatialForce
        from pydrake.multibody.plant import ExternallyAppliedSpatialForce

        found = []
        for link, force, moment in self.loads.at(t):
            push = ExternallyAppliedSpatialForce()
            push.body_index = self.now.bodies[link].index()
            push.F_Bq_W = SpatialForce(tau=moment, f=force)
            found.append(push)
        return Value[list[ExternallyAppliedSpatialForce]](found)

    def motion(self) -> LinkMotion:
        """Return the motion of the links."""
        return self.now.motion()


ENGINE = Drake()
