"""Cost of a simulated second at errors of 1e-3, 1e-6 and 1e-9: mbref, engines, general integrators, limit.

    python benchmarks/speed.py [SCENE …] [--only ENGINE …] [--out FILE.json] [--plot FILE.png]

Every setting of every family is run once in a child process, coarse to fine, until it takes too long; then
all useful settings take turns in REPEATS rounds of this process, short runs several times in each round, so
that their code is warm.  Times are process CPU seconds of the stepping, medians, by one BLAS thread; errors
are against the scene's truth; the cost at an error is interpolated on the curve of the family (settings:
``grids``). A family of settings uses the engine's own integrator, or crosscheck's integrator in Python, or in
compiled code; the table states which.
"""

from __future__ import annotations

import one_thread  # noqa: F401 - before NumPy

# isort: split
import argparse
import json
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from grids import COMPILED, cost_at_one_error, misses, passes_singular_position, refined
from limit import LIMIT
from rich.console import Console
from rich.table import Table

from crosscheck.engine import Setting, engine, installed
from crosscheck.judge.metrics import cost_at_error, measure
from crosscheck.judge.tolerances import ERROR_LEVELS
from crosscheck.judge.truth import truth_for
from crosscheck.processes.pool import run_isolated
from crosscheck.study.provenance import machine, versions
from mbref.motions.trajectory import Cost, Outcome
from mbref.scene import Scene
from mbref.scenes import SCENES

OURS, LIMIT_NAME, SERIES = "mbref", LIMIT.name, "taylor"
ENGINES = ("mbref", "mujoco", "pinocchio", "exudyn", "sundials", "casadi", "heyoka")
OTHERS = ("general_integrators:SCIPY", "general_integrators:SCIKIT_SUNDAE", "limit:LIMIT")
PAPER = (
    "four_bar",
    "five_bar",
    "spatial_slider_crank",
    "spatial_slider_crank_driven",
    "planar_slider_crank",
    "planar_slider_crank_equal",
    "planar_slider_crank_heavy",
    "four_bar_gravity",
    "five_bar_gravity",
    "spatial_slider_crank_gravity",
    "planar_slider_crank_gravity",
)
SAMPLES = 11  # few, because adaptive integrators end a step at every sample time
REPEATS = 5
LONG, TOO_LONG = (
    0.7,
    2.0,
)  # s; runs longer than LONG are not repeated; after a run longer than TOO_LONG no finer setting is tried
BRIEF, MOST_TIMES = 5e-3, 10  # s; shorter runs are repeated within a round, for so long, and so often
TIME_LIMIT = 60.0  # s of a run; an engine can hang
NEAR = 1.5  # cost / cost of the engine's best family after one round: a smaller ratio may still be the best
ENOUGH = 1e-10  # error below which finer settings of a family are not run


@dataclass
class Run:
    """One setting on one scene: outcome, error, counts, and seconds in all rounds."""

    engine: str
    family: str
    options: dict[str, Any]
    outcome: str
    error: float
    cost: dict[str, Any]
    seconds: list[float] = field(default_factory=list)

    @property
    def median(self) -> float:
        """Return the median seconds of stepping; the seconds of the first run if it was too long to be
        repeated."""
        return median(self.seconds) if self.seconds else self.cost["seconds"]


Curve = tuple[str, str]  # engine and family
OWN, COMPILED_HERE = "its own", "crosscheck's, compiled"
OPPONENTS = {  # engines and kinds of integrators
    "own integrators": (ENGINES[1:4], (OWN,)),
    "engines": (ENGINES[1:4], ()),
    "general": (("sundials", "scipy"), ()),
    "generated code": (("casadi", "heyoka"), ()),
    "limit": ((LIMIT_NAME,), ()),
}
OURSELVES: dict[str, Callable[[str], bool]] = {  # groups of mbref's families, by a test of their names
    "series": lambda family: family.startswith(SERIES),
    "other methods": lambda family: not family.startswith(SERIES),
}


