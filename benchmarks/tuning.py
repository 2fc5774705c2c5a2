"""`crosscheck tune` against a brute-force sweep: by how much dearer are the settings that it finds?

Of every family that reaches the error with `tune`, the sweep runs settings 10 % of work apart, from the
longest step or loosest tolerance on, up to the first that reaches the error.  Work is compared, not time:
the number of right-hand sides, otherwise of steps, so that other programs on the machine do not count.
Families that `tune` gave up are swept as far as they cost less CPU time than its answer.  No step is longer
than the interval between samples, at which steps end.

``--into FILE`` appends each row to a file of JSON lines and leaves out the combinations that are there, so
that an interrupted comparison goes on; ``--page FILE`` prints the tables of such a file for docs/compare.md.
"""

from __future__ import annotations

import one_thread  # noqa: F401 - before NumPy

# isort: split
import argparse
import itertools
import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from crosscheck.cli.planning import Choice, plan
from crosscheck.conformance.mechanisms.random_mechanisms import random_mechanism
from crosscheck.engine import Setting, engine, installed
from crosscheck.study.grid import Case, Record, run_here
from crosscheck.study.record_view import error, is_completed
from crosscheck.study.search.cheapest import tuned
from crosscheck.study.search.neighbours import LOOSEST, STEP, longest_step, work
from crosscheck.study.search.selection import families
from crosscheck.study.words.speed import COMPILED
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
ENGINES = ("mujoco", "pinocchio", "exudyn", "simbody", "mbref")
LEVELS = (1e-3, 1e-6)
SAMPLES = 31
FINER = 1.1  # ratio of neighbouring steps
LOOSER = 10 ** (1 / 3)  # of neighbouring tolerances, whose work is about 1.1 apart at order 8
LIMIT = 5.0  # CPU s of a run; the runs are in this process and not ended


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
    factor, start = (FINER, longest_step(family[0].times)) if name == STEP else (LOOSER, LOOSEST)
    count = math.ceil(math.log(start / last.options[name]) / math.log(factor))
    for k in range(count + 1):
        value = float(f"{start / factor**k:.3g}")
        options = {**first.options, name: value}
        for other in (n for n in varied if n != name):  # such as stiffness, which goes with the step
            options[other] = first.options[other] * first.options[name] / value
        yield family[0]._replace(setting=Setting(first.family, options))


def cheapest(family: Sequence[Case], level: float, limit: float, most: float) -> tuple[Record | None, int]:
    """The coarsest run of a family within the level, and the number of runs; None where each costs more than
    ``limit`` (CPU s) or ``most`` work."""
    count = 0
    for case in swept(family):
        record, count = run_here(case), count + 1
        if is_completed(record) and error(record) <= level:
            return record, count
        if record["cost"]["seconds"] > limit or work(record) > most:
            break
    return None, count


def compared(scene: Scene, name: str, level: float, compiled: bool) -> list[Row]:
    """A row for each family of an engine that is compiled first, or for each other family, in the order of
    its grid."""
    times = [np.linspace(0.0, scene.duration, SAMPLES)]
    cases = plan([scene], [name], Choice(is_quick=False), times, LIMIT, lambda _: None)
    cases = [case for case in cases if case.setting.family.endswith(COMPILED) == compiled]
    found = tuned(cases, level, lambda some: [run_here(c) for c in some], engine(name).integrated_here)
    reached = {record["family"]: record for record in found.reached}
    limit = min((record["cost"]["seconds"] for record in found.reached), default=LIMIT)
    rows = []
    for family in families(cases):
        label = family[0].setting.family
        count = sum(record["family"] == label for record in found.records)
        here = reached.get(label)
        least, runs = cheapest(family, level, LIMIT if here else limit, work(here) if here else math.inf)
        rows.append(Row(label, here, least, (count, runs)))
    return rows


