"""`crosscheck tune` against a brute-force sweep: by how much dearer are the settings that it finds?

Of every family the sweep runs settings 10 % of work apart, from the coarsest up to those dearer than the
cheapest that was found.  Both cheapest settings are then timed in turns.
"""

from __future__ import annotations

import one_thread  # noqa: F401 - before NumPy

# isort: split
import argparse
import math
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from crosscheck.cli import request
from crosscheck.cli.request import Choice
from crosscheck.conformance.random_mechanisms import random_mechanism
from crosscheck.engine import Setting, engine
from crosscheck.processes.pool import end_idle
from crosscheck.study.between import LOOSEST, STEP
from crosscheck.study.grid import Case, Record, study
from crosscheck.study.ladder import families
from crosscheck.study.record_view import error, is_completed
from crosscheck.study.timings import with_timings
from crosscheck.study.tuning import tuned
from mbref.scene import Scene
from mbref.scenes import SCENES

MECHANISMS = {  # end times, s
    "planar_slider_crank_gravity": 0.3,
    "spatial_slider_crank_gravity": 0.2,
    "four_bar_gravity": 0.3,
    "five_bar_gravity": 0.3,
    "point_pendulum": 2.0,
    "heavy_top": 0.5,
    "planar_slider_crank": 0.1,
    "four_bar": 0.05,
    "random_3": 0.5,
    "random_11": 0.5,
}
SAMPLES = 31
FINER = 1.1  # ratio of neighbouring steps
LOOSER = 10 ** (1 / 3)  # of neighbouring tolerances, whose work is about 1.1 apart at order 8
WORTHWHILE = 1.0  # of the cheapest time: a setting that took longer ends the sweep of its family
LIMIT = 20.0  # s of a run


def swept(family: Sequence[Case]) -> Iterator[Case]:
    """The family's settings from the coarsest to the finest of its grid, 10 % of work apart."""
    first, last = family[0].setting, family[-1].setting
    varied = [n for n in first.options if first.options[n] != last.options[n]]
    if not varied:
        yield from family
        return
    name = STEP if STEP in varied else varied[0]
    factor, start = (FINER, family[0].scene.duration) if name == STEP else (LOOSER, LOOSEST)
    count = math.ceil(math.log(start / last.options[name]) / math.log(factor))
    for k in range(count + 1):
        value = float(f"{start / factor**k:.3g}")
        options = {**first.options, name: value}
        for other in (n for n in varied if n != name):  # such as stiffness, which goes with the step
            options[other] = first.options[other] * first.options[name] / value
        yield family[0]._replace(setting=Setting(first.family, options))


def cheapest_by_sweep(
    groups: Sequence[Sequence[Case]], level: float, threads: ThreadPoolExecutor, limit: float
) -> tuple[list[tuple[Case, Record]], int]:
    """The cheapest run within the level of each family that has one dearer than ``limit`` (s) at most, and
    the number of runs."""
    found, count = [], 0
    for group in groups:
        for case in swept(group):
            [record] = study([case], threads)
            count += 1
            if is_completed(record) and error(record) <= level:
                found.append((case, record))
                break
            if record["outcome"] == "TIMED_OUT" or record["cost"]["seconds"] > WORTHWHILE * limit:
                break
    return found, count


def compared(scene: Scene, name: str, level: float) -> Iterator[str]:
    """A line for the settings of the engine itself, and one for those that crosscheck integrates."""
    times = [np.linspace(0.0, scene.duration, SAMPLES)]
    cases = request.plan([scene], [name], Choice(is_quick=False), times, LIMIT, lambda _: None)
    ours = engine(name).integrated_here
    with ThreadPoolExecutor(1) as threads:
        found = tuned(cases, level, lambda some: study(some, threads), ours)
        for is_ours in (False, True):
            pairs = [
                (case, record)
                for case, record in zip(found.cases, found.reached, strict=True)
                if (case.setting.family in ours) is is_ours
            ]
            if not pairs:
                continue
            groups = [g for g in families(cases) if (g[0].setting.family in ours) is is_ours]
            limit = pairs[0][1]["cost"]["seconds"]
            swept_pairs, runs = cheapest_by_sweep(groups, level, threads, limit)
            both = [*pairs, *swept_pairs]
            timed = with_timings([c for c, _ in both], [r for _, r in both], None, lambda _: None)
            yield _line(
                scene, name, is_ours, timed[: len(pairs)], timed[len(pairs) :], (len(found.records), runs)
            )
    end_idle()


def _line(
    scene: Scene,
    name: str,
    is_ours: bool,
    tune: Sequence[Record],
    sweep: Sequence[Record],
    runs: tuple[int, int],
) -> str:
    best = min(tune, key=lambda r: r["cost"]["seconds"])
    rival = min([*sweep, best], key=lambda r: r["cost"]["seconds"])
    ratio = best["cost"]["seconds"] / rival["cost"]["seconds"]
    whose = "crosscheck" if is_ours else "itself"
    return (
        f"{scene.name:30s} {name:10s} {whose:10s} {_said(best):42s} {_said(rival):42s} {ratio:5.2f}"
        f" {runs[0]:4d} {runs[1]:5d}"
    )


def _said(record: Record) -> str:
    options = record["asked"]["options"]
    first = next((f"{k}={v:g}" for k, v in options.items()), "")
    return f"{record['family']} {first} {1e3 * record['cost']['seconds']:.3g} ms"


def _scene(name: str, end: float) -> Scene:
    if name.startswith("random_"):
        return random_mechanism(int(name.removeprefix("random_"))).with_(name=name, duration=end)
    return SCENES[name]().with_(duration=end)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--engine", action="append", help="default: mujoco, pinocchio, exudyn, mbref")
    parser.add_argument("--mechanism", action="append", choices=MECHANISMS, help="default: all ten")
    parser.add_argument("--error", type=float, default=1e-3)
    given = parser.parse_args()
    print("error", given.error)
    print(
        f"{'mechanism':30s} {'engine':10s} {'integrated':10s} {'tune':42s} {'sweep':42s} ratio runs of each"
    )
    for mechanism in given.mechanism or MECHANISMS:
        scene = _scene(mechanism, MECHANISMS[mechanism])
        for name in given.engine or ("mujoco", "pinocchio", "exudyn", "mbref"):
            if engine(name).cannot(scene):
                continue
            for line in compared(scene, name, given.error):
                print(line, flush=True)


if __name__ == "__main__":
    sys.exit(main())
