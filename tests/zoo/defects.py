"""Planted defects of one line in the example engine, one at a time, and the check that detects each."""

import tomllib
import types
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import OptimizeResult

from crosscheck.engine import Engine

SOURCE = Path(__file__).parents[2] / "examples" / "spatial_engine" / "spatial_engine.py"
WAYS = Path(__file__).with_name("ways.py")
SOLVED = "np.linalg.lstsq(flexible, missing, rcond=RANK)[0]"  # the example's linear solver
TABLE = Path(__file__).with_name("defects.toml")


class Defect(NamedTuple):
    """``old`` stands once in the engine's source and becomes ``new``; ``check`` fails on ``scene``. The
    source is that of the linear solvers if the engine ``has_ways`` to solve.
    """

    about: str
    old: str
    new: str
    scene: str
    check: str
    has_ways: bool = False


DEFECTS = {entry["about"]: Defect(**entry) for entry in tomllib.loads(TABLE.read_text())["defect"]}


def engine(defect: Defect | None = None, has_ways: bool = False) -> Engine:
    """The example engine, or the fake engine with alternatives, sound or with a defect; ValueError where the
    defect's line is not found once."""
    if not has_ways:
        return _executed(_changed(SOURCE.read_text(), defect), euler=euler).ENGINE
    ways = _executed(_changed(WAYS.read_text(), defect))
    solver = ways.Solver()
    source = SOURCE.read_text().replace(SOLVED, "solver(flexible, missing)")
    source = source.replace("UNMET = 1e-8", "UNMET = 1e9")  # it does not watch its residuals
    return ways.several_ways(_executed(source, solver=solver).Spatial, solver)


def _changed(source: str, defect: Defect | None = None) -> str:
    if defect is None:
        return source
    if source.count(defect.old) != 1:
        raise ValueError(f"{defect.about}: {defect.old!r} stands {source.count(defect.old)} times")
    return source.replace(defect.old, defect.new)


def _executed(source: str, **names: object) -> types.ModuleType:
    module = types.ModuleType("zoo")
    vars(module).update(names)
    exec(compile(source, str(SOURCE), "exec"), vars(module))
    return module


def euler(rates: Callable, start: np.ndarray, times: np.ndarray, steps: int = 200) -> OptimizeResult:
    """The replacement of `solve_ivp` by a defect: Euler's method with small steps between samples."""
    y, t, samples = start, 0.0, []
    for target in times:
        for _ in range(steps if target > t else 0):
            y = y + (target - t) / steps * rates(t, y)
        samples.append(y)
        t = target
    return OptimizeResult(
        t=times, y=np.array(samples).T, nfev=steps * len(times), success=True, status=0, message=""
    )
