"""Newer and older families of MuJoCo and Pinocchio on every built-in scene: errors, orders and cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from crosscheck.closed_loops.mechanisms import Difficulty
from crosscheck.convergence import ladders, orders
from crosscheck.convergence.ladders import Row
from crosscheck.study.grid import Record
from crosscheck.study.record_view import error, is_completed
from mbref.scenes import SCENES

FILE = Path(__file__).parent / "every_scene.jsonl.xz"
TIME_LIMIT = 0.5  # s of CPU time of a run, so that all runs take a quarter of an hour
LONGEST = 0.5  # s of a motion
FAMILIES = {
    "mujoco": ("stock", "euler", "discrete"),
    "pinocchio": ("baumgarte", "lcaba", "admm", "pgs"),
}
ROWS = tuple(
    row._replace(time_limit=TIME_LIMIT) for row in ladders.ROWS if row.family in FAMILIES.get(row.engine, ())
)


def mechanisms() -> list[Difficulty]:
    """Return the built-in scenes, each with an end time of at most LONGEST."""
    return [Difficulty(name, "", name, min(make().duration, LONGEST)) for name, make in SCENES.items()]


def table(records: Sequence[Record]) -> Mapping[str, Mapping[Row, Sequence[Record]]]:
    """Return the records of each scene by family, coarse to fine."""
    found = orders.table(records, ROWS, mechanisms())
    return {name: {row: of[name] for row, of in found.items()} for name in SCENES}


def cell(records: Sequence[Record]) -> str:
    """Return the least error with its order, and the CPU time of that run."""
    done = [record for record in records if is_completed(record)]
    seconds = f", {min(done, key=error)['cost']['seconds']:.2g} s" if done else ""
    return orders.cell(records) + seconds