def competitors(only: Sequence[str] = ()) -> list[str]:
    """Return all engines, or the engines named ``only``, whose packages are installed; print the missing
    ones."""
    found = []
    for name in (*ENGINES, *OTHERS):
        if only and engine(name).name not in only:
            continue
        if installed(name):
            found.append(name)
        else:
            print(f"{name}: left out, {engine(name).package} is not installed", file=sys.stderr)
    return found


def measured(scene: Scene, names: Sequence[str]) -> list[Run]:
    """Return every run of the scene; useful runs are timed in turns."""
    times = np.linspace(0.0, scene.duration, SAMPLES)
    able = [name for name in names if engine(name).cannot(scene) is None]
    singular = passes_singular_position(scene)
    jobs = [(engine(name), run) for name in able for run in _sweep(name, scene, times, singular)]
    curves: dict[Curve, list[Run]] = {}
    for _, run in jobs:
        curves.setdefault((run.engine, run.family), []).append(run)
    worth = [job for job in jobs if _is_worth_timing(job[1], curves)]
    for simulator, run in worth:
        simulator.prepare([run.family])
    for _ in range(REPEATS):
        for simulator, run in worth:
            for _ in range(_times(run)):
                run.seconds.append(simulator.run(scene, times, Setting(run.family, run.options)).cost.seconds)
    return [run for _, run in jobs]


def _sweep(name: str, scene: Scene, times: np.ndarray, singular: bool) -> Iterator[Run]:
    """Yield one run of each setting of each family, coarse to fine."""
    finished = set()

    def score(setting: Setting) -> float:
        run = _once(name, scene, times, setting)
        return cost_at_one_error(run.cost["seconds"], run.error) if _is_usable(run) else math.inf

    for setting in refined(engine(name).settings(scene), scene, singular, score):
        if (sweep := _part(setting)) in finished:
            continue
        run = _once(name, scene, times, setting)
        yield run
        is_dear = run.outcome == Outcome.TIMED_OUT.label or run.cost["seconds"] > TOO_LONG
        if is_dear or (_is_usable(run) and run.error < ENOUGH):
            finished.add(sweep)


def _part(setting: Setting) -> tuple[Any, ...]:
    """Facts that stay constant while a family is swept from coarse to fine."""
    swept = "rtol" in setting.options
    return setting.family, *(v for k, v in setting.options.items() if swept and k != "rtol")


def _once(name: str, scene: Scene, times: np.ndarray, setting: Setting) -> Run:
    """Return one run in a separate process."""
    trajectory = run_isolated(name, scene, times, setting, TIME_LIMIT)
    error = measure(scene, trajectory, truth_for(scene))["error"]
    error, cost = math.inf if error is None else error, asdict(trajectory.cost)
    label = trajectory.outcome.label
    return Run(engine(name).name, setting.family, dict(setting.options), label, error, cost)


def _times(run: Run) -> int:
    """How often a run is repeated in a round."""
    return max(1, min(MOST_TIMES, round(BRIEF / max(run.cost["seconds"], 1e-6))))


def _is_worth_timing(run: Run, curves: dict[Curve, list[Run]]) -> bool:
    """Return the runs that give the cost at a level: of mbref in every family, of an engine in the best
    families of every kind of integrator."""
    own = curves[run.engine, run.family]
    if run.cost["seconds"] > LONG or not any(run in _around(own, level) for level in ERROR_LEVELS):
        return False
    if run.engine in (OURS, LIMIT_NAME):
        return True
    kind = _integrator(run.engine, run.family)
    rivals = [
        _costs(runs)
        for curve, runs in curves.items()
        if curve[0] == run.engine and _integrator(*curve) == kind
    ]
    best = [min(costs) for costs in zip(*rivals, strict=True)]
    return any(cost < NEAR * least for cost, least in zip(_costs(own), best, strict=True))


def _around(runs: Sequence[Run], level: float) -> list[Run]:
    """Return the completed runs just below and just above an error; no runs if the error is not reached."""
    done = sorted((run for run in runs if _is_usable(run)), key=lambda run: run.error)
    below = [run for run in done if run.error <= level]
    return [*below[-1:], *done[len(below) : len(below) + 1]] if below else []


