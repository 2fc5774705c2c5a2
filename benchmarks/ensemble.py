"""Simulations per second of an ensemble on one process and on every core, and the parts of a simulation.

    python benchmarks/ensemble.py [COUNT]

The first table is of CPU time of simulations one after another in this process: construction of a run,
stepping, and the rest, which is samples, reactions and the trajectory; the least of REPEATS rounds, in which
scenes take turns.  The second is of wall time of whole ensembles after the processes have started, with the
passing of scenes and trajectories between them; the median of as many rounds.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Sequence
from concurrent.futures import Executor
from contextlib import ExitStack
from statistics import median

import numpy as np

from mbref.scene import Scene
from mbref.scenes import SCENES
from mbref.simulation.ensemble import ensemble
from mbref.simulation.processes import processes
from mbref.simulation.simulate import Limits, simulate
from mbref.variation import Variation, variants

REPEATS = 5
LIMITS = Limits(rtol=1e-6)
VARIED = {
    "planar_slider_crank": [Variation("joint[B].anchor[0]", 0.304, 1e-4, normal=True)],
    "spatial_slider_crank_driven": [Variation("joint[B].anchor[0]", 0.1, 1e-4, normal=True)],
    "five_bar": [Variation("body[bar].mass", 0.45, 0.55)],
}
END = 0.1  # s
TIMES = np.linspace(0, END, 6)


def main(count: int) -> None:
    """Measure and print."""
    _show_parts(count)
    workers = sorted({1, os.cpu_count() or 1})
    print(f"{'simulations of ' + f'{END:g} s per second':32}" + "".join(f"{n:>6} processes" for n in workers))
    for name, varied in VARIED.items():
        scenes = list(variants(SCENES[name](), varied, count))
        with ExitStack() as stack:
            pools = {n: stack.enter_context(processes(n)) for n in workers}
            for pool in pools.values():
                _seconds(scenes[:8], pool)
            rounds = [[_seconds(scenes, pool) for pool in pools.values()] for _ in range(REPEATS)]
        rates = [count / median(seconds) for seconds in zip(*rounds, strict=True)]
        print(f"{name:32}" + "".join(f"{rate:>16.0f}" for rate in rates))


def _show_parts(count: int) -> None:
    """Milliseconds of a simulation in one process, by part."""
    scenes = {name: list(variants(SCENES[name](), varied, count)) for name, varied in VARIED.items()}
    rounds = [{name: _parts(each) for name, each in scenes.items()} for _ in range(REPEATS)]
    heads = ("construction", "stepping", "rest", "all", "a second")
    print(f"{'ms a simulation, one process':32}" + "".join(f"{head:>14}" for head in heads))
    for name in scenes:
        built, stepping, whole = (1e3 / count * min(found[name][k] for found in rounds) for k in range(3))
        parts = built, stepping, whole - built - stepping, whole
        print(f"{name:32}" + "".join(f"{part:>14.3f}" for part in parts) + f"{1e3 / whole:>14.0f}")


def _parts(scenes: Sequence[Scene]) -> tuple[float, float, float]:
    """Seconds of CPU time of construction, of stepping, and of all."""
    began = time.process_time()
    costs = [simulate(scene, times=TIMES, limits=LIMITS).cost for scene in scenes]
    whole = time.process_time() - began
    return sum(cost.build_seconds for cost in costs), sum(cost.seconds for cost in costs), whole


def _seconds(scenes: Sequence[Scene], pool: Executor) -> float:
    began = time.perf_counter()
    outcomes = [run.outcome.name for _, run in ensemble(scenes, TIMES, limits=LIMITS, executor=pool)]
    taken = time.perf_counter() - began
    assert set(outcomes) == {"COMPLETED"}, outcomes
    return taken


if __name__ == "__main__":
    main(int(sys.argv[1]) if sys.argv[1:] else 200)
