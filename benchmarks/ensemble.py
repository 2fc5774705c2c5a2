"""Simulations per second of an ensemble on one process and on every core.

    python benchmarks/ensemble.py [COUNT]

Wall time of whole runs, drawing of variants, building, sampling and reactions included, after the processes
have started; each number of processes takes its turn REPEATS times.
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
from mbref.simulation.ensemble import ensemble, processes
from mbref.simulation.simulate import Limits
from mbref.variation import Variation, variants

REPEATS = 5
LIMITS = Limits(rtol=1e-6)
VARIED = {
    "planar_slider_crank": [Variation("joint[B].anchor[0]", 0.304, 1e-4, normal=True)],
    "spatial_slider_crank_driven": [Variation("joint[B].anchor[0]", 0.1, 1e-4, normal=True)],
    "five_bar": [Variation("body[bar].mass", 0.45, 0.55)],
}
END = 0.1  # s


def main(count: int) -> None:
    """Measure and print."""
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


def _seconds(scenes: Sequence[Scene], pool: Executor) -> float:
    began = time.perf_counter()
    outcomes = [
        run.outcome.name for _, run in ensemble(scenes, np.linspace(0, END, 6), limits=LIMITS, executor=pool)
    ]
    taken = time.perf_counter() - began
    assert set(outcomes) == {"COMPLETED"}, outcomes
    return taken


if __name__ == "__main__":
    main(int(sys.argv[1]) if sys.argv[1:] else 200)
