"""Pinocchio: rigid-body dynamics in joint coordinates, with loops closed by its proximal constraint solver.

Pinocchio has no integrator of its own; the families (FAMILIES) combine ``constraintDynamics`` with different
integrators and stabilisations.

A driven coordinate has an armature of 1e18 kg m² and a matching torque, so that it follows its driver to
rounding.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from crosscheck.engine import Cannot, Engine, Owner, Setting
from crosscheck.engines.pinocchio import compiled_run, derivatives
from crosscheck.engines.pinocchio.families import (
    ALTERNATIVES,
    CHOSEN,
    COMPILED,
    FAMILIES,
    OPTIONS,
    own_code,
    sweep,
)
from crosscheck.engines.pinocchio.model import SUPPORTS
from crosscheck.engines.pinocchio.simulation import Simulation
from crosscheck.engines.pinocchio.switched import SERVED, ConstraintRun
from crosscheck.engines.shared.driver_motion import fastest_rate
from crosscheck.engines.shared.initial_velocities import lacks_mass
from crosscheck.engines.shared.planar_scene import planar_scene
from crosscheck.engines.shared.sampling import labels_of, run_through
from crosscheck.engines.shared.switched import refusal, served
from crosscheck.judge.pieces import at_start
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene, intermittent

SCOUT_RTOL = 1e-5
SCOUT_SAMPLES = 41  # number of samples of the coarse run that measures the scene's fastest rate


class Pinocchio(derivatives.Differentiated, Engine):
    """Pinocchio (PyPI ``pin``)."""

    name = "pinocchio"
    package = "pin"
    supports = replace(SUPPORTS, intervals=True)
    families, options, integrated_here = FAMILIES, OPTIONS, tuple(FAMILIES)
    alternatives = ALTERNATIVES
    defaults_of = ("pinocchio.ProximalSettings()",)

    def version(self) -> str:
        """Version of Pinocchio; raises ImportError when it is not installed."""
        import pinocchio

        return pinocchio.__version__

    def refuses(self, scene: Scene) -> Cannot | None:
        """Refuse couplings, and scenes without masses whose motion is not prescribed in full."""
        if scene.coupling:
            reason = f"coupling {scene.coupling[0].name!r}: constraintDynamics couples no joint coordinates"
            return Cannot(Owner.ENGINE, reason)
        return lacks_mass(at_start(scene)) or refusal(scene, "Pinocchio")

    def settings(self, scene: Scene) -> Sequence[Setting]:
        """Return fixed steps by the angle that a body turns in one step, and adaptive steps by tolerance."""
        first = at_start(scene)
        rate = fastest_rate(first, lambda step: self._coarse(scene, step))
        return served(scene, sweep(first, rate), SERVED)

    def serves(self, scene: Scene, family: str) -> bool:
        """Return whether a family can run a scene; `tuned` and `chosen` run every scene."""
        return family in ("tuned", CHOSEN) or super().serves(scene, family)

    def settings_of(self, scene: Scene, family: str) -> Sequence[Setting]:
        """Return the settings of a family; of `chosen` the first of the alternatives."""
        if family == CHOSEN:
            return [next(iter(ALTERNATIVES[0].ways.values()))]
        return super().settings_of(scene, family)

    def own_code(self, scene: Scene, setting: Setting) -> str:
        """Return the settings of constraintDynamics; empty if crosscheck's DOP853 integrates."""
        return own_code(setting)

    def prepare(self, families: Sequence[str]) -> None:
        """Compile the integrators and the library of the compiled families."""
        if set(COMPILED) & set(families):
            compiled_run.prepare()

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        """Simulate a scene; raises ValueError for an unknown family."""
        if setting.family in COMPILED and (planar := planar_scene(scene)) is not scene:
            return replace(self.run(planar, times, setting), reactions=None)
        start = time.process_time()
        python = Setting("dop853", setting.options) if setting.family in COMPILED else setting
        labels = labels_of(self, setting)
        if any(intermittent(scene)):
            switched = ConstraintRun(scene, setting)
            with np.errstate(all="ignore"):
                return switched.trajectory(times, switched.run.counts, start, labels)
        run = Simulation(scene, python)
        with np.errstate(all="ignore"):
            if setting.family in COMPILED:
                return run.without_python(times, setting, start, labels)
            built = time.process_time() - start
            return run_through(scene, times, run.advance, run.sample, run.counts, built, labels)

    def _coarse(self, scene: Scene, step: float) -> Trajectory:
        times = np.linspace(0, scene.duration, SCOUT_SAMPLES)
        return self.run(scene, times, Setting("tuned", {"rtol": SCOUT_RTOL, "min_step": step}))


ENGINE = Pinocchio()
