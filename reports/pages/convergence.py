"""The page on orders of convergence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from crosscheck.convergence import every_scene
from crosscheck.convergence.ladders import FILE, MECHANISMS, SLOW, TIME_LIMIT, Row
from crosscheck.convergence.orders import NEAR, cell, listed, table
from crosscheck.study.grid import Record
from crosscheck.study.store import read_runs

from ..blocks import Fold, Parts, Table, Within, anchor, listing


def parts(records: Path = FILE) -> Parts:
    """Return the parts of the page from the records in a file."""
    runs = read_runs(records)
    found, versions = table(runs), {r["engine"]: r["version"] for r in runs}
    header = ("engine, family", *(m.heading for m in MECHANISMS))
    rows = [(Within(row.name, f"#{anchor(row.name)}"), *map(cell, of.values())) for row, of in found.items()]
    columns = (f"**{m.heading}** (`{m.place()}`, to {m.end:g} s): {m.about}" for m in MECHANISMS)
    return {
        "table": [Table("Least errors, and orders in parentheses.", header, rows)],
        "mechanisms": listing(columns),
        "runs": [_runs(row, versions[row.engine], of_row) for row, of_row in found.items()],
        "every_scene": [_of_scenes()],
        "longest": f"{every_scene.LONGEST:g}",
        "short": f"{every_scene.TIME_LIMIT:g}",
        "time_limit": f"{TIME_LIMIT:g}",
        "slow": f"{SLOW:g}",
        "near": f"{NEAR:g}",
    }


def _of_scenes() -> Fold:
    found = every_scene.table(read_runs(every_scene.FILE))
    header = ("scene", *(row.name for row in every_scene.ROWS))
    rows = [(f"`{name}`", *map(every_scene.cell, of.values())) for name, of in found.items()]
    table = Table("Least errors, orders in parentheses, and CPU time.", header, rows)
    return Fold("Families on every scene", "every-scene", [table])


def _runs(row: Row, version: str, runs: Mapping[str, Sequence[Record]]) -> Fold:
    lines = listing(f"{name}: {listed(of_mechanism)}" for name, of_mechanism in runs.items())
    return Fold(f"{row.name} {version}: {row.method}", anchor(row.name), lines)
