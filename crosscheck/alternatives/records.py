"""Records of alternatives: how the ways of an engine end on a random mechanism, and how far they differ."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from crosscheck.conformance.agreeing import differences, off_from_gauss, runs_of, way_of
from crosscheck.conformance.mechanisms.large_graphs import MOST, large_graph
from crosscheck.conformance.runners import InProcess, Isolated, Runner
from crosscheck.conformance.trial import Broken
from crosscheck.engine import Alternatives, engine
from crosscheck.judge.connected_parts import factored, parts
from crosscheck.judge.constraints import initial_poses, jacobian
from crosscheck.processes.child import ChildFailed
from crosscheck.processes.pool import ask, end_idle
from crosscheck.refusals import shortened
from crosscheck.study import store
from crosscheck.study.provenance import made_by
from crosscheck.study.record_shape import Record
from crosscheck.study.store import in_digits
from mbref.motions.trajectory import Outcome
from mbref.records import rewrite
from mbref.scene import Scene

FILE = Path(__file__).parent / "records.jsonl.xz"
GRAPHS = 300
FEWEST, SHARED = 5, 60  # bodies of most mechanisms
EVERY = 10  # of so many mechanisms, one has more than SHARED bodies
TIME_LIMIT = 5.0  # s of CPU time of a way on a mechanism
DIGITS = 3  # of stored numbers
FAILED = 2  # smaller mechanisms out of time where a larger one is not run; one may be near a singularity
BATCH = 25  # mechanisms after which the file is written


def _pair(row: list[Any]) -> list[Any]:
    """Return the row if it has two ways, a size, a quantity and a body; raises ValueError for another one."""
    if len(row) != 5 or type(row[2]) is not float or {type(row[k]) for k in (0, 1, 3, 4)} != {str}:
        raise ValueError("must be two ways, a number, a quantity and a body")
    return row


class Group(BaseModel):
    """Ways that solve the same equations: the limit ``within`` which they agree, and by way how it ``ended``,
    CPU ``seconds``, and how far it is ``off`` from Gauss's principle at the start. ``pairs`` have the worst
    difference, its quantity and its body."""

    model_config = ConfigDict(strict=True)

    within: Annotated[float, Field(gt=0.0)]
    ended: dict[str, str]
    seconds: dict[str, float]
    off: dict[str, float]
    pairs: list[Annotated[list[Any], AfterValidator(_pair)]]

    @model_validator(mode="after")
    def _has_the_time_of_each_way(self) -> Group:
        if not self.ended.keys() <= self.seconds.keys():
            raise ValueError("seconds are required of each way")
        return self


class Shape(BaseModel):
    """Record of an engine on a mechanism."""

    model_config = ConfigDict(strict=True)

    key: str
    engine: str
    version: str
    seed: int
    scene: str
    bodies: int
    clearance: float
    redundant: int
    refused: str
    groups: list[Group]


def read(path: Path = FILE) -> list[Record]:
    """Return the stored records. Raises RecordsError."""
    return list(store.read(path, Shape).values())


def mechanism(number: int) -> Scene:
    """Return the random mechanism of a number: of 5 to 60 bodies, every tenth one of 61 to 200."""
    return large_graph(number, *((SHARED + 1, MOST) if number % EVERY == EVERY - 1 else (FEWEST, SHARED)))


def measure(
    engines: Sequence[str], path: Path = FILE, graphs: int = GRAPHS, report: Callable[[str], None] = print
) -> None:
    """Run the ways of engines on the mechanisms that the file lacks; ``report`` gets a line for each batch.

    Records of another version of an engine are replaced.
    """
    versions = {name: engine(name).version() for name in engines if engine(name).alternatives}
    known = {
        record["key"]: record
        for record in read(path)
        if versions.get(record["engine"], record["version"]) == record["version"]
    }
    for first, name in itertools.product(range(0, graphs, BATCH), versions):
        batch = range(first, min(first + BATCH, graphs))
        if missing := [number for number in batch if f"{name} {number}" not in known]:
            try:
                for number in missing:
                    known[f"{name} {number}"] = _record(name, number, known.values())
            finally:  # also of a batch that is interrupted
                rewrite(path, known.values())
            report(f"{name}: mechanisms {batch[0]} to {batch[-1]} of {graphs}")
    end_idle()


def _record(name: str, number: int, known: Collection[Record]) -> Record:
    scene, asked, origin = mechanism(number), engine(name), made_by()
    rows = jacobian(scene, 0.0, *initial_poses(scene))[0]
    held = [factored(rows[part.rows][:, part.columns]) for part in parts(rows)]
    own = [record for record in known if record["engine"] == name and record["bodies"] <= len(scene.body)]
    slow = [record["scene"] for record in own if _timed_out(record)][:FAILED]
    cannot = asked.cannot(scene)
    large = f"no way completes {' and '.join(slow)}, which are smaller" if len(slow) == FAILED else ""
    refused = cannot.reason if cannot else large
    return {
        "key": f"{name} {number}",
        "engine": name,
        "version": asked.version(),
        "seed": number,
        "scene": scene.name,
        "bodies": len(scene.body),
        "clearance": in_digits(float(min(factors.clearance for factors in held)), DIGITS),
        "redundant": len(rows) - sum(factors.rank for factors in held),
        "refused": refused,
        "groups": [] if refused else _groups(name, scene),
        **{part: origin[part] for part in ("commit", "date")},
    }


def _timed_out(record: Record) -> bool:
    """Return whether every way of an engine has run out of time on a mechanism."""
    ends = [end for group in record["groups"] for end in group["ended"].values()]
    return bool(ends) and all(end.startswith(Outcome.TIMED_OUT.label) for end in ends)


def _groups(name: str, scene: Scene) -> list[Record]:
    """Return the result of each group of ways, made in one child process; if that child ends, in a child for
    each way."""
    given = engine(name).alternatives
    limit = TIME_LIMIT + engine(name).compile_seconds
    try:
        return list(ask(name, groups_in_process, (scene,), limit * sum(len(each.ways) for each in given)))
    except ChildFailed:
        return [compared(Isolated(name, TIME_LIMIT), scene, each) for each in given]


def groups_in_process(name: str, scene: Scene) -> list[Record]:
    """Return the result of each group of ways of an engine, made in this process."""
    runner = InProcess(engine(name), name, TIME_LIMIT)
    return [compared(runner, scene, each) for each in runner.alternatives]


def compared(runner: Runner, scene: Scene, given: Alternatives) -> Record:
    """Return how the ways of a group ended, their CPU time (s), and the worst difference of each pair of
    completed ways."""
    runs, ways, ended = runs_of(runner, scene, given), {}, {}
    for name, run in runs.items():
        try:
            ways[name] = way_of(scene, run)
        except Broken as broken:
            ended[name] = shortened(f"{run.outcome.label}: {run.message or broken}")
    pairs = [max(differences(scene, ways, [pair])) for pair in itertools.combinations(ways, 2)]
    return {
        "within": given.within,
        "ended": {name: ended.get(name, "") for name in runs},
        "seconds": in_digits({name: run.cost.seconds for name, run in runs.items()}, DIGITS),
        "off": in_digits(off_from_gauss(scene, ways, 0), DIGITS),
        "pairs": [[*pair.ways, in_digits(pair.size, DIGITS), pair.quantity, pair.body] for pair in pairs],
    }
