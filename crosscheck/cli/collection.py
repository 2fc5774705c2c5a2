"""The records of a report: of its scenes in the engines, and of the paper's tables and figures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from crosscheck.cli.request import RequestError, find_engines
from crosscheck.paper import runs
from crosscheck.paper.illustration import Illustration, illustration
from crosscheck.study import stability, sweep
from crosscheck.study.comparison import Collection, Wanted, collected
from crosscheck.study.grid import Case, Record
from crosscheck.study.progress import shown
from crosscheck.study.timings import with_timings
from mbref.scene import Scene

Notice = Callable[[str], None]  # takes one sentence for the user


class Paper(NamedTuple):
    """Records of the paper's tables and figures by label, and what explains its Table I."""

    records: runs.Records
    illustration: Illustration


def comparison(
    out: Path, scenes: Sequence[Scene] | None, is_quick: bool, reference_time: float, notice: Notice
) -> Collection:
    """The records of a comparison, stored in ``out``; without ``scenes`` on the built-in ones.

    Raises RequestError when no engine is installed.
    """
    engines = find_engines(None, notice)
    if scenes is None:
        scenes = sweep.quick_scenes() if is_quick else sweep.whole_scenes()
    samples = sweep.QUICK_SAMPLES if is_quick else sweep.SAMPLES
    times = [np.linspace(0.0, scene.duration, samples) for scene in scenes]
    chosen = list(scenes)

    def plan() -> list[Case]:
        cases, unable = (sweep.quick if is_quick else sweep.whole)(chosen, engines)
        for pair in unable:
            notice(f"{pair.engine} cannot run {pair.scene.name}: {pair.cannot}")
        if not cases:
            raise RequestError("no engine can run these scenes")
        return cases

    return collected(chosen, engines, Wanted(times, reference_time, is_quick, out), plan, notice)


def stability_ladders(out: Path, notice: Notice) -> list[Record]:
    """The records of the stability ladders, stored in ``out``/stability.jsonl."""
    out.mkdir(parents=True, exist_ok=True)
    return stability.run(out / "stability.jsonl", find_engines(None, notice))


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
