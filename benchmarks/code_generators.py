"""Code generators as opponents: CasADi's C code in DOP853, and heyoka's Taylor series.

Both are given the equations of `tree_equations`, as a user of theirs would derive them for one mechanism.
CasADi eliminates common subexpressions, and a C compiler optimises its code and the integrator as one piece
for this machine; the step control is that of crosscheck's compiled DOP853.  heyoka compiles its series
itself.  Making the code is construction, not stepping.
"""

from __future__ import annotations

import ctypes
import functools
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from tree_equations import Symbol, TreeEquations, bare, symbolic

from crosscheck.engine import Cannot, Engine, Owner, Setting
from crosscheck.engines.compiled import dop853
from mbref.scene import Scene
from mbref.trajectory import Cost, Outcome, Trajectory

COMPILE = ("-O3", "-march=native", "-fno-math-errno", "-shared", "-fPIC", "-w")
INTEGRATOR = Path(__file__).with_name("dop853.c")
WRAPPER = """
static void {macro}(const double *y, double *result) {{
  double memory[{work} + 1], found[N];
  const double *arguments[1] = {{y}}; double *results[1] = {{found}};
  {name}(arguments, results, 0, memory, 0);
  for (int i = 0; i < N; i++) result[i] = found[i];
}}
"""
ENDS = {1: "the motion is not finite", 2: "no step is short enough", 3: "too many steps"}
PLAIN, PROJECTED = "dop853, compiled", "projected, compiled"
RATE = 0.1  # 1/s, of the closures where they are not projected; `grids` tries others
LEAST_TURN = 0.03  # rad turned within the shortest step, which only singular positions need
SCOUT = 1e-6  # relative tolerance of the run that finds how fast a scene turns
SCOUTED = 101  # samples of that run
TAYLOR_TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10, 1e-12)


@functools.lru_cache(maxsize=4)
def equations_of(scene: Scene) -> TreeEquations:
    """The equations of a scene; raises ValueError where they are not derived."""
    return TreeEquations(scene)


class Generator(Engine):
    """A generator of code from symbolic equations."""

    def version(self) -> str:
        return str(__import__(self.package).__version__)

    def cannot(self, scene: Scene) -> Cannot | None:
        try:
            equations_of(scene)
        except ValueError as reason:
            return Cannot(Owner.ADAPTER, f"its equations are not derived: {reason}")
        return None

    def _trajectory(
        self, scene: Scene, times: np.ndarray, setting: Setting, states: np.ndarray, message: str, cost: Cost
    ) -> Trajectory:
        """The bodies at the states (k, 2 n) reached."""
        return Trajectory(
            scene.name, self.name, self.version(), setting.family, dict(setting.options),
            times[: len(states)], tuple(body.name for body in scene.body),
            **equations_of(scene).motion(states),
            outcome=Outcome.STEP_FAILED if message else Outcome.COMPLETED, message=message,
            t_end=float(times[len(states) - 1]) if len(states) else 0.0, cost=cost,
        )  # fmt: skip


class CasADi(Generator):
    """C code by CasADi, with closure errors fed back at a rate, or projected after each step."""

    name = package = "casadi"

    def settings(self, scene: Scene) -> Sequence[Setting]:
        shortest = float(f"{LEAST_TURN / _fastest(scene):.2g}")
        given: list[tuple[str, dict[str, float]]] = [(PLAIN, {"beta": RATE}), (PROJECTED, {})]
        return [
            Setting(family, {"rtol": SCOUT, "min_step": shortest, **options}) for family, options in given
        ]

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        began, equations = time.process_time(), equations_of(scene)
        library = _library(scene, setting.options.get("beta", 0.0))
        built = time.process_time() - began
        run = _Run(times, equations.start)
        began = time.process_time()
        run.advance(library, setting)
        seconds = time.process_time() - began
        message = "" if run.status == 0 else ENDS[run.status]
        cost = Cost(seconds, built, *(int(count) for count in run.counts[:3]))
        return self._trajectory(scene, times, setting, run.samples[: run.counts[3]], message, cost)


@functools.lru_cache(maxsize=16)
def _fastest(scene: Scene) -> float:
    """The fastest rate (rad/s or m/s) of a joint coordinate in a coarse run."""
    equations = equations_of(scene)
    run = _Run(np.linspace(0.0, scene.duration, SCOUTED), equations.start)
    run.advance(_library(scene, RATE), Setting(PLAIN, {"rtol": SCOUT, "min_step": 1e-5 * scene.duration}))
    rates = run.samples[: run.counts[3], equations.n :]
    return float(np.abs(rates[np.isfinite(rates).all(axis=1)]).max())


