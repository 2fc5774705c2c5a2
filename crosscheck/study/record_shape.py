"""Shapes of stored records: fields and types that tables, reports and comparisons read."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationError

from mbref.motions.trajectory import Outcome
from mbref.records import RecordsError

Record = dict[str, Any]


def _label(text: str) -> str:
    if text not in Outcome.__members__:
        raise ValueError(f"must be one of {', '.join(Outcome.__members__)}")
    return text


Label = Annotated[str, AfterValidator(_label)]


class _Shape(BaseModel):
    """Further fields are allowed; numbers that are not finite are null or infinite."""

    model_config = ConfigDict(strict=True)


class _Asked(_Shape):
    engine: str
    options: dict[str, Any]
    end: float | None = None
    samples: int | None = None
    times: list[float] | None = None


class Cost(_Shape):
    """Cost of a run, as tables read it: CPU time (s) and number of steps."""

    seconds: float
    steps: int = 0


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


class Refused(_Shape):
    """Record of an engine that cannot run a scene, as tables of stored runs keep it."""

    key: str
    scene: str
    engine: str
    version: str | None
    outcome: str
    message: str


class Measured(Refused):
    """Record of a run without its motion, as tables of stored runs keep it."""

    family: str
    outcome: Label
    t_end: float
    asked: _Asked
    metrics: dict[str, float | None]
    cost: Cost


class Run(Ladder):
    """Record of a run (`study.grid.record_of`); its motion may be left out."""

    settings: dict[str, Any]
    cost: Cost
    machine: dict[str, Any]
    times: list[float]
    seed: int = 0
    mechanism: str | None = None
    bodies: dict[str, dict[str, list[Any] | None]] | None = None
    reactions: dict[str, list[Any]] | None = None
    open_reactions: dict[str, list[int]] | None = None
    crossings: list[dict[str, Any]] | None = None
    error_estimate: dict[str, Any] | None = None


class _Motion(_Shape):
    times: list[float]
    bodies: dict[str, dict[str, list[list[float]]]]


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
    status: str
    measured: float | None = None
    allowed: float | None = None


class Verdicts(_Shape):
    """Document of `crosscheck verify --json`."""

    engine: str
    version: str | None = None
    family: str | None = None
    verdicts: list[_Outcome] = []
    violations: list[_Outcome] = []
    cards: dict[str, dict[str, Any]] = {}


def checked(
    path: str | Path | None, records: Sequence[Record], shape: type[BaseModel] = Run
) -> Sequence[Record]:
    """Return the records of a file; raises RecordsError that names the file and the first faulty field."""
    for record in records:
        try:
            shape.model_validate(record)
        except ValidationError as error:
            fault = error.errors(include_url=False, include_input=False)[0]
            field = ".".join(map(str, fault["loc"])) or "the record"
            name = record.get("key") or record.get("engine") if isinstance(record, dict) else None
            raise RecordsError(
                f"{path}: record {str(name)[:12]!r}: {field}: {fault['msg'][:1].lower()}{fault['msg'][1:]}; "
                "remove this line, or the file"
            ) from None
    return records
