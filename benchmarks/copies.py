"""Rotated, translated and mirrored copies of every built-in scene beside the original, engine by engine.

``python benchmarks/copies.py [--records FILE] [--engine NAME …] [SCENE …]``: each engine runs the copies at
its setting of least error (as `floors.py` finds it, resuming from FILE); the table has the largest difference
from the original's motion moved likewise.  Its status is 1 where one exceeds twice the floor asked for.
"""

import argparse
import sys

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from crosscheck.conformance.relations import RELATIONS
from crosscheck.engine import Setting
from crosscheck.floors import TIME_LIMIT, Floor, candidates, floors
from crosscheck.isolate import run_isolated
from crosscheck.metrics import error_series, in_scene_order
from crosscheck.progress import shown
from crosscheck.study import study
from crosscheck.tolerances import FLOOR
from mbref.scene import Scene
from mbref.scenes import SCENES
from mbref.trajectory import Outcome, Trajectory

ENGINES = ("mujoco", "pinocchio", "exudyn")
COPIES = ("rotated", "translated", "mirrored")


def main() -> int:
    """Run and print; returns 1 where a copy moves otherwise."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", nargs="*", default=list(SCENES), metavar="SCENE")
    parser.add_argument("--engine", action="append", metavar="NAME")
    parser.add_argument("--records", metavar="FILE")
    arguments = parser.parse_args()
    scenes = {name: SCENES[name]() for name in arguments.scene}
    cases = [c for scene in scenes.values() for c in candidates(scene, arguments.engine or ENGINES)]
    with shown("finding the floors", len(cases)) as progress:
        found = floors(study(cases, records_path=arguments.records, progress=progress))
    console = Console(width=None if sys.stdout.isatty() else 160)
    table = Table("scene", "engine", "family", "error", *COPIES, title="difference of copies")
    worst = 0.0
    for floor in track(found, "running the copies", console=Console(stderr=True), transient=True):
        apart = [difference(scenes[floor.scene], floor, name) for name in COPIES]
        worst = max(worst, *apart)
        error = f"{floor.best['metrics']['error']:.1e}"
        table.add_row(floor.scene, floor.engine, floor.best["family"], error, *(f"{x:.1e}" for x in apart))
    console.print(table)
    return 0 if worst <= 2 * FLOOR else 1


def difference(scene: Scene, floor: Floor, name: str) -> float:
    """Largest difference of the copy's motion from the original's moved likewise; inf if it fails."""
    relation, original = RELATIONS[name], Trajectory.from_record(scene.name, floor.best)
    copy = relation.change(scene)
    setting = Setting(floor.best["family"], floor.best["settings"])
    run = run_isolated(floor.engine, copy, original.times, setting, TIME_LIMIT)
    if run.outcome is not Outcome.COMPLETED or original.outcome is not Outcome.COMPLETED:
        return np.inf
    expected = in_scene_order(copy, relation.expect(original))
    return float(error_series(copy, run, expected).max())


if __name__ == "__main__":
    sys.exit(main())
