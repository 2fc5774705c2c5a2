"""heyoka: Taylor series of a mechanism's equations in joint coordinates, compiled by heyoka.

heyoka chooses the order for a tolerance; samples are its dense output.  Closure errors are neither fed back
nor projected. A compiled integrator is stored in the user's cache folder by scene, tolerance, heyoka's
version and machine.
"""

from __future__ import annotations

import functools
import pickle
import platform
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engine import Alternatives, Setting
from crosscheck.engines.shared import file_cache
from crosscheck.engines.shared.sampling import Failed
from crosscheck.engines.shared.symbolic.generator import RTOL, Generator, equations_of, origin, sweep
from crosscheck.engines.shared.symbolic.symbols import Symbol, bare, symbolic
from mbref.motions.trajectory import Cost, Outcome, Trajectory
from mbref.scene import Scene

FOLDER = "heyoka"  # folder in the cache
FAMILY = "taylor"
FAMILIES = {FAMILY: "Taylor series of the order that heyoka chooses, without stabilisation of closures"}
RTOLS = (1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10, 1e-12)
MOST_STEPS = 10**6
# generated code: its name, and heyoka's options that make it
CODES = {"unrolled": {}, "compact": {"compact_mode": True}, "high accuracy": {"high_accuracy": True}}
OPTIONS = RTOL | {"code": f"generated code: {', '.join(CODES)}"}
WAYS = {name: Setting(FAMILY, {"rtol": 1e-12, "code": name}) for name in CODES}


class Heyoka(Generator):
    """heyoka (PyPI ``heyoka``)."""

    name = package = "heyoka"
    modules = ("heyoka",)
    families, options, alternatives = FAMILIES, OPTIONS, (Alternatives(WAYS, 1e-9),)

    def settings(self, scene: Scene) -> Sequence[Setting]:
        """Return the settings of the one family, by tolerance."""
        return sweep(FAMILY, RTOLS)

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        """Simulate a scene; raises ValueError for an unknown family."""
        self._known(setting)
        began, equations = time.process_time(), equations_of(scene)
        integrator = _integrator(scene, setting.options["rtol"], setting.options.get("code", "unrolled"))
        integrator.time, integrator.state[:] = 0.0, equations.start
        built, began = time.process_time() - began, time.process_time()
        states, ending, steps = _propagated(integrator, times, equations.start)
        seconds = time.process_time() - began
        good = int(np.isfinite(states).all(axis=1).cumprod().sum())
        t, failure = float(integrator.time), None
        if good < len(times):
            failure = Failed(Outcome.STEP_FAILED, t, f"the integrator ended at {t:.6g} s with {ending}")
        return self._trajectory(scene, times, setting, states[:good], failure, Cost(seconds, built, steps))


def _propagated(integrator: Any, times: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, str, int]:
    """Return states (k, 2 n) at the times that were reached, how the integrator ended, and its number of
    steps."""
    grid = np.array(times if times[0] == 0.0 else [0.0, *times], dtype=float)
    if len(grid) == 1:
        return start[None], "", 0
    longest = float(np.diff(grid).max())
    outcome, *_, steps, _, states = integrator.propagate_grid(grid, max_delta_t=longest, max_steps=MOST_STEPS)
    return states[len(grid) - len(times) :], outcome.name, int(steps)


@functools.lru_cache(maxsize=16)
def _integrator(scene: Scene, rtol: float, code: str) -> Any:
    """Return the compiled integrator of a scene, from the cache or compiled now."""
    import heyoka

    made_of = origin(scene, repr(rtol), code, heyoka.__version__, platform.node(), Path(__file__).read_text())
    path = file_cache.made_once(
        FOLDER, made_of, ".pickle", lambda target: _write(target, _made(scene, rtol, code))
    )
    return pickle.loads(path.read_bytes())


def _write(target: Path, integrator: Any) -> None:
    target.write_bytes(pickle.dumps(integrator))


def _made(scene: Scene, rtol: float, code: str) -> Any:
    import heyoka

    equations, arithmetic = equations_of(scene), symbolic(heyoka.sin, heyoka.cos)
    symbols = heyoka.make_vars(*(f"y{i}" for i in range(2 * equations.n)))
    y = [Symbol(symbol) for symbol in symbols]
    q, v = y[: equations.n], y[equations.n :]
    accelerations = bare(equations.accelerations(q, v, arithmetic, 0.0))
    rates = [*symbols[equations.n :], *map(heyoka.expression, accelerations)]
    return heyoka.taylor_adaptive(
        list(zip(symbols, rates, strict=True)), list(equations.start), tol=rtol, **CODES[code]
    )


ENGINE = Heyoka()