def as_records(mechanism: str, name: str, level: float, rows: Sequence[Row]) -> list[dict[str, Any]]:
    """A JSON object for each row: ratio is the work of tune over the least work found (None where tune gave
    up); a family is missed where tune gave up, and the sweep found a run of less CPU time than all answers
    of tune."""
    whose = engine(name).integrated_here
    least = min((_seconds(row.tune) for row in rows if row.tune), default=math.inf)
    return [
        {
            "mechanism": mechanism,
            "engine": name,
            "error": level,
            "family": row.family,
            "integrated by": "crosscheck" if row.family in whose else name,
            "tune": _said(row.tune),
            "sweep": _said(row.sweep),
            "ratio": row.tune and work(row.tune) / min(work(r) for r in (row.tune, row.sweep) if r),
            "missed": row.tune is None and row.sweep is not None and _seconds(row.sweep) < least,
            "runs": row.runs,
        }
        for row in rows
    ]


def _seconds(record: Record) -> float:
    return float(record["cost"]["seconds"])


def _said(record: Record | None) -> str:
    if record is None:
        return "–"
    options = record["asked"]["options"]
    first = next((f"{k}={v:g}" for k, v in options.items()), "")
    return f"{first}, work {work(record):.6g}, {1e3 * record['cost']['seconds']:.3g} ms"


def table(records: Sequence[dict[str, Any]]) -> Iterator[str]:
    """The lines of a Markdown table for each error: the largest ratio of a mechanism in an engine, with the
    number of families that reach the error, and of families that only the sweep found."""
    engines = list(dict.fromkeys(r["engine"] for r in records))
    for level in sorted({r["error"] for r in records}, reverse=True):
        yield f"Error {level:g}:"
        yield ""
        yield "| " + " | ".join(("mechanism", *engines)) + " |"
        yield "|---" * (len(engines) + 1) + "|"
        for mechanism in MECHANISMS:
            some = [r for r in records if r["mechanism"] == mechanism and r["error"] == level]
            cells = [_cell([r for r in some if r["engine"] == name]) for name in engines]
            yield "| " + " | ".join((mechanism, *cells)) + " |"
        yield ""


def _cell(records: Sequence[dict[str, Any]]) -> str:
    ratios = [r["ratio"] for r in records if r["ratio"]]
    missed = sum(r["missed"] for r in records)
    if not ratios:
        return "–"
    return f"{max(ratios):.2f} ({len(ratios)})" + f", {missed} missed" * (missed > 0)


def _scene(name: str, end: float) -> Scene:
    if name.startswith("random_"):
        return random_mechanism(int(name.removeprefix("random_"))).with_(name=name, duration=end)
    return SCENES[name]().with_(duration=end)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--engine", action="append", help="default: the engines that are installed")
    parser.add_argument("--mechanism", action="append", choices=MECHANISMS, help="default: all ten")
    parser.add_argument("--error", action="append", type=float, help="default: 1e-3 and 1e-6")
    parser.add_argument(
        "--compiled", action="store_true", help="families that are compiled first, in their own column"
    )
    parser.add_argument("--into", type=Path, default=Path("build/tuning.jsonl"), metavar="FILE")
    parser.add_argument("--page", type=Path, metavar="FILE", help="print the tables, run nothing")
    given = parser.parse_args()
    if given.page:
        print("\n".join(table(_records(given.page))))
        return
    given.into.parent.mkdir(parents=True, exist_ok=True)
    done = {(r["mechanism"], r["engine"], r["error"]) for r in _records(given.into)}
    suffix = COMPILED if given.compiled else ""
    asked = itertools.product(given.error or LEVELS, given.mechanism or MECHANISMS, given.engine or ENGINES)
    for level, mechanism, name in asked:
        scene = _scene(mechanism, MECHANISMS[mechanism])
        if (mechanism, name + suffix, level) in done or not installed(name) or engine(name).cannot(scene):
            continue
        for record in as_records(mechanism, name, level, compared(scene, name, level, given.compiled)):
            line = json.dumps({**record, "engine": name + suffix}, ensure_ascii=False)
            print(line, flush=True)
            with given.into.open("a") as file:
                print(line, file=file)


def _records(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


if __name__ == "__main__":
    main()
