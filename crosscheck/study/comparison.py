"""Collection of the records of a comparison: missing runs are made while the truths are computed.

Every record is stored as its run ends.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import numpy as np

from crosscheck.judge.deadline import given_up
from crosscheck.processes.pool import end_idle
from crosscheck.study import pictures
from crosscheck.study.fair_timing import identity_cases
from crosscheck.study.grades import Grade, grade
from crosscheck.study.grid import Case, Record, key, known, record_of, study
from crosscheck.study.progress import counted, shown
from crosscheck.study.record_shape import Truth, checked
from crosscheck.study.search import selection
from crosscheck.study.search.execution import Chains, CoarseFirst
from crosscheck.study.search.neighbours import MOST_COARSER
from crosscheck.study.search.offers import default_cases, scout, unasked
from crosscheck.study.search.selection import Family, beyond, families, finest, first
from crosscheck.study.timings import REPEATS, with_timings
from crosscheck.study.truths import key as truth_key
from crosscheck.study.truths import truth_record
from crosscheck.study.words.speed import COMPILED
from mbref.files import file_name
from mbref.records import append, opened, stored
from mbref.scene import Scene

Notice = Callable[[str], None]  # a function that shows one sentence to the user
Truths = Future[list[Record]]
Made = tuple[Sequence[Family], dict[str, Record]]  # families, coarse to fine, and records by key


class Collection(NamedTuple):
    """Records of a comparison: scenes, timed runs, short runs that compare mechanisms, and truths
    (`study.truths`).

    `study.pictures` adds runs to be animated: for each scene the run of largest error, and runs along the
    branches of its singular positions.
    """

    scenes: Sequence[Scene]
    records: Sequence[Record]
    identities: Sequence[Record]
    truths: Sequence[Record]
    motions: Sequence[Record]
    branches: Sequence[Record]


class Wanted(NamedTuple):
    """Request of a comparison: sample times (k,) of every scene, CPU seconds for a reference, and the folder
    for records.

    Further fields choose few settings (`study.search.selection`), the timing of short runs only, and whether
    the user named families. Named families that cannot run a scene are not replaced by other families.
    ``dead`` has the time (s) of a dead position (`study.dead_positions`) of each scene, or None.
    """

    times: Sequence[np.ndarray]
    reference_time: float
    is_quick: bool
    out: Path | None = None
    repeats: int = REPEATS
    is_named: bool = False
    dead: Sequence[float | None] = ()


def collected(
    scenes: Sequence[Scene],
    engines: Sequence[str],
    wanted: Wanted,
    plan: Callable[[], Sequence[Case]],
    notice: Notice,
) -> Collection:
    """Return the records of the cases that ``plan`` chooses after the engines' settings are known, with all
    further records of the comparison.

    The truths are computed in parallel with the runs.
    """
    if wanted.out is not None:
        wanted.out.mkdir(parents=True, exist_ok=True)
        opened(wanted.out / "records.jsonl")  # marks the folder as one of records
        _save(scenes, wanted.out / "scenes")
    with ExitStack() as stack:
        stack.callback(end_idle)
        truths = stack.enter_context(ThreadPoolExecutor(1)).submit(_truths, scenes, wanted)
        try:
            scouted(scenes, engines)
            return _measured(scenes, plan(), wanted, truths, notice)
        except BaseException:
            with given_up():
                wait([truths])
            raise


def scouted(scenes: Sequence[Scene], engines: Sequence[str]) -> None:
    """Find out the engines' settings for the scenes, with a progress bar."""
    if total := unasked(engines, scenes):
        with counted("looking for settings", total) as advance:
            scout(engines, scenes, advance)


def _measured(
    scenes: Sequence[Scene], cases: Sequence[Case], wanted: Wanted, truths: Truths, notice: Notice
) -> Collection:
    cases = [case._replace(reference_time=wanted.reference_time) for case in cases]
    limit = max(case.time_limit for case in cases)
    gates = [case for scene in scenes for case in identity_cases(scene, _engines(cases), limit)]
    path = _file(wanted, "records.jsonl")
    if path is not None and (there := len(known(cases, path))):
        notice(f"{path} already has {there} of the runs")
    groups, by_key = (_few if wanted.is_quick else _all)(families(cases), gates, path)
    if wanted.is_quick and not wanted.is_named:
        others, more = _few(_other_families(groups, by_key), [], path)
        groups, by_key = [*groups, *others], by_key | more
    run = [case for group in groups for case in group if key(case) in by_key]
    reported, found = [by_key[key(case)] for case in run], truths.result()
    moving = _pictures(list(zip(run, reported, strict=True)), found, wanted.out)
    long = selection.QUICK_LONG if wanted.is_quick else selection.LONG
    timed = with_timings(run, reported, _file(wanted, "timings.jsonl"), notice, long, wanted.repeats)
    return Collection(scenes, timed, [by_key[key(gate)] for gate in gates], found, *moving)


