"""The C code of a scene, compiled together with the integrator ``dop853.c`` for this machine.

The library is stored in the user's cache folder by scene, decay rate of its closures, CasADi's version,
compiler command, sources and machine. A stored library needs neither CasADi nor a compiler.
"""

from __future__ import annotations

import ctypes
import functools
import platform
import tempfile
from collections.abc import Iterable
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engines.shared import file_cache
from crosscheck.engines.shared.compiled import dop853
from crosscheck.engines.shared.compiler import C, NoLibrary
from crosscheck.engines.shared.symbolic.generator import equations_of, origin
from crosscheck.engines.shared.symbolic.symbols import Symbol, bare, symbolic
from mbref.scene import Scene

FOLDER = "casadi"  # name of the folder in the cache
FLAGS = ("-O3", "-march=native", "-fno-math-errno", "-shared", "-fPIC", "-w")
INTEGRATOR = Path(__file__).with_name("dop853.c")
WRAPPER = """
static void {macro}(const double *y, double *result) {{
  double memory[{work} + 1], found[N];
  const double *arguments[1] = {{y}}; double *results[1] = {{found}};
  {name}(arguments, results, 0, memory, 0);
  for (int i = 0; i < N; i++) result[i] = found[i];
}}
"""


def why_not() -> str:
    """Return the reason why no library can be compiled here, in a sentence; empty if nothing is missing."""
    try:
        C.path()
    except NoLibrary as reason:
        return str(reason)
    return ""


@functools.lru_cache(maxsize=16)
def library(scene: Scene, beta: float) -> ctypes.CDLL:
    """Return the compiled integrator with the rates and the projection of a state; raises NoLibrary."""
    made_of = _origin(scene, beta)
    path = file_cache.made_once(FOLDER, made_of, ".so", lambda target: _compile(_source(scene, beta), target))
    return ctypes.CDLL(str(path))


def _origin(scene: Scene, beta: float) -> str:
    sources = (Path(__file__).read_text(), INTEGRATOR.read_text())
    command = (C.path(), *FLAGS, platform.node())
    return origin(scene, repr(beta), metadata.version("casadi"), *command, *sources)


def _source(scene: Scene, beta: float) -> str:
    """Return the C code: coefficients, rates, projection and integrator."""
    import casadi

    equations, arithmetic = equations_of(scene), symbolic(casadi.sin, casadi.cos)
    symbols = casadi.SX.sym("y", 2 * equations.n)
    y = [Symbol(entry) for entry in casadi.vertsplit(symbols)]
    q, v = y[: equations.n], y[equations.n :]
    found: dict[str, Iterable[Any]] = {
        "rates": [*v, *equations.accelerations(q, v, arithmetic, beta)],
        "settled": np.concatenate(equations.settled(q, v, arithmetic)),
    }
    code, parts = casadi.CodeGenerator("code.c"), [_tableau(), f"#define N {len(y)}\n"]
    for macro, (name, outputs) in zip(("RATES", "SETTLED"), found.items(), strict=True):
        function = casadi.Function(name, [symbols], [casadi.vertcat(*bare(outputs))], {"cse": True})
        code.add(function)
        parts.append(WRAPPER.format(macro=macro, name=name, work=function.sz_w()))
    settle = "#define SETTLE(y) SETTLED(y, y)\n"
    return "".join([code.dump(), *parts, settle, INTEGRATOR.read_text()])


def _tableau() -> str:
    """Return DOP853's coefficients as C arrays."""
    stages = dop853.STAGES
    arrays = {"B": dop853.B, "E3": dop853.ERROR3, "E5": dop853.ERROR5}
    text = "".join(f"static const double {name}[{stages}] = {_c(array)};\n" for name, array in arrays.items())
    rows = ", ".join(_c(row) for row in dop853.A)
    return f"#define STAGES {stages}\n{text}static const double A[{stages}][{stages}] = {{{rows}}};\n"


def _c(array: np.ndarray) -> str:
    return "{" + ", ".join(repr(float(number)) for number in array) + "}"


def _compile(text: str, target: Path) -> None:
    """Compile a C source; raises NoLibrary with the compiler's message."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder, "code.c")
        source.write_text(text)
        C.run([C.path(), *FLAGS, str(source), "-o", str(target), "-lm"])
