"""Shapes of stored records: fields and types that tables, reports and comparisons read."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import chain
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from crosscheck.setting import TOLERANCES
from mbref.motions.trajectory import Outcome
from mbref.records import RecordsError

Record = dict[str, Any]
MOST_SAMPLES = 10_000_000  # of a run, as of commands


def _label(text: str) -> str:
    if text not in Outcome.__members__:
        raise ValueError(f"must be one of {', '.join(Outcome.__members__)}")
    return text


def _rows_of(width: int) -> Callable[[list[Any]], list[Any]]:
    """Return the function that returns rows of ``width`` numbers, and raises ValueError for others."""

    def checked_rows(rows: list[Any]) -> list[Any]:
        if any(not isinstance(row, list) or len(row) != width for row in rows):
            raise ValueError(f"must have rows of {width} numbers")
        _numbers(list(chain.from_iterable(rows)))
        return rows

    return checked_rows


def _numbers(values: list[Any]) -> list[Any]:
    """Return the values if each is null or a number of double precision; raises ValueError for others."""
    if not {type(value) for value in values} <= {int, float, type(None)}:
        raise ValueError("must be numbers")
    try:
        np.array(values, dtype=float)
    except OverflowError:
        raise ValueError("has a number that is too large") from None
    return values


Label = Annotated[str, AfterValidator(_label)]
Numbers = Annotated[list[Any], AfterValidator(_numbers)]
Vectors = Annotated[list[Any], AfterValidator(_rows_of(3))]
Quaternions = Annotated[list[Any], AfterValidator(_rows_of(4))]
Wrenches = Annotated[list[Any], AfterValidator(_rows_of(6))]


class _Shape(BaseModel):
    """Further fields are allowed; numbers that are not finite are null or infinite."""

    model_config = ConfigDict(strict=True)


def _sizes(options: dict[str, Any]) -> dict[str, Any]:
    """Return the options; raises ValueError for a step or tolerance that is no positive number."""
    for name in ("step", *TOLERANCES):
        if type(size := options.get(name, 1.0)) not in (int, float) or not 0.0 < size < math.inf:
            raise ValueError(f"{name}: must be a positive number")
    return options


class _Asked(_Shape):
    engine: str
    options: Annotated[dict[str, Any], AfterValidator(_sizes)]
    end: float | None = None
    samples: Annotated[int, Field(ge=0, le=MOST_SAMPLES)] | None = None
    times: list[float] | None = None


class Cost(_Shape):
    """Cost of a run, as tables read it: CPU time (s) and number of steps."""

    seconds: float
    steps: int


class _Crossing(_Shape):
    time: float
    taken: int
    sentence: str


class _Estimate(_Shape):
    largest: float | None


class _Body(_Shape):
    position: Vectors
    orientation: Quaternions
    velocity: Vectors | None = None
    angular_velocity: Vectors | None = None
    acceleration: Vectors | None = None
    angular_acceleration: Vectors | None = None


class _WholeCost(Cost):
    model_config = ConfigDict(strict=True, extra="forbid")
    build_seconds: float
    rejected: int = 0
    rhs: int = 0
    factorisations: int = 0
    newton: int = 0


class Ladder(_Shape):
    """Record of a run without its cost, as ladders of stability store it."""

    key: str
    scene: str
    engine: str
    family: str
    version: str | None
    outcome: Label
    message: str
    t_end: float
    time_limit: float
    asked: _Asked
    metrics: dict[str, float | None]
    versions: dict[str, str | None]
    commit: str | None = None
    date: str | None = None


class _Stored(_Shape):
    key: str
    scene: str
    engine: str
    version: str | None
    message: str


class Refused(_Stored):
    """Record of an engine that cannot run a scene, as tables of stored runs keep it."""

    outcome: Literal["REFUSED"]
    owner: str


class Measured(_Stored):
    """Record of a run without its motion, as tables of stored runs keep it."""

    family: str
    outcome: Label
    t_end: float
    asked: _Asked
    metrics: dict[str, float | None]
    cost: Cost


class Run(Ladder):
    """Record of a run (`study.grid.record_of`), as differences read it; its motion may be left out."""

    settings: dict[str, Any]
    cost: Cost
    machine: dict[str, Any]
    times: list[float]
    seed: int = 0
    mechanism: str | None = None
    bodies: dict[str, _Body] | None = None
    reactions: dict[str, Wrenches] | None = None
    open_reactions: dict[str, list[int]] | None = None
    angles: dict[str, Numbers] | None = None
    crossings: list[_Crossing] | None = None
    error_estimate: _Estimate | None = None

    @model_validator(mode="after")
    def _has_a_row_for_each_time(self) -> Run:
        parts = [self.reactions, self.open_reactions, self.angles]
        tables = {name: rows for part in parts for name, rows in (part or {}).items()}
        _compare(self.times, self.bodies or {}, tables)
        return self


class Picture(Run):
    """Record of a run for a picture: its motion may have no velocities, or may be left out."""

    method: str
    cost: _WholeCost


class WholeRun(Picture):
    """Record of a run as sections of a report read it; its motion may be left out."""

    @model_validator(mode="after")
    def _has_velocities(self) -> WholeRun:
        for name, body in (self.bodies or {}).items():
            if body.velocity is None or body.angular_velocity is None:
                raise ValueError(f"velocities of {name} are missing")
        return self


def _compare(times: list[float], bodies: dict[str, _Body], tables: dict[str, list[Any]]) -> None:
    """Raise ValueError unless states of bodies and tables have a row for each time."""
    states = {
        f"{name}.{key}": rows for name, body in bodies.items() for key, rows in body if rows is not None
    }
    given = states | tables
    if not any(map(len, given.values())):  # a committed record whose motion no page shows
        return
    for name, rows in given.items():
        if len(rows) != len(times):
            raise ValueError(f"rows of {name}: {len(rows)}, for {len(times)} times")


class _Motion(_Shape):
    times: list[float]
    bodies: dict[str, _Body]

    @model_validator(mode="after")
    def _has_a_row_for_each_time(self) -> _Motion:
        _compare(self.times, self.bodies, {})
        return self


class Truth(_Shape):
    """Record of a truth (`study.truths`)."""

    key: str
    scene: str
    kind: str
    bound: float | None
    reason: str
    until: float
    both: bool
    motion: _Motion | None
    given: float = 0.0
    seconds: float | None = None


class _Repeats(_Shape):
    median: float
    repeats: int


class Timing(_Shape):
    """Record of interleaved timings (`study.timings`)."""

    key: str
    seconds: float
    timing: _Repeats


class _Outcome(_Shape):
    property: str
    card: str
    scene: str
    status: Literal["pass", "fail", "cannot", "outside", "expected"]
    measured: float | None = None
    allowed: float | None = None
    reason: str = ""


class Verdicts(_Shape):
    """Document of `crosscheck verify --json`."""

    engine: str
    version: str | None = None
    family: str | None = None
    verdicts: list[_Outcome] = []
    violations: list[_Outcome] = []
    cards: dict[str, dict[str, Any]] = {}


class OfSeed(_Shape):
    """Record of the verdicts on the random mechanisms of a seed (`conformance.many_mechanisms`)."""

    key: str
    version: str
    verdicts: list[_Outcome]
    asked: list[str] = []


def checked(
    path: str | Path | None, records: Sequence[Record], shape: type[BaseModel] = Run
) -> Sequence[Record]:
    """Return the records of a file; raises RecordsError that names the file and the first faulty field."""
    for record in records:
        try:
            shape.model_validate(record)
        except ValidationError as error:
            fault = error.errors(include_url=False, include_input=False, include_context=False)[0]
            message = fault["msg"].removeprefix("Value error, ")
            field = ".".join(map(str, fault["loc"])) or "the record"
            name = record.get("key") or record.get("engine") if isinstance(record, dict) else None
            raise RecordsError(
                f"{path}: record {str(name)[:12]!r}: {field}: {message[:1].lower()}{message[1:]}; "
                "remove this line, or the file"
            ) from None
    return records
