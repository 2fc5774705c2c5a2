"""Newton: maximal coordinates with Kamino, which is made for closed loops, and Newton's other solvers.

Newton computes in single precision, here on the processor. Kernels are compiled before the first timed run,
which takes minutes, and are kept by Warp.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib.util import find_spec

import numpy as np

from crosscheck.engine import Cannot, Owner, Setting, Supports
from crosscheck.engines.newton import solvers
from crosscheck.engines.newton.model import Mechanism, imported
from crosscheck.engines.shared.own_steps import STEP, SteppingEngine, World
from crosscheck.engines.shared.spanning_tree import spanning_tree
from crosscheck.engines.shared.warp_graphs import recorded
from crosscheck.refusals import FACTOR
from mbref.scene import Scene

JOINTS = ("fixed", "revolute", "universal", "spherical", "translational", "cylindrical")
# types of joints that close a loop; by default all
CLOSES = {solvers.MUJOCO: ("spherical", "revolute", "fixed")}
OPTIONS = STEP | {
    "alpha": "fraction of a joint error that a step of Kamino removes",
    "solver": "of Kamino: padmm, dvi or lox",
    "integrator": "of Kamino: euler or moreau",
    "sparse": "whether Kamino's Jacobian is sparse; by default sparse with DVI and LOX",
    "penalty": "penalty of PADMM; 1 by default",
    "tolerance": "joint error, m or rad, at which LOX ends",
    "iterations": "largest number of iterations of PADMM or LOX",
}
DEFAULT_STEPS = {solvers.DEFAULTS: 1e-3}


class Newton(SteppingEngine):
    """Newton (PyPI ``newton``)."""

    name = "newton"
    package = "newton"
    supports = Supports(
        joints=(*JOINTS, "distance"),
        drivers=("angle", "displacement"),  # declared, so that the refusal names the engine
        loads=("moment", "force", "spring"),
        over_time=(FACTOR,),
    )
    rounding = 2.0**-23
    families, options = solvers.FAMILIES, OPTIONS
    own_steps, default_steps = solvers.OWN_STEPS, DEFAULT_STEPS
    alternatives = solvers.ALTERNATIVES
    finer, most_steps = 1, 10_000  # a step takes 0.01 to 100 ms of CPU time

    def prepare(self, families: Sequence[str]) -> None:
        imported()

    def refuses(self, scene: Scene) -> Cannot | None:
        """Refuse drivers, bodies without mass, and loads over time that have pieces."""
        if scene.driver:
            named = f"the driver of joint {scene.driver[0].joint!r}"
            return Cannot(
                Owner.ENGINE, f"Newton moves joints by springs to a target, so {named} has no counterpart"
            )
        return super().refuses(scene)

    def serves(self, scene: Scene, family: str) -> bool:
        """Return whether a family serves a scene.

        SolverMuJoCo needs the package mujoco-warp. PADMM and DVI stop with an error where no joint constrains
        a body.
        """
        lacking = family == solvers.MUJOCO and find_spec("mujoco_warp") is None
        unbound = family in solvers.BOUND and not scene.joint
        return family in self.families and not lacking and not unbound

    def world(self, scene: Scene, setting: Setting) -> World:
        """Return a model of Newton with its solver."""
        tree = spanning_tree(scene, CLOSES.get(setting.family, JOINTS))
        return _World(Mechanism(scene, tree), setting)


class _World(World):
    """A mechanism with a solver of Newton."""

    def __init__(self, mechanism: Mechanism, setting: Setting):
        super().__init__(mechanism)
        newton, model = mechanism.newton, mechanism.model
        self.control, self.after = model.control(), model.state()
        self.solver = solvers.make(newton, model, setting)
        self.once: dict[tuple[float, int], Callable[[], None]] = {}  # by single-precision step and state

    def begin(self, h: float) -> None:
        """Record a step of length h (s) from each of the two states to the other.

        A first step from Python compiles kernels and sets up the solver's memory; a recording runs neither.
        """
        if not self.once:
            self.solver.step(self.mechanism.state, self.after, self.control, None, h)
        for _ in range(2):
            self._recorded(h)
            self._swap()

    def push(self, loads: Sequence[tuple[int, np.ndarray, np.ndarray]]) -> None:
        self.mechanism.push(loads)

    def advance(self, t: float, h: float) -> None:
        self._recorded(h)()
        self._swap()

    def _swap(self) -> None:
        self.mechanism.state, self.after = self.after, self.mechanism.state

    def _recorded(self, h: float) -> Callable[[], None]:
        """Return a step of length h (s) from the present state to the other one."""
        before, after = self.mechanism.state, self.after
        place = (float(np.float32(h)), id(before))
        if place not in self.once:
            self.once[place] = recorded(lambda: self.solver.step(before, after, self.control, None, place[0]))
        return self.once[place]


ENGINE = Newton()
