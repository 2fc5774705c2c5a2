"""Simulations per second of an ensemble on one process and on every core, and the parts of a simulation.

    python benchmarks/ensemble.py [COUNT]

The first table is of CPU time of simulations one after another in this process: construction of a run,
stepping, and the rest, which is samples and the trajectory; the least of REPEATS rounds, in which scenes take
turns.  The second number is the time of these simulations in one batch, as an ensemble gives them to a
process.  The third number is the wall time of whole ensembles after the processes have started, including the
transfer of scenes and trajectories between processes; it is a median over rounds.
"""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from contextlib import ExitStack
from statistics import median

import numpy as np

from mbref.command_line import Parser
from mbref.ensembles.ensemble import MOST_AT_ONCE, ensemble
from mbref.ensembles.processes import processes
from mbref.ensembles.simulate_all import run_all
from mbref.method import SERIES_METHOD
from mbref.scene import Scene
from mbref.scene.variation import Variation, variants
from mbref.scenes import SCENES
from mbref.simulation.simulate import Limits, simulate

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
    scenes = {name: list(variants(SCENES[name](), varied, count)) for name, varied in VARIED.items()}
    _show_parts(scenes)
    _show_together(scenes)
    workers = sorted({1, os.cpu_count() or 1})
    print(f"{'simulations of ' + f'{END:g} s per second':32}" + "".join(f"{n:>6} processes" for n in workers))
    for name, varied in scenes.items():
        with ExitStack() as stack:
            pools = {n: stack.enter_context(processes(n)) for n in workers}
            for pool in pools.values():
                _seconds(varied[:8], pool)
            rounds = [[_seconds(varied, pool) for pool in pools.values()] for _ in range(REPEATS)]
        rates = [count / median(seconds) for seconds in zip(*rounds, strict=True)]
        print(f"{name:32}" + "".join(f"{rate:>16.0f}" for rate in rates))


def _show_parts(scenes: Mapping[str, Sequence[Scene]]) -> None:
    """Milliseconds of a simulation alone in one process, by part."""
    rounds = [{name: _parts(each) for name, each in scenes.items()} for _ in range(REPEATS)]
    heads = ("construction", "stepping", "rest", "all", "a second")
    print(f"{'ms a simulation, alone':32}" + "".join(f"{head:>14}" for head in heads))
    for name, each in scenes.items():
        built, stepping, whole = (1e3 / len(each) * min(found[name][k] for found in rounds) for k in range(3))
        _show(name, (built, stepping, whole - built - stepping, whole), 1e3 / whole)


def _show_together(scenes: Mapping[str, Sequence[Scene]]) -> None:
    """Print milliseconds of a simulation in a batch: of everything, and of stepping alone."""
    rounds = [{name: _together(each) for name, each in scenes.items()} for _ in range(REPEATS)]
    heads = ("stepping", "all", "a second")
    print(f"{'ms a simulation, together':32}" + "".join(f"{head:>14}" for head in heads))
    for name, each in scenes.items():
        found = [1e3 / len(each) * min(numbers[name][k] for numbers in rounds) for k in range(2)]
        _show(name, found, 1e3 / found[-1])


def _show(name: str, milliseconds: Sequence[float], rate: float) -> None:
    print(f"{name:32}" + "".join(f"{part:>14.3f}" for part in milliseconds) + f"{rate:>14.0f}")


def _together(scenes: Sequence[Scene]) -> tuple[float, float]:
    """Seconds of CPU time of stepping, and of all."""
    began, stepping = time.process_time(), 0.0
    for first in range(0, len(scenes), MOST_AT_ONCE):
        given = scenes[first : first + MOST_AT_ONCE]
        runs = run_all(given, SERIES_METHOD, TIMES, LIMITS).motions(given)
        stepping += sum(run.cost.seconds for _, run in runs)
    return stepping, time.process_time() - began


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
    parser = Parser(description=__doc__)
    parser.add_argument(
        "count", nargs="?", type=int, default=200, help="variants of each scene; default: 200"
    )
    main(parser.parse_args().count)