def _is_usable(run: Run) -> bool:
    return run.outcome == Outcome.COMPLETED.label and math.isfinite(run.error)


def _costs(runs: Sequence[Run]) -> list[float]:
    """Return the seconds at each level of error; infinite if the level is not reached."""
    done = [run for run in runs if _is_usable(run)]
    seconds, errors = [run.median for run in done], [run.error for run in done]
    found = [cost_at_error(seconds, errors, level) for level in ERROR_LEVELS]
    return [math.inf if cost is None else cost for cost in found]


def rows(scene: Scene, runs: Sequence[Run]) -> list[dict[str, Any]]:
    """Return one row for each curve: seconds per simulated second at each level, and the cheapest run that
    reaches the level."""
    curves: dict[Curve, list[Run]] = {}
    for run in runs:
        curves.setdefault((run.engine, run.family), []).append(run)
    return [
        {
            "engine": name,
            "family": family,
            "cost": [c / scene.duration for c in _costs(group)],
            "runs": [_cheapest(group, level) for level in ERROR_LEVELS],
            "least": _least(group, scene),
        }
        for (name, family), group in curves.items()
    ]


def _least(runs: Sequence[Run], scene: Scene) -> tuple[float, float]:
    """Return the least error of completed runs, and its seconds per simulated second."""
    done = [(run.error, run.median / scene.duration) for run in runs if _is_usable(run)]
    return min(done, default=(math.inf, math.inf))


def _cheapest(runs: Sequence[Run], level: float) -> Run | None:
    able = [run for run in runs if _is_usable(run) and run.error <= level]
    return min(able, key=lambda run: run.median, default=None)


