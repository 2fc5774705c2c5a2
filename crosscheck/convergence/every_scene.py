"""Newer and older families of MuJoCo and Pinocchio on every built-in scene: errors, orders and cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median

from crosscheck.closed_loops.mechanisms import Difficulty
from crosscheck.convergence import ladders, orders
from crosscheck.convergence.ladders import Row
from crosscheck.study.grid import Record
from crosscheck.study.record_view import error, is_completed
from crosscheck.study.store import REFUSED
from mbref.scenes import SCENES

FILE = Path(__file__).parent / "every_scene.jsonl.xz"
SUMMARY = ("engine, family", "scenes completed", "within 1e-6", "median order", "median time of a step")
LEVEL = 1e-6  # lengths or rad
TIME_LIMIT = 0.5  # s of CPU time of a run, so that all runs take a quarter of an hour
LONGEST = 0.5  # s of a motion
FAMILIES = {
    "mujoco": ("stock", "euler", "implicit", "implicitfast", "discrete"),
    "pinocchio": ("baumgarte", "lcaba", "admm", "pgs", "impulses", "impulses, pgs", "compliant"),
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


def summary(records: Sequence[Record]) -> list[tuple[str, ...]]:
    """Return a line for each family, under SUMMARY."""
    lines: list[tuple[str, ...]] = []
    for row, of in orders.table(records, ROWS, mechanisms()).items():
        done = [[record for record in each if is_completed(record)] for each in of.values()]
        done = [each for each in done if each]
        slopes = [order for each in done if (order := orders.order(each)) is not None]
        steps = [
            r["cost"]["seconds"] / r["cost"]["steps"] for each in done for r in each if r["cost"]["steps"]
        ]
        asked = sum(bool(each) and each[0]["outcome"] != REFUSED for each in of.values())
        right = sum(min(map(error, each)) <= LEVEL for each in done)
        lines.append(
            (
                row.name,
                f"{len(done)} of {asked}",
                str(right),
                f"{median(slopes):.1f}" if slopes else "",
                f"{float(f'{1e6 * median(steps):.2g}'):g} µs",
            )
        )
    return lines


def cell(records: Sequence[Record]) -> str:
    """Return the least error with its order, and the CPU time of that run."""
    done = [record for record in records if is_completed(record)]
    seconds = f", {min(done, key=error)['cost']['seconds']:.2g} s" if done else ""
    return orders.cell(records) + seconds
