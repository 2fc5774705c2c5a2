"""MuJoCo: joint coordinates, loops closed by soft equality constraints.

A driver is an equality constraint on one joint; the adapter writes its reference acceleration at every
evaluation.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from crosscheck.engine import Cannot, Engine, Setting
from crosscheck.engines.mujoco import compiled_run, dampers, derivatives, linearised, original, pivots, stops
from crosscheck.engines.mujoco.families import (
    CHOSEN,
    COMPILED,
    FAMILIES,
    HARD,
    INTEGRATED_HERE,
    OPTIONS,
    own_code,
    sweep,
)
from crosscheck.engines.mujoco.model import SUPPORTS
from crosscheck.engines.mujoco.simulation import Simulation
from crosscheck.engines.mujoco.switched import SERVED, EqualityRun
from crosscheck.engines.mujoco.ways import ALTERNATIVES
from crosscheck.engines.shared.driver_motion import fastest_rate
from crosscheck.engines.shared.initial_velocities import lacks_mass
from crosscheck.engines.shared.planar_scene import planar_scene
from crosscheck.engines.shared.sampling import labels_of, run_through
from crosscheck.engines.shared.switched import refusal, served
from crosscheck.judge.pieces import at_start
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene, intermittent

# parts of a new model that have defaults
DEFAULTS = (
    *("option", "compiler", "default.equality.solref", "default.equality.solimp"),
    *(f"default.joint.{name}" for name in ("armature", "damping", "stiffness", "frictionloss")),
    *(f"default.joint.{name}" for name in ("solref_limit", "solimp_limit")),
)
SCOUT_SAMPLES = 41  # number of samples of the coarse run that measures the scene's fastest rate


class MuJoCo(linearised.Linearised, derivatives.Differentiated, Engine):
    """MuJoCo 4."""

    name = "mujoco"
    package = "mujoco"
    supports = replace(SUPPORTS, intervals=True, stops=True)
    families, options = FAMILIES | original.FAMILIES, OPTIONS | original.OPTIONS
    integrated_here, alternatives = INTEGRATED_HERE, ALTERNATIVES
    defaults_of = tuple(f"mujoco.MjSpec().{part}" for part in DEFAULTS)

    def version(self) -> str:
        """Version of MuJoCo; raises ImportError when it is not installed."""
        import mujoco

        return mujoco.__version__

    def refuses(self, scene: Scene) -> Cannot | None:
        """Refuse scenes without masses whose motion the drivers do not determine completely, joints with
        intervals that no equality of MuJoCo can switch, end stops that no limit can be, point dampers that
        no actuator can be, and inertias below MuJoCo's least one."""
        refused = lacks_mass(at_start(scene)) or refusal(scene, "MuJoCo") or stops.refusal(scene)
        return refused or dampers.refusal(at_start(scene)) or pivots.refusal(at_start(scene))

    def settings(self, scene: Scene) -> Sequence[Setting]:
        """Return fixed steps chosen by the angle that a body turns in one step, and adaptive steps by
        relative tolerance."""
        first = at_start(scene)
        found = sweep(first, fastest_rate(first, lambda step: self._coarse(scene, step)))
        return stops.served(found) if _has_stops(scene) else served(scene, found, SERVED)

    def serves(self, scene: Scene, family: str) -> bool:
        """Return whether a family can run a scene; `tuned` and `chosen` run every scene."""
        return family in ("tuned", CHOSEN) or super().serves(scene, family)

    def settings_of(self, scene: Scene, family: str) -> Sequence[Setting]:
        """Return the settings of a family; of `chosen` the first of the alternatives."""
        if family == CHOSEN:
            return [next(iter(ALTERNATIVES[0].ways.values()))]
        return super().settings_of(scene, family)

    def own_code(self, scene: Scene, setting: Setting) -> str:
        """Return the MJCF of a setting, and Python statements for options that MJCF does not have."""
        return original.own_code(setting) if setting.family in original.FAMILIES else own_code(setting)

    def prepare(self, families: Sequence[str]) -> None:
        """Compile the code of the compiled families."""
        if set(COMPILED) & set(families):
            compiled_run.prepare()

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        """Simulate a scene; raises ValueError for an unknown family of settings."""
        if setting.family in original.FAMILIES:
            return original.run(scene, times, setting, self.version())
        if setting.family in COMPILED and (planar := planar_scene(scene)) is not scene:
            return replace(self.run(planar, times, setting), reactions=None)
        start = time.process_time()
        labels = labels_of(self, setting)
        if _has_stops(scene):
            stopped = stops.StoppedRun(scene, setting)
            with stopped.run.installed(), np.errstate(all="ignore"):
                return stopped.trajectory(times, start, labels)
        if any(intermittent(scene)):
            switched = EqualityRun(scene, setting)
            with switched.run.installed(), np.errstate(all="ignore"):
                return switched.trajectory(times, switched.run.counts, start, labels)
        run = Simulation(scene, setting)
        with run.installed(), np.errstate(all="ignore"):
            if setting.family in COMPILED:
                return run.integrated(times, start, labels)
            built = time.process_time() - start
            return run_through(scene, times, run.advance, run.sample, run.counts, built, labels)

    def _coarse(self, scene: Scene, step: float) -> Trajectory:
        times = np.linspace(0, scene.duration, SCOUT_SAMPLES)
        return self.run(scene, times, Setting("tuned", {"step": step, "beta": 0.5 / step, "hard": HARD}))


def _has_stops(scene: Scene) -> bool:
    """Return whether a joint has an end stop."""
    return any(joint.end_stop for joint in scene.joint)


ENGINE = MuJoCo()
