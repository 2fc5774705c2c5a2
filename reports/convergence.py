"""The page on orders of convergence: errors of engines on runs at halved steps, from committed records.

``python -m reports.convergence docs/convergence.md`` writes the page anew, without a path it prints the page.
``python -m reports.convergence --run [--engine E] [docs/convergence.md]`` first makes the runs that the
records lack.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np

from crosscheck.closed_loops.mechanisms import Difficulty
from crosscheck.closed_loops.records import REFUSED, kept, read, write
from crosscheck.engine import Setting, engine
from crosscheck.judge.metrics import order_of_convergence
from crosscheck.judge.tolerances import FALSE_SUCCESS
from crosscheck.processes.pool import end_idle
from crosscheck.study.grid import Case, Record, default_cases, key, run_in_turn, study
from crosscheck.study.origin import made_by
from crosscheck.study.record_view import ended, error, error_bound, is_completed

FILE = Path(__file__).parent / "orders" / "records.jsonl"
SAMPLES = 11
TIME_LIMIT = 4.0  # s of CPU time of a run, so that all runs of the page take less than half an hour
HALVINGS = 16  # number of runs of a family at most
VAIN = 2  # number of successive runs without a lower error after which finer ones are not made
LOWER = 0.7  # of the least error so far: a method of order one halves the error with the step
TOLERANCES = ("rtol", "accuracy")  # options of families with error-controlled steps


MECHANISMS = (
    Difficulty("planar slider-crank", "A moment turns the crank.", "planar_slider_crank", 0.1),
    Difficulty("spatial slider-crank", "A moment turns the crank.", "spatial_slider_crank", 0.02),
    Difficulty("four-bar, free", "A planar four-bar swings under gravity.", "four_bar_free", 1.0),
    Difficulty("four-bar, driven", "A polynomial drives its crank.", "four_bar_driven", 1.0),
    Difficulty("five-bar", "A planar five-bar swings under gravity.", "five_bar_gravity", 0.5),
    Difficulty("Bennett", "Bennett's spatial four-bar; three rows are redundant.", "bennett", 0.5),
    Difficulty("heavy top", "A body on a ball joint, without a loop.", "heavy_top", 0.5),
)


class Row(NamedTuple):
    """A row of the table: a family of settings of an engine, and the order that its method has."""

    engine: str
    family: str
    method: str

    @property
    def name(self) -> str:
        """Engine and family, as the command line names them."""
        return f"{self.engine}, {self.family}"


ROWS = (
    Row("mbref", "taylor", "Taylor series, tolerance"),
    Row("mbref", "mpi-svd+partitioning", "DOP853 (order 8), tolerance"),
    Row("mujoco", "tuned", "MuJoCo's RK4, regulariser negligible"),
    Row("mujoco", "stock", "MuJoCo's RK4, stiffest documented closures"),
    Row("mujoco", "euler", "MuJoCo's semi-implicit Euler, default closures"),
    Row("pinocchio", "baumgarte", "RK4 with Pinocchio's Baumgarte terms"),
    Row("pinocchio", "tuned", "DOP853 (order 8) with projection, tolerance"),
    Row("exudyn", "alpha", "generalised alpha (order 2)"),
    Row("exudyn", "tuned", "trapezoidal rule, extrapolated"),
    Row("simbody", "merson", "Runge-Kutta-Merson (order 4), tolerance"),
    Row("sundials", "ggl", "IDA (BDF), tolerance"),
    Row("drake", "discrete", "Drake's discrete plant (order 1)"),
    Row("drake", "terms", "Drake's equations in DOP853 (order 8), tolerance"),
    Row("dart", "balls", "DART's step (order 1)"),
    Row("dart", "terms", "DART's equations in DOP853 (order 8), tolerance"),
    Row("bullet", "iterated", "Bullet's step (order 1)"),
    Row("mjx", "stock", "MJX's RK4 in double precision, stiffest documented closures"),
    Row("warp", "stock", "MuJoCo Warp's RK4 in single precision, stiffest documented closures"),
    Row("newton", "padmm, moreau", "Kamino in single precision, Moreau's midpoint (order 2)"),
    Row("newton", "lox", "Kamino in single precision, Euler (order 1)"),
)
HEAD = f"""# Orders of convergence

This page shows how fast the errors of an engine decrease with its time step, and where they stop. Use it to
choose a step. Every run is made again at half of its step, or at a tenth of its tolerance, until the error no
longer decreases or a run takes more than {TIME_LIMIT:g} s of CPU time.

```sh
python -m reports.convergence docs/convergence.md                # this page, from committed records
python -m reports.convergence --run --engine drake               # the runs that the records lack
```

Each cell has the least error of all runs and the measured order. The error is the largest of any body at any
sample, relative to the mechanism's length or in rad, against a closed form or the [reference
solution](reference.md). The order is the slope of log error over log step, in the longest range of at least
three steps in which it is nearly constant (`order_of_convergence` in `crosscheck/judge/metrics.py`). Where
the engine chooses its steps, the mean step counts. Order 1 means that half the step halves the error; order
4, that it divides the error by 16.

