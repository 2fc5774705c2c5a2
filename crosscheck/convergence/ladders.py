"""Runs of engines at halved steps, from which orders of convergence are measured, and their records."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np

from crosscheck.closed_loops.mechanisms import Difficulty
from crosscheck.engine import Cannot, Owner, Setting, engine
from crosscheck.judge.tolerances import FALSE_SUCCESS
from crosscheck.processes.pool import end_idle
from crosscheck.setting import TOLERANCES
from crosscheck.study.grid import Case, Record, key, run_in_turn, study
from crosscheck.study.record_view import ended, error, error_bound, is_completed
from crosscheck.study.search.offers import default_cases
from crosscheck.study.store import read_runs, refusal, short, short_key
from mbref.records import rewrite

FILE = Path(__file__).parent / "records.jsonl.xz"
SAMPLES = 11
TIME_LIMIT = 2.0  # s of CPU time of a run, so that all runs of the page take half an hour
SLOW = 10.0  # s of CPU time of a run of a family whose step takes 0.1 s
MOST_TIME = 120.0  # s of CPU time of a run with the compilation of its model
HALVINGS = 16  # number of runs of a family at most
VAIN = 2  # number of successive runs without a lower error after which finer ones are not made
VANISHING = {"compliance": 2}  # options that vanish with the step, and the power of the step
LOWER = 0.7  # of the least error so far: a method of order one halves the error with the step

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
    """A row of the table: a family of settings of an engine, and the order that its method has.

    ``time_limit`` is CPU time of a run (s) above which no finer run is made.
    """

    engine: str
    family: str
    method: str
    time_limit: float = TIME_LIMIT

    @property
    def name(self) -> str:
        """Engine and family, as the command line names them."""
        return f"{self.engine}, {self.family}"


ROWS = (
    Row("mbref", "taylor", "Taylor series, tolerance"),
    Row("mbref", "mpi-svd+partitioning", "DOP853 (order 8), tolerance"),
    Row("mujoco", "tuned", "MuJoCo's RK4, regulariser negligible"),
    Row("mujoco", "stock", "MuJoCo's RK4, stiffest documented closures"),
    Row("mujoco", "euler", "MuJoCo's semi-implicit Euler, stiffest documented closures"),
    Row("mujoco", "implicit", "MuJoCo's integrator implicit, stiffest documented closures"),
    Row("mujoco", "implicitfast", "MuJoCo's integrator implicitfast, stiffest documented closures"),
    Row("mujoco", "discrete", "MuJoCo's integrator discrete, stiffest documented closures"),
    Row("pinocchio", "baumgarte", "RK4 with Pinocchio's Baumgarte terms"),
    Row("pinocchio", "lcaba", "RK4 with the loop-constrained articulated body algorithm"),
    Row("pinocchio", "admm", "RK4 with the anchors of Pinocchio 4 and its ADMM, Baumgarte terms"),
    Row("pinocchio", "pgs", "RK4 with the anchors of Pinocchio 4 and its PGS, Baumgarte terms"),
    Row("pinocchio", "impulses", "impulses of its ADMM (order 1), closure errors removed in a step"),
    Row("pinocchio", "impulses, pgs", "impulses of its PGS (order 1), closure errors removed in a step"),
    Row("pinocchio", "compliant", "impulses of its ADMM (order 1), compliance of step² / mean mass"),
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
    Row("newton", "padmm, moreau", "Kamino with PADMM in single precision, Moreau's midpoint (order 2)"),
    Row("newton", "lox", "Kamino with LOX in single precision, Euler (order 1)"),
    Row("newton", "lox, moreau", "Kamino with LOX in single precision, Moreau's midpoint (order 2)"),
    Row("newton", "dvi, moreau", "Kamino with DVI in single precision, Moreau's midpoint (order 2)", SLOW),
    Row("newton", "dvi", "Kamino with DVI in single precision, Euler (order 1)", SLOW),
    Row("newton", "defaults", "Kamino's defaults: PADMM in single precision, Euler (order 1)", SLOW),
    Row("newton", "mujoco", "SolverMuJoCo in single precision, default closures (order 1)"),
    Row("newton", "xpbd", "SolverXPBD in single precision"),
    Row("newton", "semi-implicit", "SolverSemiImplicit in single precision (order 1)"),
    Row("newton", "featherstone", "SolverFeatherstone in single precision (order 1)"),
)


def ladder(row: Row, mechanism: Difficulty) -> list[Case]:
    """Return the runs of a row on a mechanism, coarse to fine: halved steps, or tenths of the tolerance.

    Steps are the interval of the samples divided by a power of two, so that halved steps are exact. The list
    is empty if the engine refuses the mechanism.
    """
    scene = mechanism.make()
    times = np.linspace(0.0, mechanism.end, SAMPLES)
    offered, _ = default_cases(scene, [row.engine], [row.family], times, MOST_TIME)
    if not offered:
        return []
    options = offered[0].setting.options
    if tolerance := next((name for name in TOLERANCES if name in options), ""):
        found = [{**options, tolerance: float(f"1e-{k}")} for k in range(2, 14)]
    else:
        interval = float(times[1])
        first = max(0, math.ceil(math.log2(interval / float(options["step"]))))
        steps = [interval / 2.0**k for k in range(first, first + HALVINGS)]
        found = [{**options, "step": h, **_shrunk(options, h)} for h in steps]
    return [case._replace(setting=Setting(row.family, o)) for case in offered[:1] for o in found]


def _shrunk(options: Mapping[str, float], step: float) -> dict[str, float]:
    """Return the options that vanish with the step, at a step (s)."""
    part = step / options["step"]
    return {name: options[name] * part**power for name, power in VANISHING.items() if name in options}


def climb(
    cases: Sequence[Case], run: Callable[[Case], Record], time_limit: float = TIME_LIMIT
) -> list[Record]:
    """Return records from coarse to fine, until finer runs are in vain or would take more CPU time (s)."""
    records: list[Record] = []
    for case in cases:
        if records and _would_take(case, records[-1]) > time_limit:
            break
        records.append(run(case))
        if in_vain(records) == VAIN:
            break
    return records


def _would_take(case: Case, coarser: Record) -> float:
    """Return the CPU time (s) of a run by the time of the next coarser run."""
    if coarser["outcome"] == "TIMED_OUT":
        return math.inf
    options, before = case.setting.options, coarser["asked"]["options"]
    return float(coarser["cost"]["seconds"] * before.get("step", 1.0) / options.get("step", 1.0))


def in_vain(records: Sequence[Record]) -> int:
    """Return the number of last runs whose errors are not lower than the least error before them.

    Runs count from the first right motion. A run with as many steps as the run before, at a smaller
    tolerance, does not count.
    """
    least, vain, steps = math.inf, 0, 0
    for record in records:
        found = max(error(record), error_bound(record)) if is_completed(record) else math.inf
        if found <= LOWER * least:
            vain = 0
        elif least <= FALSE_SUCCESS and record["cost"]["steps"] != steps:
            vain += 1
        least, steps = min(least, found), record["cost"]["steps"]
    return vain


def fineness(record: Record) -> float:
    """Return the step (s) or the tolerance of a run; 0 for a refusal."""
    options = record.get("asked", {}).get("options", {})
    return float(next((options[name] for name in ("step", *TOLERANCES) if name in options), 0.0))


def point(record: Record) -> str:
    """Return step or tolerance of a run with its error, or with how it ended."""
    result = f"{error(record):.1e}" if is_completed(record) else ended(record)
    return f"{fineness(record):.2g}: {result}"


def measure(
    engines: Sequence[str],
    path: Path = FILE,
    report: Callable[[str], None] = print,
    rows: Sequence[Row] = ROWS,
    mechanisms: Sequence[Difficulty] = MECHANISMS,
) -> None:
    """Make the runs that the file lacks, one at a time, and store them after each row on a mechanism;
    ``report`` gets a line for each run."""
    known = {record["key"]: record for record in read_runs(path)}
    with ThreadPoolExecutor(1) as one:

        def run(case: Case) -> Record:
            if (name := short_key(key(case))) not in known:
                [made] = study([case], one, run=run_in_turn)
                known[name] = short(made)
                report(f"{made['engine']} {made['family']} {made['scene']}: {point(made)}")
            return known[name]

        for row in (row for row in rows if row.engine in engines):
            for mechanism in mechanisms:
                if not climb(ladder(row, mechanism), run, row.time_limit):
                    refused = _refusal(row, mechanism)
                    known[refused["key"]] = refused
                rewrite(path, known.values())
    end_idle()


def _refusal(row: Row, mechanism: Difficulty) -> Record:
    """Return the record of the refusal of a mechanism by an engine or by its family."""
    unserved = Cannot(Owner.ADAPTER, f"the family {row.family} does not serve this mechanism")
    cannot = engine(row.engine).cannot(mechanism.make()) or unserved
    name = f"{row.name} {mechanism.scene}"
    return refusal(name, mechanism.scene, row.engine, cannot) | {"family": row.family}
