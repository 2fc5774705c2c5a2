"""CasADi: generated C code for a mechanism's equations in joint coordinates, integrated by a compiled DOP853.

CasADi eliminates common subexpressions. A C compiler optimises this code together with the integrator for
this machine. The step control equals the step control of ``crosscheck.engines.shared.compiled.dop853``.
"""

from __future__ import annotations

import ctypes
import functools
import time
from collections.abc import Sequence

import numpy as np

from crosscheck.engine import Alternatives, Cannot, Owner, Setting
from crosscheck.engines.casadi.library import library, why_not
from crosscheck.engines.shared.driver_motion import stated_rate
from crosscheck.engines.shared.sampling import Failed
from crosscheck.engines.shared.symbolic.generator import RTOL, Generator, equations_of, sweep
from mbref.motions.trajectory import Cost, Outcome, Trajectory
from mbref.scene import Scene

PLAIN, PROJECTED = "dop853, compiled", "projected, compiled"
FAMILIES = {
    PROJECTED: "CasADi's C code in a compiled DOP853, states projected onto the closures after each step",
    PLAIN: "CasADi's C code in a compiled DOP853, closure errors fed back",
}
OPTIONS = {
    **RTOL,
    "min_step": "shortest step (s); the error is not tested below it",
    "beta": "decay rate of the closure errors, a double root (1/s)",
}
RTOLS = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11)
EXACT = {"rtol": 1e-11, "min_step": 1e-6}
WAYS = {PROJECTED: Setting(PROJECTED, EXACT), PLAIN: Setting(PLAIN, {**EXACT, "beta": 0.1})}
ENDS = {  # status: outcome and sentence
    1: (Outcome.NOT_FINITE, "the motion is not finite after {t:.6g} s"),
    2: (Outcome.STEP_FAILED, "no step after {t:.6g} s is short enough for the tolerance"),
    3: (Outcome.STEP_FAILED, "{steps} steps have only reached {t:.6g} s"),
}
RATE = 0.1  # 1/s; decay rate of the closure errors if they are not projected
LEAST_TURN = 0.03  # rad; largest rotation within the shortest step, which only singular positions need
SCOUT = {"rtol": 1e-6}  # setting of the coarse run that measures the scene's fastest rate
SCOUT_STEP, SCOUTED = 1e-5, 101  # coarse run: shortest step / duration, number of samples


class CasADi(Generator):
    """CasADi (PyPI ``casadi``), which needs a C compiler."""

    name = package = "casadi"
    families, options, integrated_here = FAMILIES, OPTIONS, tuple(FAMILIES)
    alternatives = (Alternatives(WAYS, 1e-8),)

    def refuses(self, scene: Scene) -> Cannot | None:
        """Refuse what the equations refuse, and every scene without a C compiler."""
        if found := super().refuses(scene):
            return found
        return Cannot(Owner.ADAPTER, reason) if (reason := why_not()) else None

    def settings(self, scene: Scene) -> Sequence[Setting]:
        """Return both families by relative tolerance; the shortest step follows from the fastest rate in a
        coarse run."""
        shortest = float(f"{LEAST_TURN / _fastest(scene):.2g}")
        fed_back = sweep(PLAIN, RTOLS, min_step=shortest, beta=RATE)
        return [*sweep(PROJECTED, RTOLS, min_step=shortest), *fed_back]

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        """Simulate a scene; raises ValueError for an unknown family."""
        self._known(setting)
        began, equations = time.process_time(), equations_of(scene)
        compiled = library(scene, setting.options.get("beta", 0.0))
        run, built = _Run(times, equations.start), time.process_time() - began
        began = time.process_time()
        run.advance(compiled, setting)
        seconds = time.process_time() - began
        cost = Cost(seconds, built, *(int(count) for count in run.counts[:3]))
        return self._trajectory(scene, times, setting, run.reached(), run.failure(), cost)


@functools.lru_cache(maxsize=16)
def _fastest(scene: Scene) -> float:
    """Return the fastest rate (rad/s or m/s) of a joint coordinate in a coarse run, or the rate that a scene
    states if that is larger."""
    equations = equations_of(scene)
    run = _Run(np.linspace(0.0, scene.duration, SCOUTED), equations.start)
    run.advance(library(scene, 0.0), Setting(PROJECTED, {**SCOUT, "min_step": SCOUT_STEP * scene.duration}))
    rates = run.reached()[:, equations.n :]
    return float(np.abs(rates[np.isfinite(rates).all(axis=1)]).max(initial=stated_rate(scene)))


class _Run:
    """Arrays of one integration."""

    def __init__(self, times: np.ndarray, start: np.ndarray):
        self.times, self.start = np.ascontiguousarray(times, dtype=float), start
        self.samples, self.counts = np.zeros((len(times), len(start))), np.zeros(4, dtype=np.int64)
        self.status, self.clock = 0, np.zeros(1)

    def advance(self, compiled: ctypes.CDLL, setting: Setting) -> None:
        """Integrate from the start to the last time."""
        options = setting.options
        self.status = compiled.integrate(
            _pointer(self.start),
            _pointer(self.times),
            ctypes.c_int64(len(self.times)),
            ctypes.c_double(options["rtol"]),
            ctypes.c_double(options["min_step"]),
            ctypes.c_int(setting.family == PROJECTED),
            _pointer(self.samples),
            _pointer(self.counts),
            _pointer(self.clock),
        )

    def reached(self) -> np.ndarray:
        """Return the states (k, 2 n) at the times that were reached."""
        return self.samples[: self.counts[3]]

    def failure(self) -> Failed | None:
        """Return the failure of an integration that ended before the last time."""
        if self.status == 0:
            return None
        outcome, sentence = ENDS[self.status]
        t = float(self.clock[0])
        return Failed(outcome, t, sentence.format(t=t, steps=int(self.counts[0])))


def _pointer(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


ENGINE = CasADi()
