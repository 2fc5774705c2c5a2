"""Microseconds of one right-hand side, for every formulation on the paper's mechanisms, and of the engines.

    python benchmarks/evaluation.py [SCENE …]

Process CPU time, medians of REPEATS interleaved repeats of many evaluations; evaluations of mbref run in its
compiled loop, evaluations of engines are called from Python.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from forward_dynamics import timed_calls

from mbref.command_line import Parser
from mbref.formulations import FORMULATIONS
from mbref.kernels.compilation import INT, VECTOR, entry
from mbref.kernels.layout import MEMORY, OK
from mbref.method import Method
from mbref.scene import Scene
from mbref.scenes import SCENES
from mbref.simulation.runs import start_run
from mbref.stepping.limits import Limits
from mbref.stepping.run import Run

SCENE_NAMES = ("spatial_slider_crank", "planar_slider_crank", "four_bar", "five_bar")
CALLS, REPEATS = 2000, 15


@entry(INT(INT, VECTOR, VECTOR, MEMORY))
def repeat(calls, y, y_rate, memory):
    status = 0
    for _ in range(calls):
        status = memory.kernels.rates(0.0, y, y_rate, memory)
    return status


def main(names: Sequence[str]) -> None:
    """Measure and print."""
    calls = {
        (what, name): call
        for name in names
        for scene in [SCENES[name]()]
        for what, call in (*_formulations(scene), *timed_calls(scene))
    }
    seconds = {key: np.median(rounds) for key, rounds in _in_turns(calls).items()}
    print(f"{'µs per right-hand side':32}" + "".join(f"{name:>24}" for name in names))
    for what in dict.fromkeys(what for what, _ in calls):
        cells = [seconds.get((what, name), np.nan) for name in names]
        text = ("fails" if np.isnan(c) else f"{c * 1e6:.2f}" for c in cells)
        print(f"{what:32}" + "".join(f"{t:>24}" for t in text))


def _in_turns(calls: dict[tuple[str, str], Callable[[], float]]) -> dict[tuple[str, str], list[float]]:
    """Run REPEATS rounds of every call, after a warm-up round."""
    rounds: dict[tuple[str, str], list[float]] = {key: [] for key in calls}
    for call in calls.values():
        call()
    for _ in range(REPEATS):
        for key, call in calls.items():
            rounds[key].append(call())
    return rounds


def _formulations(scene: Scene) -> Iterator[tuple[str, Callable[[], float]]]:
    """Return the time of the accelerations by every formulation without stabilisation; NaN if a formulation
    fails."""
    for formulation in FORMULATIONS:
        run = start_run(scene, Method.parse(f"{formulation}+none"), np.array([1.0]), Limits())
        yield formulation, functools.partial(_timed, run)


def _timed(run: Run) -> float:
    """Return the seconds of one evaluation; NaN if the evaluation fails."""
    loop = run.memory.loop
    y, y_rate = loop.y[: loop.clock.y_size], loop.y_rate[: loop.clock.y_size]
    began = time.process_time()
    status = repeat(CALLS, y, y_rate, run.packed.argument)
    return (time.process_time() - began) / CALLS if status == OK else np.nan


if __name__ == "__main__":
    parser = Parser(description=__doc__)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="default: the scenes of the paper")
    main(parser.parse_args().scenes or SCENE_NAMES)
