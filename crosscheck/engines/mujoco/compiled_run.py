"""MuJoCo without Python between samples: ``mj_forward`` in the compiled DOP853, or Newton's method for fully
driven scenes.

States may be projected onto MuJoCo's closures. A fatal error of MuJoCo (mju_error) ends the process, so the
run of a child process is then reported as CRASHED.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from crosscheck.engines.mujoco.families import NEWTON, PROJECTED_COMPILED
from crosscheck.engines.mujoco.model import Compiled
from crosscheck.engines.shared.initial_velocities import may_move_freely
from crosscheck.engines.shared.sampling import Sample
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

if TYPE_CHECKING:
    from crosscheck.engines.mujoco.context import Context

ITERATIONS = 3  # largest number of Newton iterations; one satisfies the equalities to rounding
UNUSED = (
    "CONTACT",
    "LIMIT",
    "FRICTIONLOSS",
    "SENSOR",
    "MIDPHASE",
    "CLAMPCTRL",
    "NATIVECCD",
    "MULTICCD",
    "WARMSTART",
)


def leave_out_unused(mujoco: Any, model: Any) -> None:
    """Switch off the features of MuJoCo that a scene does not need, and iterations that do not increase
    accuracy."""
    for name in UNUSED:
        model.opt.disableflags |= getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}")
    model.opt.iterations = ITERATIONS


def prepare() -> None:
    """Compile the steppers and the C functions, or load them from numba's cache."""
    from crosscheck.engines.mujoco import rates
    from crosscheck.engines.mujoco.compiled_projection import follow, settle
    from crosscheck.engines.shared.compiled import run

    run.prepare()
    assert all(function.address for function in (rates.rates, settle, follow))


@dataclass(frozen=True)
class CompiledRun:
    """A model and its data for the compiled integrators."""

    family: str
    options: Mapping[str, float]
    context: Context
    start: np.ndarray  # (nq + nv,)
    longest: float  # s; longest step

    def trajectory(
        self,
        scene: Scene,
        times: np.ndarray,
        sample: Callable[[float], Sample],
        built: float,
        labels: dict[str, Any],
    ) -> Trajectory:
        """Return the motion from the start; construction took ``built`` seconds."""
        from crosscheck.engines.mujoco.rates import load
        from crosscheck.engines.shared.compiled.run import trajectory

        def put(t: float, y: np.ndarray) -> None:
            load(self.context, t, y)

        system = self._newton() if self.family == NEWTON else self._dop853()
        return trajectory(scene, times, system, self.start, put, sample, built, labels)

    def _dop853(self) -> Any:
        from crosscheck.engines.mujoco.compiled_projection import settle
        from crosscheck.engines.mujoco.rates import rates
        from crosscheck.engines.shared.compiled.dop853 import System
        from crosscheck.engines.shared.compiled.run import MOST_STEPS

        rtol = self.options["rtol"]
        correction = settle.address if self.family == PROJECTED_COMPILED else 0
        return System(
            rates.address,
            self.context.address,
            self.context.quaternions,
            rtol,
            rtol,
            self.options["min_step"],
            self.longest,
            MOST_STEPS,
            correction,
        )

    def _newton(self) -> Any:
        from crosscheck.engines.mujoco.compiled_projection import follow
        from crosscheck.engines.shared.compiled.newton import System

        tolerance = self.options["tolerance"]
        return System(follow.address, self.context.address, tolerance, self.longest)


def compiled_run(
    scene: Scene, built: Compiled, data: Any, family: str, options: Mapping[str, float], longest: float
) -> CompiledRun:
    """Return the run from the data's state; drivers become prescribed coordinates instead of equalities."""
    from crosscheck.engines.mujoco.context import context

    if family == NEWTON and may_move_freely(scene):
        raise ValueError(
            f"{NEWTON} cannot run {scene.name}: joints and drivers do not prescribe the whole motion"
        )
    model = built.model
    for equality, _ in built.drivers:
        data.eq_active[equality] = 0
    drivers = [(int(model.eq_obj1id[equality]), driver) for equality, driver in built.drivers]
    numbers = context(model, data, drivers, is_weighted=family != NEWTON)
    return CompiledRun(family, options, numbers, np.concatenate((data.qpos, data.qvel)), longest)
