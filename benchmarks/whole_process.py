"""A whole process: stepping, construction and start-up, and the simulated time after which mbref pays.

    python benchmarks/speed.py SCENE … --out FILE.json && python benchmarks/whole_process.py FILE.json

Of every scene in the file: the best setting at an error of 1e-6 of mbref by its series and
by its other methods, and of every other engine by its own integrator and by crosscheck's.  Each runs the
scene in fresh processes with warm caches, PROCESSES times, medians of process CPU time.  Stepping and
construction are those of a second run; start-up is the rest of the first: interpreter, imports, loading of
code.  An engine's are those of crosscheck's adapter; a program written for one mechanism needs less.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from rich.console import Console
from rich.table import Table
from speed import OURS, OURSELVES, SAMPLES, _integrator

PROCESSES = 5
LEVEL = 1  # of ERROR_LEVELS: 1e-6
CODE = """
import one_thread, json, sys, time
import numpy as np
from crosscheck.engine import Setting, engine
from mbref.scenes import SCENES
scene, name, family, options, samples = json.loads(sys.argv[1])
scene, simulator = SCENES[scene](), engine(name)
arguments = scene, np.linspace(0.0, scene.duration, samples), Setting(family, options)
simulator.prepare([family])
simulator.run(*arguments)
whole, again = time.process_time(), simulator.run(*arguments).cost
print(json.dumps([again.seconds, again.build_seconds, whole]))
"""
Parts = tuple[float, float, float]  # s: stepping, construction, start-up


class Candidate(NamedTuple):
    """A setting with its cost of a simulated second (s)."""

    engine: str
    family: str
    kind: str  # of ours or of integrators
    options: dict[str, Any]
    cost: float


def candidates(stored: dict[str, Any]) -> list[Candidate]:
    """The cheapest setting at the level of every engine and kind."""
    level, best = stored["levels"][LEVEL], {}
    for curve in stored["curves"]:
        name, family, cost = curve["engine"], curve["family"], curve["cost"][LEVEL]
        runs = [
            r for r in stored["runs"] if (r["engine"], r["family"]) == (name, family) and _reaches(r, level)
        ]
        kind = _kind(name, family)
        if cost is None or not runs or ((name, kind) in best and best[name, kind].cost <= cost):
            continue
        options = min(runs, key=_seconds)["options"]
        best[name, kind] = Candidate(name, family, kind, options, cost)
    return [c for c in best.values() if c.engine in (OURS, "mujoco", "pinocchio", "exudyn")]


def _kind(name: str, family: str) -> str:
    if name == OURS:
        return next(whose for whose, belongs in OURSELVES.items() if belongs(family))
    return _integrator(name, family)


def _reaches(run: dict[str, Any], level: float) -> bool:
    return run["error"] is not None and run["outcome"] == "COMPLETED" and run["error"] <= level


def _seconds(run: dict[str, Any]) -> float:
    return median(run["seconds"]) if run["seconds"] else float(run["cost"]["seconds"])


def parts(scene: str, candidate: Candidate) -> Parts:
    """Medians over fresh processes, the first of which warms caches and does not count."""
    arguments = json.dumps([scene, candidate.engine, candidate.family, candidate.options, SAMPLES])
    command, here = [sys.executable, "-c", CODE, arguments], Path(__file__).parent
    found = []
    for _ in range(PROCESSES + 1):
        said = subprocess.run(command, cwd=here, capture_output=True, text=True, check=True).stdout
        stepping, built, whole = json.loads(said.splitlines()[-1])
        found.append((stepping, built, whole - stepping - built))
    return tuple(map(median, zip(*found[1:], strict=True)))


def even(ours: Parts, our_cost: float, theirs: Parts, their_cost: float, first: int) -> str:
    """The simulated seconds after which ours is cheaper: ahead by construction (1) alone, or by start-up too
    (``first`` is the last part that counts)."""
    ahead = sum(ours[1 : first + 1]) - sum(theirs[1 : first + 1])
    if their_cost <= our_cost:
        return "never" if ahead >= 0 else f"until {-ahead / (our_cost - their_cost):.3g}"
    return f"{max(0.0, ahead) / (their_cost - our_cost):.3g}"


def show(console: Console, scene: str, stored: dict[str, Any]) -> None:
    """A scene's table; break-even of mbref's cheapest kind."""
    rows = [(c, parts(scene, c)) for c in candidates(stored)]
    table = Table(title=f"{scene}, {stored['duration']:g} s at an error of 1e-6: CPU ms of a process")
    for heading in ("engine", "family"):
        table.add_column(heading, no_wrap=True)
    for heading in (
        "stepping, a simulated second",
        "construction",
        "start-up",
        "whole process",
        "mbref pays after simulated s, warm",
        "from start",
    ):
        table.add_column(heading, justify="right")
    ours, our_parts = min(
        (row for row in rows if row[0].engine == OURS), key=lambda row: row[0].cost, default=(None, None)
    )
    for c, p in sorted(rows, key=lambda row: row[0].cost):
        cells = [c.cost, p[1], p[2], sum(p)]
        breaks = ["–", "–"]
        if ours is not None and our_parts is not None and c.engine != OURS:
            breaks = [even(our_parts, ours.cost, p, c.cost, last) for last in (1, 2)]
        table.add_row(c.engine, c.family, *(f"{1e3 * x:.3g}" for x in cells if not math.isnan(x)), *breaks)
    console.print(table)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("file", type=Path, help="JSON of benchmarks/speed.py --out")
    console = Console(width=None if sys.stdout.isatty() else 180)
    for scene, stored in json.loads(parser.parse_args().file.read_text())["scenes"].items():
        show(console, scene, stored)


if __name__ == "__main__":
    main()
