"""The page on orders of convergence, from stored records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from crosscheck.closed_loops.records import REFUSED
from crosscheck.convergence.ladders import (
    MECHANISMS,
    ROWS,
    SLOW,
    TIME_LIMIT,
    VAIN,
    Row,
    fineness,
    in_vain,
    point,
)
from crosscheck.judge.metrics import order_of_convergence
from crosscheck.study.grid import Record
from crosscheck.study.record_view import error, error_bound, is_completed

NEAR = 3.0  # errors up to this multiple of a floor are partly the floor
HEAD = f"""# Orders of convergence

This page shows how fast the errors of an engine decrease with its time step, and where they stop. Use it to
choose a step. Every run is made again at half of its step, or at a tenth of its tolerance, until the error no
longer decreases or a run takes more than {TIME_LIMIT:g} s of CPU time; {SLOW:g} s in Newton's rows with DVI
and the defaults, whose steps take about 0.1 s.

```sh
crosscheck convergence                        # print the table; nothing is simulated
crosscheck convergence --run --engine drake   # make the runs of an installed engine that the records lack
crosscheck convergence --force --page docs/convergence.md
```

Each cell has the least error of all runs and the measured order. The error is the largest of any body at any
sample, relative to the mechanism's length or in rad, against a closed form or the [reference
solution](reference.md). The order is the slope of log error over log step, in the longest range of at least
three steps in which it is nearly constant (`order_of_convergence` in `crosscheck/judge/metrics.py`). Where
the engine chooses its steps, the mean step counts. Order 1 means that half the step halves the error; order
4, that it divides the error by 16.

- `3e-12 (4.0)`: the least error is a floor: finer steps do not lower it. The order is 4.0 in a range of steps
  whose errors are more than {NEAR:g} times the floor.
- `3e-04 ↓ (1.0)`: the finest step within the limit has the least error; finer steps would lower it.
- `<1e-12`: less than the bound on the truth's error.
- Without a number in parentheses, no range of steps has a constant order.
- `!`: no run completes; the outcomes are below.
- `–`: the mechanism is refused; the reason is below, and whether the adapter, the engine or the engine's
  model lacks the feature.
"""


Table = Mapping[Row, Mapping[str, Sequence[Record]]]


def table(records: Sequence[Record]) -> Table:
    """Return the records of each measured row by heading of the mechanism, coarse to fine."""
    measured = {(r["engine"], r["family"]) for r in records}
    return {row: _by_mechanism(row, records) for row in ROWS if (row.engine, row.family) in measured}


def page(records: Sequence[Record]) -> str:
    """Return the page in Markdown."""
    versions = {r["engine"]: r["version"] for r in records}
    rows = table(records)
    parts = [HEAD, "| engine, family | " + " | ".join(m.heading for m in MECHANISMS) + " |"]
    parts += ["| --- |" + " :-: |" * len(MECHANISMS)]
    for row, found in rows.items():
        parts.append(f"| [{row.name}](#{_anchor(row)}) | " + " | ".join(map(cell, found.values())) + " |")
    parts += ["", *(f"- **{m.heading}** (`{m.place()}`, to {m.end:g} s): {m.about}" for m in MECHANISMS)]
    parts += ["", "## The runs", "", "Each line has steps (s) or tolerances with their errors.", ""]
    for row, found in rows.items():
        parts += [f'<a id="{_anchor(row)}"></a>**{row.name}** {versions[row.engine]}: {row.method}.', ""]
        parts += [f"- {name}: {_runs(of_row)}" for name, of_row in found.items()]
        parts += [""]
    return "\n".join(parts).rstrip() + "\n"


def _by_mechanism(row: Row, records: Sequence[Record]) -> Mapping[str, Sequence[Record]]:
    own = [r for r in records if (r["engine"], r["family"]) == (row.engine, row.family)]
    return {
        m.heading: sorted((r for r in own if r["scene"] == m.scene), key=fineness, reverse=True)
        for m in MECHANISMS
    }


def _anchor(row: Row) -> str:
    return "".join(c if c.isalnum() else "-" for c in row.name)


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


def _runs(records: Sequence[Record]) -> str:
    if not records:
        return "not measured"
    if records[0]["outcome"] == REFUSED:
        return f"refused: {records[0]['message']} ({records[0]['owner']})"
    return "; ".join(map(point, records))
