"""Least errors and orders of convergence of engines, from stored records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from crosscheck.closed_loops.mechanisms import Difficulty
from crosscheck.convergence.ladders import MECHANISMS, ROWS, VAIN, Row, fineness, in_vain, point
from crosscheck.judge.metrics import order_of_convergence
from crosscheck.study.grid import Record
from crosscheck.study.record_view import error, error_bound, is_completed
from crosscheck.study.store import REFUSED

NEAR = 3.0  # errors up to this multiple of a floor are partly the floor

Table = Mapping[Row, Mapping[str, Sequence[Record]]]


def table(
    records: Sequence[Record], rows: Sequence[Row] = ROWS, mechanisms: Sequence[Difficulty] = MECHANISMS
) -> Table:
    """Return the records of each measured row by heading of the mechanism, coarse to fine."""
    measured = {(r["engine"], r["family"]) for r in records}
    asked = [row for row in rows if (row.engine, row.family) in measured]
    return {row: _by_mechanism(row, records, mechanisms) for row in asked}


def _by_mechanism(
    row: Row, records: Sequence[Record], mechanisms: Sequence[Difficulty]
) -> Mapping[str, Sequence[Record]]:
    own = [r for r in records if (r["engine"], r["family"]) == (row.engine, row.family)]
    return {
        m.heading: sorted((r for r in own if r["scene"] == m.scene), key=fineness, reverse=True)
        for m in mechanisms
    }


def cell(records: Sequence[Record]) -> str:
    """Return the least error of the runs, whether it is a floor, and the measured order."""
    if not records:
        return "○"
    if records[0]["outcome"] == REFUSED:
        return "–"
    done = [record for record in records if is_completed(record)]
    if not done:
        return "!"
    least = min(done, key=error)
    text = f"{error(least):.0e}" if error(least) >= error_bound(least) else f"<{error_bound(least):.0e}"
    falls = " ↓" if in_vain(records) < VAIN and error(least) > error_bound(least) else ""
    found = order(done)
    return text + falls + (f" ({found:.1f})" if found is not None else "")


def order(records: Sequence[Record]) -> float | None:
    """Return the measured order of completed runs, from errors above the bound on the truth's error and above
    the floor."""
    floor = NEAR * min(map(error, records)) if in_vain(records) >= VAIN else 0.0
    least: dict[float, float] = {}
    for record in records:
        if error(record) > max(error_bound(record), floor):
            least[step(record)] = min(error(record), least.get(step(record), error(record)))
    return order_of_convergence(list(least), list(least.values())) if len(least) > 2 else None


def step(record: Record) -> float:
    """Return the step of a run, or the mean step where the engine chose its steps, s."""
    own = record["asked"]["options"].get("step")
    return float(own or record["t_end"] / max(record["cost"]["steps"], 1))


def listed(records: Sequence[Record]) -> str:
    """Return steps or tolerances of runs with their errors, or the reason for no run."""
    if not records:
        return "not measured"
    if records[0]["outcome"] == REFUSED:
        return f"refused: {records[0]['message']} ({records[0]['owner']})"
    return "; ".join(map(point, records))
