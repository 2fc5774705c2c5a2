"""Rotated, translated and mirrored copies of every built-in scene beside the original, engine by engine.

``python benchmarks/copies.py [--records FILE] [--engine NAME …] [SCENE …]``: each engine runs the copies at
its setting of least error (as `least_errors.py` finds it), resuming from FILE.  The table has the largest
difference from the original's motion, moved like the copy. A further column has the difference that rounding
causes: the scene's numbers are changed in their last digit.  The exit status is 1 if a copy differs by more
than twice the least difference that every engine may have, and by more than ten times the difference that
rounding causes.
"""

import sys
from functools import partial

import numpy as np
from least_errors import asked_for
from rich.console import Console
from rich.table import Table

from crosscheck.conformance.changes.relations import RELATIONS, Relation, shaken, unchanged
from crosscheck.engine import Setting
from crosscheck.judge.metrics import error_series, in_scene_order
from crosscheck.judge.tolerances import FLOOR
from crosscheck.study.grid import Case, Record, study
from crosscheck.study.progress import shown
from crosscheck.study.record_view import is_completed
from crosscheck.study.search.least_errors import LeastError
from crosscheck.study.search.selection import LEAST_ERROR_LIMIT
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

COPIES = {name: [RELATIONS[name]] for name in ("rotated", "translated", "mirrored")}
SHAKEN = {"shaken": [unchanged("off by rounding", partial(shaken, seed=seed)) for seed in range(3)]}
ROUNDING = 10  # times the difference of three shaken scenes: allowed to a copy that differs by rounding


def main() -> int:
    """Run the copies and print the table; return 1 if a copy moves in another way than the original."""
    scenes, found, path = asked_for(__doc__)
    columns = {**COPIES, **SHAKEN}
    places = [(least, name, relation) for least in found for name in columns for relation in columns[name]]
    cases = [case(scenes[least.scene], least, relation) for least, _, relation in places]
    with shown("running the copies", len(cases)) as progress:
        records = study(cases, records_path=path, progress=progress)
    apart: dict[tuple[str, str], dict[str, float]] = {}
    for (least, name, relation), record in zip(places, records, strict=True):
        row = apart.setdefault((least.scene, least.engine), dict.fromkeys(columns, 0.0))
        row[name] = max(row[name], difference(scenes[least.scene], least, relation, record))
    table = Table("scene", "engine", "family", "error", *columns, title="difference of copies")
    for least in found:
        row = apart[least.scene, least.engine]
        error = f"{least.best['metrics']['error']:.1e}"
        table.add_row(
            least.scene, least.engine, least.best["family"], error, *(f"{x:.1e}" for x in row.values())
        )
    Console(width=None if sys.stdout.isatty() else 160).print(table)
    return 0 if all(is_alike(row) for row in apart.values()) else 1


def case(scene: Scene, least: LeastError, relation: Relation) -> Case:
    """The run of the changed scene at the engine's setting of least error."""
    setting = Setting(least.best["family"], least.best["settings"])
    times = np.array(Trajectory.from_record(scene.name, least.best).times)
    return Case(copied(scene, least, relation), times, least.engine, setting, LEAST_ERROR_LIMIT)


def copied(scene: Scene, least: LeastError, relation: Relation) -> Scene:
    """Return the scene changed by the relation, which applies to every scene of this benchmark."""
    copy = relation.change(scene, Trajectory.from_record(scene.name, least.best))
    assert isinstance(copy, Scene), copy
    return copy


def difference(scene: Scene, least: LeastError, relation: Relation, record: Record) -> float:
    """Largest difference of the copy's motion from the original's moved likewise; inf if one fails."""
    if not (is_completed(least.best) and is_completed(record)):
        return np.inf
    copy = copied(scene, least, relation)
    expected = in_scene_order(copy, relation.expect(scene, Trajectory.from_record(scene.name, least.best)))
    return float(error_series(copy, Trajectory.from_record(scene.name, record), expected).max())


def is_alike(row: dict[str, float]) -> bool:
    """Return whether the copies differ by no more than an engine is allowed, or than rounding causes."""
    allowed = max(2 * FLOOR, ROUNDING * row["shaken"])
    return all(np.isfinite(row[name]) and row[name] <= allowed for name in COPIES)


if __name__ == "__main__":
    sys.exit(main())