def chosen(table: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return every family of mbref, and the best family at each level of every other engine and kind of
    integrator."""
    kept = []
    for row in table:
        kind = _kind(row)
        others = [other for other in table if _kind(other) == kind]
        best = [min(costs) for costs in zip(*(other["cost"] for other in others), strict=True)]
        wins = [c == b < math.inf for c, b in zip(row["cost"], best, strict=True)]
        if row["engine"] == OURS or any(wins):
            kept.append(row)
    return kept


def _kind(row: dict[str, Any]) -> tuple[str, str]:
    return row["engine"], _integrator(row["engine"], row["family"])


def _integrator(name: str, family: str) -> str:
    """Return the owner of a family's integrator."""
    if name not in ENGINES or family not in engine(name).integrated_here:
        return OWN
    return COMPILED_HERE if family.endswith(COMPILED) else "crosscheck's, in Python"


def show(console: Console, scene: Scene, table: Sequence[dict[str, Any]]) -> None:
    """Milliseconds per simulated second, also as multiples of the limit; counts of the nearest run."""
    limit = next(
        (row["cost"] for row in table if row["engine"] == LIMIT_NAME), [math.nan] * len(ERROR_LEVELS)
    )
    shown = Table(title=f"{scene.name}, {scene.duration:g} s: milliseconds per simulated second")
    for heading in ("engine", "family", "integrator"):
        shown.add_column(heading, no_wrap=True)
    for level in ERROR_LEVELS:
        shown.add_column(f"at {level:.0e}", justify="right")
        shown.add_column("× limit", justify="right")
    shown.add_column(f"run nearest {ERROR_LEVELS[1]:.0e}: error, evaluations, factorisations, Newton")
    for row in sorted(chosen(table), key=lambda row: row["cost"][1]):
        cells = [text for c, l in zip(row["cost"], limit, strict=True) for text in (_ms(c), _multiple(c / l))]
        shown.add_row(row["engine"], row["family"], _kind(row)[1], *cells, _counts(row["runs"][1]))
    console.print(shown)
    for sentence in misses(table, ERROR_LEVELS):
        console.print(sentence)


def summary(console: Console, tables: dict[str, Sequence[dict[str, Any]]]) -> None:
    """Return a comparison of mbref's series and other methods with the best engines."""
    shown = Table(title="The best of others, as a multiple of mbref's best, at errors of …")
    shown.add_column("scene", no_wrap=True)
    shown.add_column("mbref by", no_wrap=True)
    for name in OPPONENTS:
        for level in ERROR_LEVELS:
            shown.add_column(f"{name} {level:.0e}", justify="right")
    for scene, table in tables.items():
        others = [
            cost for names, kinds in OPPONENTS.values() for cost in least_costs(rows_of(table, names, kinds))
        ]
        for whose, belongs in OURSELVES.items():
            mine = [row for row in rows_of(table, (OURS,)) if belongs(row["family"])]
            pairs = zip(others, least_costs(mine) * len(OPPONENTS), strict=True)
            shown.add_row(scene, whose, *(advantage(theirs, ours) for theirs, ours in pairs))
    console.print(shown)


def rows_of(
    table: Sequence[dict[str, Any]], names: Sequence[str], kinds: Sequence[str] = ()
) -> list[dict[str, Any]]:
    """Return the rows of these engines, and of these kinds of integrators if kinds are named."""
    return [row for row in table if row["engine"] in names and (not kinds or _kind(row)[1] in kinds)]


def least_costs(rows: Sequence[dict[str, Any]]) -> list[float]:
    """Return the least cost (s) of some rows at each error, NaN without rows."""
    costs = [row["cost"] for row in rows]
    return [min(level) for level in zip(*costs, strict=True)] if costs else [math.nan] * len(ERROR_LEVELS)


def _stored(scene: Scene, runs: Sequence[Run], table: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """A scene's runs and curves for JSON, which has no infinity."""
    return {
        "duration": scene.duration,
        "levels": ERROR_LEVELS,
        "runs": [{**asdict(run), "error": _or_none(run.error)} for run in runs],
        "curves": [
            {"engine": row["engine"], "family": row["family"], "cost": [_or_none(c) for c in row["cost"]]}
            for row in table
        ],
    }


def _or_none(number: float) -> float | None:
    return number if math.isfinite(number) else None


def _ms(seconds: float) -> str:
    return "–" if not math.isfinite(seconds) else f"{seconds * 1e3:.3g}"


def advantage(theirs: float, ours: float) -> str:
    if math.isinf(theirs) and math.isfinite(ours):
        return "alone"  # no other reaches that error
    return _multiple(theirs / ours) if math.isfinite(ours) else "–"


def _multiple(ratio: float) -> str:
    return "–" if not math.isfinite(ratio) else f"{ratio:.2g}" if ratio < 100 else f"{ratio:.0f}"


def _counts(run: Run | None) -> str:
    if run is None:
        return "–"
    cost = Cost(**run.cost)
    return f"{run.error:.0e}, {cost.rhs}, {cost.factorisations}, {cost.newton}"


def main() -> None:
    """Measure, print, store, draw."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("scene", nargs="*", default=PAPER, help=f"default: {' '.join(PAPER)}")
    parser.add_argument("--only", action="append", default=[], metavar="ENGINE", help="may repeat")
    parser.add_argument("--out", type=Path, help="JSON of every run and of the table")
    parser.add_argument("--plot", type=Path, help="a picture of the costs")
    options = parser.parse_args()
    console = Console(width=None if sys.stdout.isatty() else 220)
    simulators, tables, data = (
        competitors(options.only),
        {},
        {"machine": machine(), "versions": versions(), "scenes": {}},
    )
    for name in options.scene:
        scene = SCENES[name]()
        runs = measured(scene, simulators)
        tables[name] = rows(scene, runs)
        show(console, scene, tables[name])
        data["scenes"][name] = _stored(scene, runs, tables[name])
        if options.out:
            options.out.write_text(json.dumps(data, allow_nan=False))
    summary(console, tables)
    if options.plot:
        from speed_plot import draw

        from reports import figures

        options.plot.write_bytes(figures.png(draw(data)))


if __name__ == "__main__":
    main()
