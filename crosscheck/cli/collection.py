"""The records behind a report: runs are made where they are missing, stored as they end, and given back."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from crosscheck.cli.request import find_engines
from crosscheck.paper import runs
from crosscheck.paper.illustration import Illustration, illustration
from crosscheck.study import sweep
from crosscheck.study.fair_timing import identity_cases
from crosscheck.study.grid import Case, Record, known, study
from crosscheck.study.progress import shown
from crosscheck.study.timings import with_timings
from mbref.scene import Scene

Notice = Callable[[str], None]  # takes one sentence for the user


class Collection(NamedTuple):
    """Records of a comparison: its scenes, its timed runs, and the short runs that compare mechanisms."""

    scenes: Sequence[Scene]
    records: Sequence[Record]
    identities: Sequence[Record]


class Paper(NamedTuple):
    """Records of the paper's tables and figures by label, and what explains its Table I."""

    records: runs.Records
    illustration: Illustration


def comparison(out: Path, is_quick: bool, notice: Notice) -> Collection:
    """The records of the comparison, stored in ``out``/records.jsonl, timings.jsonl and scenes/.

    Raises RequestError when no engine is installed.
    """
    engines = find_engines(None, notice)
    notice("planning the sweep")
    scenes, cases, unable = (sweep.quick if is_quick else sweep.whole)(engines)
    for pair in unable:
        notice(f"{pair.engine} cannot run {pair.scene.name}: {pair.cannot}")
    _save(scenes, out / "scenes")
    identities = [case for scene in scenes for case in identity_cases(scene, engines, sweep.QUICK_LIMIT)]
    records = _run([*cases, *identities], out / "records.jsonl", notice)
    timed = with_timings(cases, records[: len(cases)], out / "timings.jsonl", notice)
    return Collection(scenes, timed, records[len(cases) :])


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


def _save(scenes: Sequence[Scene], folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for scene in scenes:
        scene.save(folder / f"{scene.name}.toml")


def _run(cases: Sequence[Case], path: Path, notice: Notice) -> list[Record]:
    notice(f"{len(cases)} runs, of which {path} has {len(known(cases, path))}")
    with shown("running", len(cases)) as progress:
        return study(cases, records_path=path, progress=progress)
