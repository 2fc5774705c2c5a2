"""Records of invariants: the numbers of each run of an experiment, and refusals, in one small file."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, model_validator

from crosscheck.engine import Cannot, Engine, Owner, Setting, engine
from crosscheck.invariants.experiments import EXPERIMENTS, SOLVERS, Experiment, times_of
from crosscheck.processes.pool import end_idle, run_isolated
from crosscheck.study import store
from crosscheck.study.grades import DEFAULTS
from crosscheck.study.provenance import made_by
from crosscheck.study.record_shape import Record
from crosscheck.study.store import REFUSED, in_digits
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.records import rewrite

FILE = Path(__file__).parent / "records.jsonl.xz"
TIME_LIMIT = 10.0  # s of CPU time of a run, so that all runs of an engine take some minutes
BEST = "best"  # name of the family that an engine names as its most accurate one, in rows


@dataclass(frozen=True)
class Row:
    """A row of a table: a family of settings of an engine, with changed options."""

    engine: str
    family: str
    options: Mapping[str, Any] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Engine, family and changed options."""
        changed = ", ".join(f"{name} {value}" for name, value in self.options.items())
        return f"{self.engine}, {self.family}" + f" ({changed})" * bool(changed)

    @property
    def experiments(self) -> Sequence[Experiment]:
        """Experiments of the row: those on solvers, too, if its options name a solver."""
        return (*EXPERIMENTS, *SOLVERS) if "solver" in self.options else EXPERIMENTS


OTHERS = (
    *(Row("mujoco", DEFAULTS, {"integrator": name}) for name in ("RK4", "implicit", "discrete")),
    *(Row("mujoco", family) for family in ("stock", "euler", "implicit", "discrete")),
    Row("mujoco", "stock", {"solver": "CG"}),
    Row("mujoco", "stock", {"solver": "CG", "tolerance": 1e-6}),
    *(Row("pinocchio", family) for family in ("lcaba", "admm", "pgs")),
    Row("exudyn", "alpha"),
)


class Shape(BaseModel):
    """Record of a run, or of the refusal of a mechanism, which has neither ``x`` nor ``values``; they are
    empty unless the run completed."""

    model_config = ConfigDict(strict=True)

    key: str
    row: str
    engine: str
    version: str
    family: str
    experiment: str
    outcome: str
    message: str
    x: float = 0.0
    options: dict[str, Any] = {}
    values: dict[str, float | None] = {}
    seconds: float = 0.0

    @model_validator(mode="after")
    def _is_of_a_row_and_a_run(self) -> Shape:
        if not self.row.startswith(f"{self.engine}, "):
            raise ValueError(f"row must begin with {f'{self.engine}, '!r}, the engine and a comma")
        if self.outcome != REFUSED and not {"x", "values"} <= self.model_fields_set:
            raise ValueError("x and values are required of a run")
        return self


def read(path: Path = FILE) -> list[Record]:
    """Return the stored records. Raises RecordsError."""
    return list(store.read(path, Shape).values())


def rows_of(name: str) -> list[Row]:
    """Return the rows of an engine: its defaults, its best family, and others that are listed here."""
    families = [DEFAULTS] if DEFAULTS in engine(name).families else []
    return [
        *(Row(name, family) for family in (*families, BEST)),
        *(row for row in OTHERS if row.engine == name),
    ]


def measure(engines: Sequence[str], path: Path = FILE, report: Callable[[str], None] = print) -> None:
    """Make the runs of the engines' rows that the file lacks; ``report`` gets a line for each experiment.

    Records of another version of an engine are replaced, and records of unlisted rows are dropped.
    """
    known = {record["key"]: record for record in read(path)}
    for name in engines:
        version = engine(name).version()
        asked = {(version, row.name) for row in rows_of(name)}
        known = {k: r for k, r in known.items() if r["engine"] != name or (r["version"], r["row"]) in asked}
        for row in rows_of(name):
            for experiment in row.experiments:
                if not any(_is_of(record, row, experiment) for record in known.values()):
                    known |= {record["key"]: record for record in made(row, experiment)}
                    rewrite(path, known.values())
                    report(f"{row.name}: {experiment.name}")
    end_idle()


def _is_of(record: Record, row: Row, experiment: Experiment) -> bool:
    return bool(record["row"] == row.name and record["experiment"] == experiment.name)


def made(row: Row, experiment: Experiment) -> Iterator[Record]:
    """Yield the record of each run of an experiment, or the record of a refusal."""
    asked, scene = engine(row.engine), experiment.first()
    cannot = asked.cannot(scene)
    offered = [] if cannot else _settings(asked, row)(scene)
    settings = [Setting(s.family, {**s.options, **row.options}) for s in offered]
    if not settings:
        unserved = Cannot(Owner.ADAPTER, f"the family {row.family} does not serve this mechanism")
        yield _record(asked, row, experiment) | {"outcome": REFUSED, "message": (cannot or unserved).reason}
        return
    base, last = None, None
    for x, setting in experiment.points(_in_time(row, experiment, settings)):
        if last and not experiment.values and _would_take(setting, last) > TIME_LIMIT:
            break
        scene = experiment.make(x)
        run = run_isolated(row.engine, scene, times_of(scene), setting, TIME_LIMIT)
        record = last = _record(asked, row, experiment) | _of_run(x, setting, run)
        if experiment.exact:
            exact = Setting(setting.family, {**setting.options, **experiment.exact})
            base = run_isolated(row.engine, scene, times_of(scene), exact, TIME_LIMIT)
        if run.outcome is Outcome.COMPLETED:
            base = base or run
        if run.outcome is Outcome.COMPLETED and base is not None and base.outcome is Outcome.COMPLETED:
            record["values"] = in_digits(dict(experiment.measure(scene, run, x, base)))
        yield record | {"key": f"{record['key']} {x:g}"}


def _in_time(row: Row, experiment: Experiment, settings: Sequence[Setting]) -> Sequence[Setting]:
    """Return the settings up to the finest one at which the first value's run does not run out of time."""
    while experiment.values and len(settings) > 1:
        x, setting = experiment.points(settings)[0]
        scene = experiment.make(x)
        run = run_isolated(row.engine, scene, times_of(scene), setting, TIME_LIMIT)
        if run.outcome is not Outcome.TIMED_OUT:
            break
        settings = settings[:-1]
    return settings


def _would_take(setting: Setting, coarser: Record) -> float:
    """Return the CPU time (s) of a run by the time of the run with the next longer step."""
    if coarser["outcome"] == Outcome.TIMED_OUT.label:
        return math.inf
    longer = coarser["options"].get("step", 1.0) / setting.options.get("step", 1.0)
    return float(coarser["seconds"] * longer)


def _settings(asked: Engine, row: Row) -> Callable[..., Sequence[Setting]]:
    if row.family == BEST:
        return asked.best_settings
    return lambda scene: asked.settings_of(scene, row.family) if asked.serves(scene, row.family) else []


def _record(asked: Engine, row: Row, experiment: Experiment) -> Record:
    origin = made_by()
    return {
        "key": f"{row.name} {experiment.name}",
        "row": row.name,
        "engine": row.engine,
        "version": asked.version(),
        "family": row.family,
        "experiment": experiment.name,
        **{part: origin[part] for part in ("commit", "date")},
    }


def _of_run(x: float, setting: Setting, run: Trajectory) -> Record:
    return {
        "x": x,
        "family": setting.family,
        "options": dict(setting.options),
        "outcome": run.outcome.label,
        "message": run.message,
        "seconds": in_digits(run.cost.seconds),
        "values": {},
    }
