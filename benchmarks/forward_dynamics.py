"""One call of an engine's forward dynamics at the start of a scene, from Python: microseconds.

MuJoCo's ``mj_forward`` and Pinocchio's ``constraintDynamics``, with the defaults and with the tuned settings
of their adapters.  Exudyn offers no accelerations of a state; the table has the cost of one Newton iteration
of its trapezoidal rule instead: a run's seconds divided by its iterations.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np

from crosscheck.engine import Setting, engine
from mbref.scene import Scene

CALLS = 2000
STEPS = 1600  # of the run that Exudyn's iterations are counted in

Timed = Callable[[], float]  # process CPU seconds of one call


def timed_calls(scene: Scene) -> Iterator[tuple[str, Timed]]:
    """Return (name of a call, function that times the call) for every installed engine."""
    for name, calls in (("mujoco", _mujoco), ("pinocchio", _pinocchio), ("exudyn", _exudyn)):
        try:
            engine(name).version()
        except ImportError:
            continue
        yield from calls(scene)


def _coarsest(name: str, scene: Scene, family: str) -> Setting:
    return next(setting for setting in engine(name).settings(scene) if setting.family == family)


def _repeated(call: Callable[[], object]) -> float:
    began = time.process_time()
    for _ in range(CALLS):
        call()
    return (time.process_time() - began) / CALLS


def _mujoco(scene: Scene) -> Iterator[tuple[str, Timed]]:
    import mujoco

    from crosscheck.engines.mujoco.simulation import Simulation

    for family in ("defaults", "tuned"):
        run = Simulation(scene, _coarsest("mujoco", scene, family))

        def call(run=run) -> float:
            with run.installed():
                return _repeated(lambda: mujoco.mj_forward(run.model, run.data))

        yield f"mj_forward, {family}", call


def _pinocchio(scene: Scene) -> Iterator[tuple[str, Timed]]:
    from crosscheck.engines.pinocchio.simulation import Simulation

    for family in ("defaults", "tuned"):
        run = Simulation(scene, _coarsest("pinocchio", scene, family))
        q, v = run.split(0.0, run.y)
        torques = run.loads.constant if run.still else run.loads.torques(0.0, q, v)
        arguments = run.model, run.data, q, v, torques, run.closures, run.closure_data, run.solver

        def call(run=run, arguments=arguments) -> float:
            return _repeated(lambda: run.pin.constraintDynamics(*arguments))

        yield f"constraintDynamics, {family}", call


def _exudyn(scene: Scene) -> Iterator[tuple[str, Timed]]:
    simulator, times = engine("exudyn"), np.array([0.0, scene.duration])
    setting = Setting("trapezoidal", {"step": scene.duration / STEPS})

    def call() -> float:
        cost = simulator.run(scene, times, setting).cost
        return cost.seconds / cost.newton if cost.newton else np.nan

    yield "Exudyn, a Newton iteration", call