def _other_families(groups: Sequence[Family], records: Mapping[str, Record]) -> list[Family]:
    """Return cases of further families for engines without a right run on a scene, or without a completed run
    if the motion is unknown.

    After these runs it is known whether the engine completes no run or is inaccurate.
    """
    found: list[Family] = []
    by_pair: dict[tuple[str, str], list[Family]] = {}
    for group in groups:
        by_pair.setdefault((group[0].scene.name, group[0].engine), []).append(group)
    for run in by_pair.values():
        case = run[0][0]
        grades = {grade(records[key(c)]) for group in run for c in group if key(c) in records}
        if grades & {Grade.RIGHT, Grade.UNJUDGED}:
            continue
        cases, _ = default_cases(case.scene, [case.engine], None, case.times, case.time_limit)
        there = {group[0].setting.family for group in run}
        found += [
            [c._replace(reference_time=case.reference_time) for c in group]
            for group in families(cases)
            if group[0].setting.family not in there
        ]
    return found


def _few(groups: Sequence[Family], gates: Sequence[Case], path: Path | None) -> Made:
    """Run the coarsest and the middle setting of each family, then useful coarser settings and the finest
    affordable one."""
    begun = _made("running", [*(case for group in groups for case in first(group)), *gates], path)
    fine = [case for group in groups for case in finest(group, begun)]
    return _with_coarser(groups, begun | _made("running at finer settings", fine, path), path)


def _all(groups: Sequence[Family], gates: Sequence[Case], path: Path | None) -> Made:
    """Run every setting of every family, and useful coarser settings."""
    cases = [case for group in groups for case in group]
    return _with_coarser(groups, _made("running", [*cases, *gates], path), path)


def _with_coarser(groups: Sequence[Family], records: dict[str, Record], path: Path | None) -> Made:
    """Extend each family to the coarsest setting that reaches the first error level.

    Without coarser settings a family whose sweep begins too fine would seem too expensive.
    """
    for _ in range(MOST_COARSER):
        added = [beyond(group, records) for group in groups]
        if not any(added):
            break
        groups = [[*coarse, *group] for coarse, group in zip(added, groups, strict=True)]
        records = records | _made("running at coarser settings", [c for more in added for c in more], path)
    return groups, records


def _made(what: str, cases: Sequence[Case], path: Path | None) -> dict[str, Record]:
    """Return records by key."""
    if not cases:
        return {}
    order = _long_first(cases)
    with shown(what, len(order)) as progress, Chains(record_of) as threads:
        found = study(order, threads, path, progress, CoarseFirst().trajectory)
    return {record["key"]: record for record in found}


def _long_first(cases: Sequence[Case]) -> list[Case]:
    """Return the cases by engines: the first engine and engines with compiled families, which may have to
    compile, then the other engines, of which the last ones take longest."""
    engines = _engines(cases)
    compiled = {case.engine for case in cases if case.setting.family.endswith(COMPILED)}
    before = [name for name in engines if name in {engines[0], *compiled}]
    after = [name for name in reversed(engines) if name not in before]
    return [case for name in (*before, *after) for case in cases if case.engine == name]


def _engines(cases: Sequence[Case]) -> list[str]:
    return list(dict.fromkeys(case.engine for case in cases))


def _truths(scenes: Sequence[Scene], wanted: Wanted) -> list[Record]:
    """Return the record of every scene's truth at the sample times of its runs."""
    path = _file(wanted, "truths.jsonl")
    done, found = stored(path), list[Record]()
    checked(path, list(done.values()), Truth)
    for scene, times, dead in zip(scenes, wanted.times, wanted.dead or [None] * len(scenes), strict=True):
        record = done.get(truth_key(scene, times))
        if record is None or record["given"] < wanted.reference_time:
            record = truth_record(scene, times, wanted.reference_time, dead)
            append(path, record)
        found.append(record)
    return found


def _pictures(
    runs: Sequence[pictures.Run], truths: Sequence[Record], out: Path | None
) -> tuple[list[Record], list[Record]]:
    """Return the runs to be animated; none if no report is made."""
    if out is None:
        return [], []
    worst = pictures.worst_runs(runs, truths, out / "motions.jsonl")
    return worst, pictures.branches(runs, out / "branches.jsonl")


def _file(wanted: Wanted, name: str) -> Path | None:
    return None if wanted.out is None else wanted.out / name


def _save(scenes: Sequence[Scene], folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for scene in scenes:
        scene.save(folder / f"{file_name(scene.name)}.toml")
