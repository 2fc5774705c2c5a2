"""Records of a report: runs of its scenes in the engines, and of the paper's tables and figures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from crosscheck.cli.request import RequestError, find_engines
from crosscheck.closed_loops.records import FILE as CLOSED_LOOPS
from crosscheck.paper import runs, store
from crosscheck.paper.illustration import Illustration, illustration
from crosscheck.study import stability
from crosscheck.study.comparison import Collection, Wanted, collected
from crosscheck.study.dead_positions import followed
from crosscheck.study.grid import Case, Record, shown_name
from crosscheck.study.progress import shown
from crosscheck.study.record_shape import Ladder, Timing
from crosscheck.study.record_view import with_time
from crosscheck.study.search import selection
from crosscheck.study.store import read, read_runs, unpacked
from crosscheck.study.timings import with_timings
from mbref.scene import Scene

TIMINGS, ILLUSTRATION = "paper-timings.jsonl", "paper-illustration.jsonl"
REPEATS = 3  # timed runs of each setting; the settings take turns
Notice = Callable[[str], None]  # takes one sentence for the user
RECORDS = ("records.jsonl", store.FILE, stability.FILE)  # a folder with one of them is of a report


class Paper(NamedTuple):
    """Records of the runs of the paper's tables and figures by label, and the ``Illustration`` of its Table
    I."""

    records: runs.Records
    illustration: Illustration


class Runs(NamedTuple):
    """Request of a report: scenes and engines (None: the default ones), depth, and CPU time (s) of a
    reference."""

    scenes: Sequence[Scene] | None
    engines: Sequence[str] | None
    is_quick: bool
    reference_time: float


def claim(out: Path, is_forced: bool) -> None:
    """Make the folder of a report, or continue one; raises RequestError for a folder with other files, unless
    the user forces it."""
    out.mkdir(parents=True, exist_ok=True)
    if is_forced or not any(out.iterdir()) or any((out / name).exists() for name in RECORDS):
        return
    raise RequestError(f"{out}: has files and no records of a report; name another folder, or add --force")


def comparison(out: Path, wanted: Runs, notice: Notice) -> Collection:
    """Return the records of a comparison, which are stored in the folder ``out``.

    Raises RequestError for an unknown engine, and if no named engine is installed.
    """
    scenes, engines, is_quick = wanted.scenes, find_engines(wanted.engines, notice), wanted.is_quick
    if scenes is None:
        scenes = selection.quick_scenes() if is_quick else selection.whole_scenes()
    samples = selection.QUICK_SAMPLES if is_quick else selection.SAMPLES
    given = [np.linspace(0.0, scene.duration, samples) for scene in scenes]
    there = [followed(*pair, wanted.reference_time) for pair in zip(scenes, given, strict=True)]
    chosen, times = [f.scene for f in there], [f.times for f in there]
    dead = [f.dead for f in there]

    def plan() -> list[Case]:
        cases, unable = (selection.quick if is_quick else selection.whole)(chosen, engines)
        for pair in unable:
            notice(f"{shown_name(pair.engine)} cannot run {pair.scene.name}: {pair.cannot}")
        if not cases:
            raise RequestError("no engine can run these scenes; see `crosscheck list support`")
        return cases

    return collected(
        chosen, engines, Wanted(times, wanted.reference_time, is_quick, out, dead=dead), plan, notice
    )


def closed_loops() -> list[Record]:
    """Return the stored records of engines on closed loops."""
    return read_runs(CLOSED_LOOPS)


def stability_ladders(out: Path, engines: Sequence[str] | None, notice: Notice) -> list[Record]:
    """Return the records of the stability ladders, which are stored in ``out``/stability.jsonl: of mbref's
    methods, and of the named engines (None: the default ones) that have a family for them."""
    return stability.run(out / stability.FILE, find_engines(engines, notice))


def stored_ladders(out: Path) -> list[Record]:
    """Return the records of the stability ladders that a folder stores, without any run.

    Raises FileNotFoundError if the folder has none.
    """
    with unpacked(out) as place:
        if not (place / stability.FILE).exists():
            raise FileNotFoundError(f"{out}: has no {stability.FILE} of a report")
        return list(read(place / stability.FILE, Ladder).values())


def paper(out: Path, is_whole: bool, notice: Notice) -> Paper:
    """Return the records of the paper's runs, stored in ``out``/paper*: runs of the paper's tables only, or
    of all studies."""
    path, timed = out / store.FILE, runs.timed()
    cases = runs.cases() | timed | (runs.studies() if is_whole else {})
    with shown("the paper's runs", len(cases)) as progress:
        records = store.run(path, cases, progress)
    more = runs.follow_ups(records)
    with shown("their errors", len(more)) as progress:
        records |= store.run(path, more, progress)
    single = [records[label] for label in timed]
    in_turns = with_timings(list(timed.values()), single, out / TIMINGS, notice, repeats=REPEATS)
    records |= dict(zip(timed, in_turns, strict=True))
    store.index(path, cases | more)
    return Paper(records, illustration(out / ILLUSTRATION))


def stored_paper(out: Path) -> Paper:
    """Return the records of the paper's runs that a folder stores, without any run.

    Raises FileNotFoundError if the folder has none.
    """
    with unpacked(out) as place:
        if not (place / store.INDEX).exists():
            raise FileNotFoundError(f"{out}: has no {store.INDEX} of a report")
        records, times = store.indexed(place), read(place / TIMINGS, Timing)
        timed = {label: with_time(record, times) for label, record in records.items()}
        return Paper(timed, illustration(place / ILLUSTRATION))
