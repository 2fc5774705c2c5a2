"""Microseconds of one right-hand side, for every formulation on the paper's mechanisms.

    python benchmarks/evaluation.py

Process CPU time, the least of REPEATS interleaved repeats of CALLS evaluations in the compiled loop.
"""

from __future__ import annotations

import time

import numpy as np

from mbref.compiled import INT, VECTOR, entry, pointer_to
from mbref.formulations import FORMULATIONS
from mbref.method import Method
from mbref.scenes import SCENES
from mbref.simulate import Limits, _Run
from mbref.tables import ACCELERATE, OK, PROBLEM, RATES, SIZES

SCENE_NAMES = ("spatial_slider_crank", "planar_slider_crank", "four_bar", "five_bar")
CALLS, REPEATS = 2000, 15


@entry(INT(pointer_to(RATES), pointer_to(ACCELERATE), INT, VECTOR, VECTOR, PROBLEM))
def repeat(rates, accelerate, calls, y, y_rate, problem):
    status = 0
    for _ in range(calls):
        status = rates(accelerate, 0.0, y, y_rate, problem)
    return status


def main() -> None:
    print(f"{'µs per right-hand side':24}" + "".join(f"{name:>24}" for name in SCENE_NAMES))
    runs = {(f, s): _prepared(f, s) for s in SCENE_NAMES for f in FORMULATIONS}
    least = {key: np.inf for key in runs}
    for _ in range(REPEATS):
        for key, call in runs.items():
            least[key] = min(least[key], _seconds(call))
    for f in FORMULATIONS:
        cells = [least[f, s] for s in SCENE_NAMES]
        text = ("fails" if np.isinf(c) else f"{c * 1e6 / CALLS:.2f}" for c in cells)
        print(f"{f:24}" + "".join(f"{t:>24}" for t in text))


def _prepared(formulation: str, scene: str):
    run = _Run(SCENES[scene](), Method.parse(f"{formulation}+none"), np.array([1.0]), Limits())
    rates, accelerate = run.method.stabilisation.rates.pointer, run.method.formulation.accelerate.pointer
    y, y_rate = run.y[: run.pivots[SIZES, 1]], run.y_rate[: run.pivots[SIZES, 1]]
    return lambda: repeat(rates, accelerate, CALLS, y, y_rate, run.problem)


def _seconds(call) -> float:
    began = time.process_time()
    status = call()
    return time.process_time() - began if status == OK else np.nan


if __name__ == "__main__":
    main()
