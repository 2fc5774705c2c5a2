"""The page on orders of convergence."""

from __future__ import annotations

from pathlib import Path

from crosscheck.convergence.ladders import FILE, MECHANISMS, SLOW, TIME_LIMIT
from crosscheck.convergence.orders import NEAR, cell, listed, table
from crosscheck.study.store import read_runs

from ..blocks import Block, Fold, Heading, Prose, Table, Within

TITLE = "Orders of convergence"
HEAD = f"""
This page shows how fast the errors of an engine decrease with its time step, and where they stop. Use it to
choose a step. Every run is made again at half of its step, or at a tenth of its tolerance, until the error no
longer decreases or a run takes more than {TIME_LIMIT:g} s of CPU time; {SLOW:g} s in Newton's rows with DVI
and the defaults, whose steps take about 0.1 s.

```sh
crosscheck convergence                        # print the table; nothing is simulated
crosscheck convergence --run --engine drake   # make the runs of an installed engine that the records lack
crosscheck convergence --force --page docs/results/convergence.md
```

Each cell has the least error of all runs and the measured order. The error is the largest of any body at any
sample, relative to the mechanism's length or in rad, against a closed form or the
[reference solution](../reference.md). The order is the slope of log error over log step, in the longest range
of at least three steps in which it is nearly constant (`order_of_convergence` in
`crosscheck/judge/metrics.py`). Where the engine chooses its steps, the mean step counts. Order 1 means that
half the step halves the error; order 4, that it divides the error by 16.

- `3e-12 (4.0)`: the least error is a floor: finer steps do not lower it. The order is 4.0 in a range of steps
  whose errors are more than {NEAR:g} times the floor.
- `3e-04 ↓ (1.0)`: the finest step within the limit has the least error; finer steps would lower it.
- `<1e-12`: less than the bound on the truth's error.
- Without a number in parentheses, no range of steps has a constant order.
- `!`: no run completes; the outcomes are below.
- `–`: the mechanism is refused; the reason is below, and whether the adapter, the engine or the engine's
  model lacks the feature.
"""


def blocks(records: Path = FILE) -> list[Block]:
    """Return the page of the records in a file."""
    runs = read_runs(records)
    found, versions = table(runs), {r["engine"]: r["version"] for r in runs}
    header = ("engine, family", *(m.heading for m in MECHANISMS))
    rows = [(Within(row.name, f"#{_place(row.name)}"), *map(cell, of.values())) for row, of in found.items()]
    mechanisms = [f"- **{m.heading}** (`{m.place()}`, to {m.end:g} s): {m.about}" for m in MECHANISMS]
    return [
        Prose(HEAD),
        Table("Least errors, and orders in parentheses.", header, rows),
        Prose("\n".join(mechanisms)),
        Heading("The runs", 2),
        Prose("Each line has steps (s) or tolerances with their errors."),
        *(
            Fold(
                f"{row.name} {versions[row.engine]}: {row.method}",
                _place(row.name),
                [Prose("\n".join(f"- {name}: {listed(of_row)}" for name, of_row in of.items()))],
            )
            for row, of in found.items()
        ),
    ]


def _place(name: str) -> str:
    return "".join(c if c.isalnum() else "-" for c in name)