class _Run:
    """Arrays of one integration."""

    def __init__(self, times: np.ndarray, start: np.ndarray):
        self.times, self.start = np.ascontiguousarray(times, dtype=float), start
        self.samples, self.counts = np.zeros((len(times), len(start))), np.zeros(4, dtype=np.int64)
        self.status = 0

    def advance(self, library: ctypes.CDLL, setting: Setting) -> None:
        """From the start to the last time."""
        options = setting.options
        self.status = library.integrate(
            _pointer(self.start), _pointer(self.times), ctypes.c_long(len(self.times)),
            ctypes.c_double(options["rtol"]), ctypes.c_double(options["min_step"]),
            ctypes.c_int(setting.family == PROJECTED), _pointer(self.samples), _pointer(self.counts),
        )  # fmt: skip


def _pointer(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


@functools.lru_cache(maxsize=16)
def _library(scene: Scene, beta: float) -> ctypes.CDLL:
    """The integrator compiled with the rates and the projection of a state."""
    import casadi

    equations, arithmetic = equations_of(scene), symbolic(casadi.sin, casadi.cos)
    symbols = casadi.SX.sym("y", 2 * equations.n)
    y = [Symbol(entry) for entry in casadi.vertsplit(symbols)]
    q, v = y[: equations.n], y[equations.n :]
    found = {
        "rates": [*v, *equations.accelerations(q, v, arithmetic, beta)],
        "settled": np.concatenate(equations.settled(q, v, arithmetic)),
    }
    code, parts = casadi.CodeGenerator("code.c"), [_tableau(), f"#define N {len(y)}\n"]
    for macro, (name, outputs) in zip(("RATES", "SETTLED"), found.items(), strict=True):
        function = casadi.Function(name, [symbols], [casadi.vertcat(*bare(outputs))], {"cse": True})
        code.add(function)
        parts.append(WRAPPER.format(macro=macro, name=name, work=function.sz_w()))
    settle = "#define SETTLE(y) SETTLED(y, y)\n"
    return _compiled("".join([code.dump(), *parts, settle, INTEGRATOR.read_text()]))


def _tableau() -> str:
    """DOP853's coefficients as C arrays."""
    stages = dop853.STAGES
    arrays = {"B": dop853.B, "E3": dop853.ERROR3, "E5": dop853.ERROR5}
    text = "".join(f"static const double {name}[{stages}] = {_c(array)};\n" for name, array in arrays.items())
    rows = ", ".join(_c(row) for row in dop853.A)
    return f"#define STAGES {stages}\n{text}static const double A[{stages}][{stages}] = {{{rows}}};\n"


def _c(array: np.ndarray) -> str:
    return "{" + ", ".join(repr(float(number)) for number in array) + "}"


def _compiled(text: str) -> ctypes.CDLL:
    """The library of a C source; raises ImportError without a compiler."""
    compiler = os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        raise ImportError("CasADi's code needs a C compiler, and there is none")
    with tempfile.TemporaryDirectory() as folder:
        source, shared = Path(folder, "code.c"), Path(folder, "code.so")
        source.write_text(text)
        subprocess.run([compiler, *COMPILE, str(source), "-o", str(shared), "-lm"], check=True)
        return ctypes.CDLL(str(shared))


class Heyoka(Generator):
    """Taylor series of the order that heyoka chooses for a tolerance, dense output at the samples."""

    name = package = "heyoka"

    def settings(self, scene: Scene) -> Sequence[Setting]:
        return [Setting("taylor_adaptive", {"tol": tol}) for tol in TAYLOR_TOLERANCES]

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        import heyoka

        began, equations = time.process_time(), equations_of(scene)
        integrator, longest = _integrator(scene, setting.options["tol"]), float(np.diff(times).max())
        built, began = time.process_time() - began, time.process_time()
        integrator.time, integrator.state[:] = 0.0, equations.start
        outcome, *_, steps, _, states = integrator.propagate_grid(times, max_delta_t=longest)
        seconds = time.process_time() - began
        reached = outcome == heyoka.taylor_outcome.time_limit and np.isfinite(states).all()
        message = "" if reached else f"the integrator ended with {outcome.name}"
        states = states if reached else states[:0]
        return self._trajectory(scene, times, setting, states, message, Cost(seconds, built, int(steps)))


@functools.lru_cache(maxsize=16)
def _integrator(scene: Scene, tol: float) -> Any:
    """The compiled integrator of a scene."""
    import heyoka

    equations, arithmetic = equations_of(scene), symbolic(heyoka.sin, heyoka.cos)
    symbols = heyoka.make_vars(*(f"y{i}" for i in range(2 * equations.n)))
    y = [Symbol(symbol) for symbol in symbols]
    q, v = y[: equations.n], y[equations.n :]
    accelerations = bare(equations.accelerations(q, v, arithmetic, 0.0))
    rates = [*symbols[equations.n :], *map(heyoka.expression, accelerations)]
    return heyoka.taylor_adaptive(list(zip(symbols, rates, strict=True)), list(equations.start), tol=tol)


CASADI, HEYOKA = CasADi(), Heyoka()
