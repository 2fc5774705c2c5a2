"""mbref ensemble: variants of a scene, simulated on all cores."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from mbref.cli.output import STATE, body_table, console, largest_numbers, progress_bar, rounded, warn
from mbref.cli.request import MOST_STATES, add_method_options, add_scene, limits_of, sample_times
from mbref.command_line import record_file, whole
from mbref.input_error import InputError
from mbref.motions.trajectory import Trajectory
from mbref.records import strict_json
from mbref.scene import Scene
from mbref.scenes import find_scene

MOST_VARIANTS, MOST_WORKERS = 1_000_000, 1000
MOST_SEED = 10**12


def add(commands: Any) -> None:
    """Add the command's parser."""
    many = commands.add_parser(
        "ensemble",
        action=_ensemble,
        help="simulate variants of a scene on every core",
        description="Simulate variants of a scene with random parameters. Print the mean and the standard\n"
        "deviation of every body at the last time. --out stores finished runs; after an\n"
        "interrupt, the repeated command runs only the missing ones.",
        epilog="example:\n"
        "  mbref ensemble planar_slider_crank --vary 'joint[B].anchor[0]=0.304+-1e-4' \\\n"
        "      --vary 'body[slider].mass=0.9:1.1' --count 500 --duration 0.1 --out runs.jsonl",
    )
    add_scene(many)
    many.add_argument(
        "--vary",
        action="append",
        required=True,
        metavar="PATH=LOW:HIGH",
        help="a parameter with a uniform distribution; PATH=MEAN+-DEVIATION: normal distribution; may repeat",
    )
    many.add_argument("--count", type=whole(1, MOST_VARIANTS), default=100, help="variants (default 100)")
    many.add_argument(
        "--seed", type=whole(0, MOST_SEED), default=0, help="seed of the random numbers (default 0)"
    )
    many.add_argument(
        "--workers", type=whole(1, MOST_WORKERS), help="number of processes (default: one for each core)"
    )
    many.add_argument(
        "--out", type=record_file, metavar="FILE", help="append every trajectory, one JSON line each"
    )
    add_method_options(many)


def _ensemble(options: argparse.Namespace) -> int:
    from mbref.ensembles.ensemble import ensemble
    from mbref.ensembles.processes import processes
    from mbref.scene.variation import Variation, variants

    scene = find_scene(options.scene)
    times, limits = sample_times(options, scene), limits_of(options)
    warn(scene)
    if options.count * len(times) * len(scene.body) > MOST_STATES:
        most = MOST_STATES // (len(times) * len(scene.body))
        raise InputError(
            f"--count: must be at most {most} for {len(times)} samples of {len(scene.body)} bodies, "
            f"got {options.count}"
        )
    varied = [Variation.parse(text) for text in options.vary]
    if any(variation.path == "duration" for variation in varied):
        raise InputError("--vary: duration changes no sample time; --duration or --times sets them for all")
    scenes = variants(scene, varied, options.count, options.seed)
    runs, began = {}, time.perf_counter()
    with processes(options.workers) as pool, progress_bar("simulating", options.count) as progress:
        for place, run in ensemble(scenes, times, options.method, limits, pool, options.out):
            runs[place] = run
            progress(len(runs))
    rate = len(runs) / (time.perf_counter() - began)
    completed = [run for _, run in sorted(runs.items()) if run.outcome.name == "COMPLETED"]
    _show_spread(scene, float(times[-1]), completed, rate, options)
    for sentence in _early_ends(runs):
        print(sentence, file=sys.stderr)
    return 0 if len(completed) == options.count else 1


def _show_spread(
    scene: Scene, end: float, completed: Sequence[Trajectory], rate: float, options: argparse.Namespace
) -> None:
    """Print mean and standard deviation of every body over the completed runs, at the last time.

    ``rate`` is the number of runs per second of wall time, including the start of the processes.
    """
    last = {key: np.array([getattr(run, key)[-1] for run in completed]) for key in STATE}
    if options.json:
        spread = {
            f"{what}_{key}": {body.name: a[b].tolist() for b, body in enumerate(scene.body)}
            for key, values in last.items()
            if completed
            for what, a in (("mean", values.mean(axis=0)), ("deviation", values.std(axis=0)))
        }
        print(strict_json({"scene": scene.name, "time": end, "completed": len(completed), **spread}))
        return
    seconds = sum(run.cost.seconds for run in completed)
    console().print(
        f"{scene.name}: {len(completed)} of {options.count} variants completed, "
        f"{seconds:.3g} s of stepping in all, {rate:.3g} runs a second"
    )
    if completed:
        console().print(_table(scene, end, last))


def _early_ends(runs: Mapping[int, Trajectory]) -> Iterator[str]:
    """Return for every outcome except COMPLETED the number of runs and the cause of the first run's end."""
    ends: dict[str, list[int]] = {}
    for place, run in sorted(runs.items()):
        if run.outcome.name != "COMPLETED":
            ends.setdefault(run.outcome.name, []).append(place)
    for outcome, places in ends.items():
        first = runs[places[0]]
        yield f"{outcome}: {len(places)}, the first of them variant {places[0]}: {first.message}"


def _table(scene: Scene, end: float, last: dict[str, np.ndarray]) -> Any:
    def cells(b: int, field: str) -> list[str]:
        mean, deviation = (rounded(field, f(last[field][:, b], axis=0), largest) for f in (np.mean, np.std))
        return [f"{m:.5g}\n± {d:.2g}" for m, d in zip(mean, deviation, strict=True)]

    names = [body.name for body in scene.body]
    largest = largest_numbers(last, end)
    return body_table(f"mean ± standard deviation at t = {end:g} s", names, cells)
