"""Newton: maximal coordinates with Kamino, which is made for closed loops, and Newton's other solvers.

Newton computes in single precision, here on the processor. Kernels are compiled before the first timed run,
which takes minutes, and are kept by Warp.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec

import numpy as np

from crosscheck.engine import Cannot, Engine, Owner, Setting, Supports
from crosscheck.engines.driver_motion import stated_rate
from crosscheck.engines.fixed_steps import FixedSteps, Loads, simulated, steps, unended_piece
from crosscheck.engines.initial_velocities import lacks_mass
from crosscheck.engines.newton import solvers
from crosscheck.engines.newton.model import Mechanism, imported
from crosscheck.engines.newton.solvers import FAMILIES
from crosscheck.engines.sampling import step_count
from crosscheck.engines.spanning_tree import spanning_tree
from crosscheck.engines.tree_reactions import LinkMotion
from crosscheck.engines.warp_graphs import recorded
from crosscheck.refusals import FACTOR
from mbref.scene import Scene
from mbref.trajectory import Trajectory

DEFAULT_STEP = 1e-3  # s
FINER = 1  # number of further, finer steps
MOST_STEPS = 10_000  # a step takes 0.01 to 100 ms of CPU time
JOINTS = ("fixed", "revolute", "universal", "spherical", "translational", "cylindrical")
CLOSES = {
    solvers.MUJOCO: ("spherical", "revolute", "fixed")
}  # types of joints that close a loop; by default all
OPTIONS = {
    "step": "time step, s",
    "alpha": "fraction of a joint error that a step of Kamino removes",
}


class Newton(Engine):
    """Newton (PyPI ``newton``)."""

    name = "newton"
    package = "newton"
    supports = Supports(
        joints=(*JOINTS, "distance"),
        drivers=("angle", "displacement"),  # declared, so that the refusal names the engine
        loads=("moment", "force", "spring"),
        over_time=(FACTOR,),
    )
    families, options = FAMILIES, OPTIONS
    rounding = 2.0**-23

    def prepare(self, families: Sequence[str]) -> None:
        imported()

    def refuses(self, scene: Scene) -> Cannot | None:
        """Refuse drivers, bodies without mass, and loads over time that have pieces."""
        if scene.driver:
            named = f"the driver of joint {scene.driver[0].joint!r}"
            return Cannot(
                Owner.ENGINE, f"Newton moves joints by springs to a target, so {named} has no counterpart"
            )
        return lacks_mass(scene) or unended_piece(scene)

    def settings(self, scene: Scene) -> Sequence[Setting]:
        """Return steps chosen by the angle that a body turns in one step, coarse to fine in each family."""
        fine = steps(scene, stated_rate(scene), finer=FINER)
        few = [h for h in fine if scene.duration / h <= MOST_STEPS] or fine[:1]
        plain = sorted({*few, DEFAULT_STEP}, reverse=True)
        return [
            Setting(family, {"step": h, **options})
            for family, options in self._options(scene).items()
            for h in (plain if family == solvers.DEFAULTS else few)
        ]

    def _options(self, scene: Scene) -> Mapping[str, Mapping[str, float]]:
        """Return the further options of each family that serves a scene."""
        served = [family for family in FAMILIES if self.serves(scene, family)]
        return {
            family: {"alpha": solvers.ALPHAS[family]} if family in solvers.ALPHAS else {} for family in served
        }

    def serves(self, scene: Scene, family: str) -> bool:
        """Return whether a family serves a scene.

        SolverMuJoCo needs the package mujoco-warp. PADMM and DVI stop with an error where no joint constrains
        a body.
        """
        lacking = family == solvers.MUJOCO and find_spec("mujoco_warp") is None
        unbound = family in solvers.BOUND and not scene.joint
        return family in FAMILIES and not lacking and not unbound

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        """Simulate a scene; raises ValueError for an unknown family."""
        return simulated(self, scene, times, setting, lambda: _simulation(scene, times, setting))


def _simulation(scene: Scene, times: np.ndarray, setting: Setting) -> FixedSteps:
    tree, longest = spanning_tree(scene, CLOSES.get(setting.family, JOINTS)), setting.options["step"]
    world = _World(Mechanism(scene, tree), setting)
    for end in times[times > 0.0][:1]:  # before the timed run
        world.record(end / step_count(0.0, end, longest))
    return FixedSteps(scene, tree, world, longest)


class _World:
    """A mechanism with a solver of Newton, and its loads."""

    def __init__(self, mechanism: Mechanism, setting: Setting):
        self.mechanism = mechanism
        self.loads = Loads(mechanism.scene, mechanism.tree, self.motion)
        newton, model = mechanism.newton, mechanism.model
        self.control, self.after = model.control(), model.state()
        self.solver = solvers.make(newton, model, setting)
        self.once: dict[tuple[float, int], Callable[[], None]] = {}  # by single-precision step and state

    def step(self, t: float, h: float, count: int) -> None:
        """Take ``count`` steps of length h (s) from time t."""
        mechanism = self.mechanism
        for n in range(count):
            if mechanism.scene.load:
                mechanism.push(self.loads.at(t + n * h))
            self._recorded(h)()
            self._swap()

    def record(self, h: float) -> None:
        """Record a step of length h (s) from each of the two states to the other.

        A first step from Python compiles kernels and sets up the solver's memory; a recording runs neither.
        """
        self.solver.step(self.mechanism.state, self.after, self.control, None, h)
        for _ in range(2):
            self._recorded(h)
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

    def motion(self) -> LinkMotion:
        """Return the motion of the links."""
        return self.mechanism.motion()


ENGINE = Newton()