- `3e-12 (4.0)`: the least error is a floor: finer steps do not lower it. The order is 4.0 above the floor.
- `3e-04 ↓ (1.0)`: the finest step within {TIME_LIMIT:g} s has the least error; finer steps would lower it.
- `<1e-12`: less than the bound on the truth's error.
- Without a number in parentheses, no range of steps has a constant order.
- `–`: the engine refuses the mechanism; the reason is below.
"""


def ladder(row: Row, mechanism: Difficulty) -> list[Case]:
    """Return the runs of a row on a mechanism, coarse to fine: halved steps, or tenths of the tolerance.

    Steps are the interval of the samples divided by a power of two, so that halved steps are exact. The list
    is empty if the engine refuses the mechanism.
    """
    scene = mechanism.make()
    times = np.linspace(0.0, mechanism.end, SAMPLES)
    offered, _ = default_cases(scene, [row.engine], [row.family], times, TIME_LIMIT)
    if not offered:
        return []
    options = offered[0].setting.options
    if tolerance := next((name for name in TOLERANCES if name in options), ""):
        found = [{**options, tolerance: float(f"1e-{k}")} for k in range(2, 14)]
    else:
        interval = float(times[1])
        first = max(0, math.ceil(math.log2(interval / float(options["step"]))))
        found = [{**options, "step": interval / 2.0**k} for k in range(first, first + HALVINGS)]
    return [case._replace(setting=Setting(row.family, o)) for case in offered[:1] for o in found]


def climb(cases: Sequence[Case], run: Callable[[Case], Record]) -> list[Record]:
    """Return records from coarse to fine, until finer runs are in vain or would take too long."""
    records: list[Record] = []
    for case in cases:
        if records and _would_take(case, records[-1]) > TIME_LIMIT:
            break
        records.append(run(case))
        if in_vain(records) == VAIN:
            break
    return records


def _would_take(case: Case, coarser: Record) -> float:
    """Return the CPU time (s) of a run by the time of the next coarser run."""
    if not is_completed(coarser):
        return math.inf if coarser["outcome"] == "TIMED_OUT" else 0.0
    options, before = case.setting.options, coarser["asked"]["options"]
    return float(coarser["cost"]["seconds"] * before.get("step", 1.0) / options.get("step", 1.0))


def in_vain(records: Sequence[Record]) -> int:
    """Return the number of last runs whose errors are not lower than the least error before them; runs count
    from the first right motion."""
    least, vain = math.inf, 0
    for record in records:
        found = max(error(record), error_bound(record)) if is_completed(record) else math.inf
        if least <= FALSE_SUCCESS:
            vain = vain + 1 if found > LOWER * least else 0
        least = min(least, found)
    return vain


def measure(engines: Sequence[str], path: Path = FILE) -> None:
    """Make and store the runs that the file lacks, one at a time."""
    path.parent.mkdir(exist_ok=True)
    with ThreadPoolExecutor(1) as one:

        def run(case: Case) -> Record:
            known = {record["key"]: record for record in read(path)}
            if key(case) in known:
                return known[key(case)]
            [made] = study([case], one, run=run_in_turn)
            write([*known.values(), kept(made)], path)
            print(f"{made['engine']} {made['family']} {made['scene']}: {_point(made)}", flush=True)
            return made

        for row in (row for row in ROWS if row.engine in engines):
            for mechanism in MECHANISMS:
                climb(ladder(row, mechanism), run) or _refuse(row, mechanism, path)
    end_idle()


def _refuse(row: Row, mechanism: Difficulty, path: Path) -> None:
    """Store the refusal of a mechanism by an engine or by its family."""
    cannot = engine(row.engine).cannot(mechanism.make())
    reason = cannot.reason if cannot else f"the family {row.family} does not serve this mechanism"
    found = {"key": f"{row.name} {mechanism.scene}", "engine": row.engine, "family": row.family}
    found |= {"scene": mechanism.scene, "outcome": REFUSED, "message": reason}
    found |= {"version": engine(row.engine).version(), "date": made_by()["date"]}
    write([*(r for r in read(path) if r["key"] != found["key"]), found], path)


def page(path: Path = FILE) -> str:
    """Return the page in Markdown."""
    records = read(path)
    versions = {r["engine"]: r["version"] for r in records}
    rows = {row: _by_mechanism(row, records) for row in ROWS if row.engine in versions}
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
    """Return the records of a row by heading of the mechanism, coarse to fine."""
    own = [r for r in records if (r["engine"], r["family"]) == (row.engine, row.family)]
    return {m.heading: sorted((r for r in own if r["scene"] == m.scene), key=_fineness) for m in MECHANISMS}


def _fineness(record: Record) -> float:
    options = record.get("asked", {}).get("options", {})
    return -float(next((options[name] for name in ("step", *TOLERANCES) if name in options), 0.0))


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
    """Return the measured order of completed runs whose errors exceed the bound on the truth's error."""
    above = [record for record in records if error(record) > error_bound(record)]
    if len(above) < 3:
        return None
    return order_of_convergence([step(record) for record in above], [error(record) for record in above])


def step(record: Record) -> float:
    """Return the step of a run, or the mean step where the engine chose its steps, s."""
    own = record["asked"]["options"].get("step")
    return float(own or record["t_end"] / record["cost"]["steps"])


def _runs(records: Sequence[Record]) -> str:
    if not records:
        return "not measured"
    if records[0]["outcome"] == REFUSED:
        return f"refused: {records[0]['message']}"
    return "; ".join(map(_point, records))


def _point(record: Record) -> str:
    setting = -_fineness(record)
    return (
        f"{setting:.2g}: {error(record):.1e}" if is_completed(record) else f"{setting:.2g}: {ended(record)}"
    )


def main() -> None:
    """Make runs if requested, and write or print the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("page", nargs="?", metavar="FILE")
    parser.add_argument("--run", action="store_true", help="make the runs that the records lack")
    parser.add_argument("--engine", action="append", metavar="E", help="only this engine; may repeat")
    arguments = parser.parse_args()
    if arguments.run:
        measure(arguments.engine or [name for name in dict.fromkeys(r.engine for r in ROWS)])
    if arguments.page:
        Path(arguments.page).write_text(page())
    elif not arguments.run:
        print(page(), end="")


if __name__ == "__main__":
    main()
