"""Drake: joint coordinates, with loops closed by constraints of the discrete plant, which Drake's SAP solver
satisfies.

Drake's step is of first order. The solver of the discrete plant (1.51.1) can end the process on ball
constraints, which it does not on loops that are cut between moving links. A continuous plant has
no constraints. crosscheck integrates the equations of the continuous plant.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from crosscheck.engine import Alternatives, Setting
from crosscheck.engines.drake import derivatives
from crosscheck.engines.drake.model import Mechanism
from crosscheck.engines.shared import terms
from crosscheck.engines.shared.everything import EVERYTHING
from crosscheck.engines.shared.own_steps import STEP, SteppingEngine, World
from crosscheck.engines.shared.sampling import Failed
from crosscheck.engines.shared.spanning_tree import Tree, spanning_tree
from mbref.motions.trajectory import Outcome
from mbref.scene import Scene

DISCRETE = "discrete"
CLOSES = ("spherical", "revolute")
FAMILIES = {
    terms.FAMILY: terms.ABOUT,
    DISCRETE: "Drake's discrete plant and SAP solver; cut hinges closed by ball constraints, all other "
    "cut joints by welds of the two parts of a split body",
}
# approximations of contact, of which only the solver matters here; TAMSI has no constraints
CONTACTS = ("SAP", "Similar", "Lagged")
OPTIONS = STEP | terms.OPTIONS | {"contact": f"approximation of contact: {', '.join(CONTACTS)}"}
WAYS = {name: Setting(DISCRETE, {"step": 1e-3, "contact": name}) for name in CONTACTS}
OWN_STEPS: dict[str, dict[str, float]] = {DISCRETE: {}}


class Drake(derivatives.Differentiated, SteppingEngine):
    """Drake (PyPI ``drake``)."""

    name = "drake"
    package = "drake"
    modules = ("pydrake.multibody.plant", "pydrake.multibody.tree")
    supports = EVERYTHING
    families, own_steps, options = FAMILIES, OWN_STEPS, OPTIONS
    alternatives = (Alternatives(WAYS, 1e-9),)
    integrated_here, with_terms = (terms.FAMILY,), Mechanism
    finer = 1  # the method is of first order
    scout, planar = DISCRETE, (DISCRETE,)

    def serves(self, scene: Scene, family: str) -> bool:
        """Return whether a family can run a scene; the discrete plant has no drivers."""
        return family == terms.FAMILY or (family == DISCRETE and not scene.driver)

    def world(self, scene: Scene, setting: Setting) -> World:
        """Return the discrete plant of a scene."""
        tree = spanning_tree(scene, CLOSES, between_links=True)
        return _Plant(scene, tree, setting)


class _Plant(World):
    """Discrete plants, one for each length of step, which is fixed when a plant is made."""

    def __init__(self, scene: Scene, tree: Tree, setting: Setting):
        self.contact = str(setting.options.get("contact", ""))
        step = _digits(setting.options["step"])
        self.plants = {step: Mechanism(scene, tree, step, self.contact)}
        self.acting: Sequence[tuple[int, np.ndarray, np.ndarray]] | None = None  # loads of the last step
        super().__init__(self.plants[step])

    def begin(self, h: float) -> None:
        if (key := _digits(h)) not in self.plants:
            self.plants[key] = Mechanism(self.scene, self.tree, key, self.contact)
        now, self.mechanism = self.mechanism, self.plants[key]
        self.mechanism.context.SetDiscreteState(now.context.get_discrete_state().Clone())
        self.acting = None

    def push(self, loads: Sequence[tuple[int, np.ndarray, np.ndarray]]) -> None:
        from pydrake.common.value import Value
        from pydrake.multibody.math import SpatialForce
        from pydrake.multibody.plant import ExternallyAppliedSpatialForce

        if loads is self.acting:
            return
        found, of, self.acting = [], self.mechanism, loads
        for link, force, moment in loads:
            push = ExternallyAppliedSpatialForce()
            push.body_index = of.bodies[link].index()
            push.F_Bq_W = SpatialForce(tau=moment, f=force)
            found.append(push)
        port = of.plant.get_applied_spatial_force_input_port()
        port.FixValue(of.context, Value[list[ExternallyAppliedSpatialForce]](found))

    def advance(self, t: float, h: float) -> None:
        context = self.mechanism.context
        try:
            context.SetDiscreteState(self.mechanism.plant.EvalUniquePeriodicDiscreteUpdate(context))
        except RuntimeError as error:
            raise Failed(Outcome.STEP_FAILED, t, f"Drake stopped: {error}") from None


def _digits(h: float) -> float:
    """Return a length of step (s), rounded so that equal steps between samples have one plant."""
    return float(f"{h:.12g}")


ENGINE = Drake()
