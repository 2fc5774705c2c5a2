"""`crosscheck tune` against a brute-force sweep: by how much dearer are the settings that it finds?

Of every family that reaches the error with `tune`, the sweep runs settings 10 % of work apart, from the
longest step or loosest tolerance on, up to the first that reaches the error.  Work is compared, not time:
the number of right-hand sides, otherwise of steps, so that other programs on the machine do not count.
Families that `tune` gave up are swept as far as they cost less CPU time than its answer.
"""

from __future__ import annotations

import one_thread  # noqa: F401 - before NumPy

# isort: split
import argparse
import math
import sys
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from crosscheck.cli import request
from crosscheck.cli.request import Choice
from crosscheck.conformance.random_mechanisms import random_mechanism
from crosscheck.engine import Setting, engine
from crosscheck.study.between import LOOSEST, STEP, work
from crosscheck.study.grid import Case, Record, run_here
from crosscheck.study.ladder import families
from crosscheck.study.record_view import error, is_completed
from crosscheck.study.speed_sentences import COMPILED
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
LIMIT = 20.0  # CPU s of a run; the runs are in this process and not ended


class Row(NamedTuple):
    """A family, the settings of `tune` and of the sweep (None where it gave up, or found none), and runs."""

    family: str
    tune: Record | None
    sweep: Record | None
    runs: tuple[int, int]


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


def cheapest(family: Sequence[Case], level: float, limit: float) -> tuple[Record | None, int]:
    """The coarsest run of a family within the level, and the number of runs; None where each costs more than
    ``limit`` (CPU s)."""
    count = 0
    for case in swept(family):
        record, count = run_here(case), count + 1
        if is_completed(record) and error(record) <= level:
            return record, count
        if record["cost"]["seconds"] > limit:
            break
    return None, count


def compared(scene: Scene, name: str, level: float, with_compiled: bool) -> list[Row]:
    """A row for each family of an engine, in the order of its grid."""
    times = [np.linspace(0.0, scene.duration, SAMPLES)]
    cases = request.plan([scene], [name], Choice(is_quick=False), times, LIMIT, lambda _: None)
    cases = [case for case in cases if with_compiled or not case.setting.family.endswith(COMPILED)]
    found = tuned(cases, level, lambda some: [run_here(c) for c in some], engine(name).integrated_here)
    reached = {record["family"]: record for record in found.reached}
    limit = min((record["cost"]["seconds"] for record in found.reached), default=LIMIT)
    rows = []
    for family in families(cases):
        label = family[0].setting.family
        count = sum(record["family"] == label for record in found.records)
        here = reached.get(label)
        least, runs = cheapest(family, level, LIMIT if here else limit)
        rows.append(Row(label, here, least, (count, runs)))
    return rows


def lines(scene: Scene, name: str, rows: Sequence[Row]) -> Iterator[str]:
    """A line for each row."""
    whose = {family: "crosscheck" for family in engine(name).integrated_here}
    for row in rows:
        ratio = "given up"
        if row.tune:
            ratio = f"{work(row.tune) / min(work(r) for r in (row.tune, row.sweep) if r):.2f}"
        yield (
            f"{scene.name:30s} {name:10s} {whose.get(row.family, 'itself'):10s} {row.family:20s} "
            f"{_said(row.tune):30s} {_said(row.sweep):30s} {ratio:>8s} {row.runs[0]:4d} {row.runs[1]:4d}"
        )


def _said(record: Record | None) -> str:
    if record is None:
        return "–"
    options = record["asked"]["options"]
    first = next((f"{k}={v:g}" for k, v in options.items()), "")
    return f"{first} {work(record):.6g} {1e3 * record['cost']['seconds']:.3g} ms"


def _scene(name: str, end: float) -> Scene:
    if name.startswith("random_"):
        return random_mechanism(int(name.removeprefix("random_"))).with_(name=name, duration=end)
    return SCENES[name]().with_(duration=end)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--engine", action="append", help="default: mujoco, pinocchio, exudyn, mbref")
    parser.add_argument("--mechanism", action="append", choices=MECHANISMS, help="default: all ten")
    parser.add_argument("--error", type=float, default=1e-3)
    parser.add_argument("--compiled", action="store_true", help="families that are compiled first, too")
    given = parser.parse_args()
    print(f"error {given.error:g}; of each setting its work and CPU time; work of tune / work of sweep; runs")
    for mechanism in given.mechanism or MECHANISMS:
        scene = _scene(mechanism, MECHANISMS[mechanism])
        for name in given.engine or ("mujoco", "pinocchio", "exudyn", "mbref"):
            if engine(name).cannot(scene):
                continue
            for line in lines(scene, name, compared(scene, name, given.error, given.compiled)):
                print(line, flush=True)


if __name__ == "__main__":
    sys.exit(main())
