"""Planted defects of one line, applied one at a time to the example engine, with the check that detects
each."""

from __future__ import annotations

import tomllib
import types
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import OptimizeResult

from crosscheck.engine import Engine

SOURCE = Path(__file__).parents[2] / "examples" / "spatial_engine" / "spatial_engine.py"
TABLE = Path(__file__).with_name("defects.toml")


class Defect(NamedTuple):
    """``old`` stands once in the engine's source and becomes ``new``; ``check`` fails on ``scene``."""

    about: str
    old: str
    new: str
    scene: str
    check: str


DEFECTS = {entry["about"]: Defect(**entry) for entry in tomllib.loads(TABLE.read_text())["defect"]}


def engine(defect: Defect | None = None) -> Engine:
    """The example engine, sound or with a defect; ValueError where the defect's line is not found once."""
    source = SOURCE.read_text()
    if defect is not None:
        if source.count(defect.old) != 1:
            raise ValueError(f"{defect.about}: {defect.old!r} stands {source.count(defect.old)} times")
        source = source.replace(defect.old, defect.new)
    module = types.ModuleType("zoo")
    vars(module)["euler"] = euler
    exec(compile(source, str(SOURCE), "exec"), vars(module))
    return module.ENGINE


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
