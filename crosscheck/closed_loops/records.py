"""Records of engines on closed loops: runs without their motions, and refusals, in one small file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from crosscheck.closed_loops.mechanisms import DIFFICULTIES, Difficulty
from crosscheck.study.grid import Case, Record, key, study
from crosscheck.study.search.offers import Unable, default_cases
from crosscheck.study.store import REFUSED, read_runs, refusal, short, short_key
from mbref.motions.trajectory import Outcome
from mbref.records import rewrite

FILE = Path(__file__).parent / "records.jsonl.xz"
SAMPLES = 21
TIME_LIMIT = 60.0  # s of CPU time of a run, so that all runs of the table take an hour


def cases(
    engines: Sequence[str],
    families: Sequence[str] | None,
    path: Path = FILE,
    columns: Sequence[Difficulty] = DIFFICULTIES,
) -> tuple[list[Case], list[Unable]]:
    """Return the finest setting of every family of the engines on each scene, and the refusals.

    A setting is left out that ran out of time by the file's records, or would by the CPU time of a run with a
    longer step, so that the next coarser one follows.
    """
    stored = read_runs(path)
    wanted: list[Case] = []
    unable: list[Unable] = []
    for column in columns:
        scene = column.make()
        times = np.linspace(0.0, column.end, SAMPLES)
        found, refused = default_cases(scene, engines, families, times)
        found = [case._replace(time_limit=TIME_LIMIT) for case in found]
        ended = [case for case in found if not any(_is_too_long(case, record) for record in stored)]
        wanted += {(case.engine, case.setting.family): case for case in ended}.values()  # the finest stays
        unable += refused
    return wanted, unable


def _is_too_long(case: Case, record: Record) -> bool:
    """Return whether a case ends after its time limit by the record of its run, or by the record of a run
    with a longer step: the CPU time is inversely proportional to the step."""
    if record["key"] == short_key(key(case)):
        return record["outcome"] == Outcome.TIMED_OUT.label
    names = (case.engine, case.scene.name, case.setting.family)
    is_other = names != (record["engine"], record["scene"], record.get("family"))
    if is_other or record["outcome"] != Outcome.COMPLETED.label:
        return False
    step, longer = case.setting.options.get("step", 0.0), record["asked"]["options"].get("step", 0.0)
    return 0.0 < step < longer and record["cost"]["seconds"] * longer / step > case.time_limit


def measure(
    wanted: Sequence[Case],
    unable: Sequence[Unable],
    path: Path = FILE,
    progress: Callable[[int, int, Record], None] | None = None,
) -> None:
    """Run the cases that the file lacks, and store each record as its run ends."""
    for found in unable:
        name = f"{found.engine} refuses {found.scene.name}"
        _store(refusal(name, found.scene.name, found.engine, found.cannot), path)
    known = {record["key"] for record in read_runs(path)}

    def store(done: int, total: int, record: Record) -> None:
        _store(short(record), path)
        if progress:
            progress(done, total, record)

    study([case for case in wanted if short_key(key(case)) not in known], progress=store)


def _store(record: Record, path: Path) -> None:
    """Add a record to the file in place of the records that it supersedes."""
    rewrite(path, [*(old for old in read_runs(path) if not supersedes(record, old)), record])


def supersedes(new: Record, old: Record) -> bool:
    """Return whether a record replaces another: an engine either refuses a scene or runs it, and only
    the last measured version of an engine counts."""
    if (new["engine"], new["scene"]) != (old["engine"], old["scene"]):
        return False
    is_refusal = REFUSED in (new["outcome"], old["outcome"])
    return is_refusal or new["version"] != old["version"] or new["key"] == old["key"]
