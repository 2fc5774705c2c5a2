"""Records of engines' derivatives: the errors of each engine on each mechanism, and refusals, in one file."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from pydantic import BaseModel, ConfigDict

from crosscheck.derivatives import cards, compare
from crosscheck.derivatives.mechanisms import MECHANISMS, Mechanism
from crosscheck.differentiating import Differentiating
from crosscheck.engine import engine
from crosscheck.judge.state_derivatives import NotSmooth
from crosscheck.processes import pool
from crosscheck.processes.child import ChildFailed
from crosscheck.refusals import Cannot, Owner
from crosscheck.study import store
from crosscheck.study.provenance import made_by
from crosscheck.study.record_shape import Record
from crosscheck.study.store import in_digits
from mbref.records import rewrite
from mbref.scene import Scene

FILE = Path(__file__).parent / "records.jsonl.xz"
SECONDS = 600.0  # of CPU time of an engine on a mechanism, imports and compilation included
DIGITS = 2  # of stored errors


class Error(BaseModel):
    """The part of a ``compare.Row`` that is not of the whole record."""

    model_config = ConfigDict(strict=True)

    function: str
    state: str
    truth: str
    by: str
    error: float
    worst: str
    uncertain: float


class Shape(BaseModel):
    """Record of an engine on a mechanism: errors, or the reason why there are none, and its owner."""

    model_config = ConfigDict(strict=True)

    key: str
    engine: str
    version: str
    scene: str
    functions: dict[str, str]
    errors: list[Error]
    reason: str
    owner: str


def read(path: Path = FILE) -> list[Record]:
    """Return the stored records. Raises RecordsError."""
    return list(store.read(path, Shape).values())


def measure(
    engines: Iterable[str],
    path: Path = FILE,
    mechanisms: Sequence[Mechanism] = MECHANISMS,
    report: Callable[[str], None] = print,
) -> None:
    """Compare engines on mechanisms, and store each record, which replaces the record of the same
    engine and mechanism."""
    for name in engines:
        for mechanism in mechanisms:
            report(f"{name}: {mechanism.name}")
            made = record_of(name, mechanism.make(), mechanism.name)
            others = [record for record in read(path) if record["key"] != made["key"]]
            rewrite(path, [*others, made])


def record_of(name: str, scene: Scene, label: str) -> Record:
    """Return the record of an engine on a scene, which it runs in a child process."""
    asked, origin = engine(name), made_by()
    found, refused = compared(name, scene)
    return {
        "key": f"{name} {label}",
        "engine": name,
        "version": asked.version(),
        "scene": label,
        "functions": dict(asked.differentiates_by) if isinstance(asked, Differentiating) else {},
        "errors": [
            in_digits({part: getattr(row, part) for part in Error.model_fields}, DIGITS) for row in found
        ],
        "reason": refused.reason if refused else "",
        "owner": refused.owner.value if refused else "",
        **{part: origin[part] for part in ("commit", "date")},
    }


def compared(name: str, scene: Scene) -> tuple[list[compare.Row], Cannot | None]:
    """Return an engine's rows on a scene from a child process, or the reason why there are none."""
    try:
        found: tuple[list[compare.Row], Cannot | None] = pool.apart(_of_engine, (name, scene), SECONDS)
        return found
    except ChildFailed as failure:
        return [], Cannot(Owner.ENGINE, str(failure).partition("; last printed")[0])


def carded(name: str) -> list[cards.Verdict]:
    """Return the verdicts of all cards on an engine from a child process. Raises ChildFailed."""
    found: list[cards.Verdict] = pool.apart(_carded, (name,), SECONDS)
    return found


def _carded(name: str) -> list[cards.Verdict]:
    """Return the verdicts of all cards on an engine; called in a child."""
    return [*cards.verdicts(engine(name))]


def _of_engine(name: str, scene: Scene) -> tuple[list[compare.Row], Cannot | None]:
    """Return an engine's rows, or the reason why there are none; called in a child."""
    asked = engine(name)
    if (refused := compare.refusal(asked, scene)) is not None:
        return [], refused
    try:
        return [*compare.rows(asked, scene)], None
    except NotSmooth as why:
        return [], Cannot(Owner.MODEL, str(why))


def rows_of(record: Record) -> list[compare.Row]:
    """Return the rows that a record has."""
    known = (record["engine"], record["version"])
    return [compare.Row(*known, scene=record["scene"], **error) for error in record["errors"]]
