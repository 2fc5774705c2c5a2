"""The records behind a comparison: runs are made where they are missing, and stored as they end."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np

from crosscheck.cli.request import RequestError, find_engines
from crosscheck.paper import runs
from crosscheck.paper.illustration import Illustration, illustration
from crosscheck.study import sweep
from crosscheck.study.fair_timing import identity_cases
from crosscheck.study.grid import Case, Record, known, study
from crosscheck.study.hurried import Hurried
from crosscheck.study.progress import counted, shown
from crosscheck.study.record_view import error, is_completed
from crosscheck.study.scouting import scout, unasked
from crosscheck.study.timings import REPEATS, with_timings
from crosscheck.study.truths import key as truth_key
from crosscheck.study.truths import truth_record
from mbref.records import append, stored
from mbref.scene import Scene

Notice = Callable[[str], None]  # takes one sentence for the user


class Collection(NamedTuple):
    """Records of a comparison: its scenes, its timed runs, the short runs that compare mechanisms, the truths
    (`study.truths`), and of each scene one run at the instants of its truth's motion that are shown."""

    scenes: Sequence[Scene]
    records: Sequence[Record]
    identities: Sequence[Record]
    truths: Sequence[Record]
    motions: Sequence[Record]


class Paper(NamedTuple):
    """Records of the paper's tables and figures by label, and what explains its Table I."""

    records: runs.Records
    illustration: Illustration


def scouted(scenes: Sequence[Scene], engines: Sequence[str]) -> None:
    """Find out the engines' settings for the scenes, with progress."""
    if total := unasked(engines, scenes):
        with counted("looking for settings", total) as advance:
            scout(engines, scenes, advance)


def measured(
    scenes: Sequence[Scene], cases: Sequence[Case], out: Path | None, long: float, notice: Notice,
    repeats: int = REPEATS,
) -> Collection:  # fmt: skip
    """The records of the cases and what belongs to them, stored in ``out`` where one is given.

    Completed runs of up to ``long`` s are timed in turns.  References are computed beside the runs.
    """
    if out is not None:
        _save(scenes, out / "scenes")
    engines = list(dict.fromkeys(case.engine for case in cases))
    limit = max(case.time_limit for case in cases)
    identities = [case for scene in scenes for case in identity_cases(scene, engines, limit)]
    with ThreadPoolExecutor(1) as aside:
        truths = aside.submit(_truths, scenes, cases, _file(out, "truths.jsonl"))
        records = _run([*cases, *identities], _file(out, "records.jsonl"), notice)
        found = truths.result()
    told, gates = records[: len(cases)], records[len(cases) :]
    motions = [] if out is None else _motions(scenes, cases, told, found, _file(out, "motions.jsonl"))
    timed = with_timings(cases, told, _file(out, "timings.jsonl"), notice, long, repeats)
    return Collection(scenes, timed, gates, found, motions)


def comparison(
    out: Path, scenes: Sequence[Scene] | None, is_quick: bool, reference_time: float, notice: Notice
) -> Collection:
    """The records of a comparison, stored in ``out``; without ``scenes`` on the built-in ones.

    Raises RequestError when no engine is installed.
    """
    engines = find_engines(None, notice)
    if scenes is None:
        scenes = sweep.quick_scenes() if is_quick else sweep.whole_scenes()
    scouted(scenes, engines)
    cases, unable = (sweep.quick if is_quick else sweep.whole)(scenes, engines)
    for pair in unable:
        notice(f"{pair.engine} cannot run {pair.scene.name}: {pair.cannot}")
    if not cases:
        raise RequestError("no engine can run these scenes")
    cases = [case._replace(reference_time=reference_time) for case in cases]
    return measured(scenes, cases, out, sweep.QUICK_LONG if is_quick else sweep.LONG, notice)


def paper(out: Path, notice: Notice) -> Paper:
    """The records of the paper's runs, stored in ``out``/paper*.jsonl."""
    out.mkdir(parents=True, exist_ok=True)
    path, cases = out / "paper.jsonl", runs.cases()
    with shown("the paper's runs", len(cases)) as progress:
        records = runs.run(path, cases, progress)
    more = runs.follow_ups(records)
    with shown("their errors", len(more)) as progress:
        records |= runs.run(path, more, progress)
    cases = runs.timed()
    single = runs.run(path, cases)
    timed = with_timings(list(cases.values()), list(single.values()), out / "paper-timings.jsonl", notice)
    records |= dict(zip(cases, timed, strict=True))
    return Paper(records, illustration(out / "paper-illustration.jsonl"))


def _file(out: Path | None, name: str) -> Path | None:
    return None if out is None else out / name


def _save(scenes: Sequence[Scene], folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for scene in scenes:
        scene.save(folder / f"{scene.name}.toml")


def _run(cases: Sequence[Case], path: Path | None, notice: Notice) -> list[Record]:
    """The records in the order of the cases; the runs of an engine follow each other, in one process."""
    if path is not None and (there := len(known(cases, path))):
        notice(f"{len(cases)} runs, of which {path} has {there}")
    engines = list(dict.fromkeys(case.engine for case in cases))
    order = sorted(range(len(cases)), key=lambda i: engines.index(cases[i].engine))
    with shown("running", len(cases)) as progress:
        found = study([cases[i] for i in order], None, path, progress, Hurried())
    by_place = dict(zip(order, found, strict=True))
    return [by_place[i] for i in range(len(cases))]


def _truths(scenes: Sequence[Scene], cases: Sequence[Case], path: Path | None) -> list[Record]:
    """The record of every scene's truth at the times of its runs."""
    done, found = stored(path), []
    for scene in scenes:
        times, given = next((c.times, c.reference_time) for c in cases if c.scene.name == scene.name)
        record = done.get(truth_key(scene, times))
        if record is None or record["given"] < given:
            record = truth_record(scene, times, given)
            append(path, record)
        found.append(record)
    return found


def _motions(
    scenes: Sequence[Scene], cases: Sequence[Case], records: Sequence[Record], truths: Sequence[Record],
    path: Path | None,
) -> list[Record]:  # fmt: skip
    """Of each scene with a truth the completed run of largest error, again at the instants shown."""
    chosen = []
    for scene, truth in zip(scenes, truths, strict=True):
        own = [i for i, r in enumerate(records) if r["scene"] == scene.name and is_completed(r)]
        if truth["motion"] and own:
            worst = cases[max(own, key=lambda i: error(records[i]))]
            chosen.append(worst._replace(times=np.array(truth["motion"]["times"])))
    return study(chosen, None, path)
