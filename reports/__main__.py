"""`python -m reports`: run the study, or what is missing of it, and render the report."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from crosscheck.cli.request import RequestError, find_engines
from crosscheck.paper import runs
from crosscheck.study.fair_timing import gate_cases
from crosscheck.study.grid import Case, Record, known, study
from crosscheck.study.progress import shown
from reports import sweep
from reports.blocks import Block
from reports.runs import SceneRuns, by_scene
from reports.timings import with_timings

NEEDS = ("matplotlib", "jinja2")
PAPER = "paper"  # the section whose runs are its own


def main(argv: Sequence[str] | None = None) -> int:
    """Write the report; returns 0, or 2 when something is missing, or 130 when interrupted."""
    if missing := [package for package in NEEDS if find_spec(package) is None]:
        _notice(f"the report needs {' and '.join(missing)}: pip install 'mbref[report]'")
        return 2
    from reports.sections import NAMES

    arguments = _parser((*NAMES, PAPER)).parse_args(argv)
    names = arguments.section or (NAMES if arguments.quick else (*NAMES, PAPER))
    try:
        blocks = _blocks(Path(arguments.out), arguments.quick, names)
    except RequestError as error:
        _notice(str(error))
        return 2
    except KeyboardInterrupt:
        _notice(f"interrupted; what has been run is in {arguments.out}, the same command goes on from there")
        return 130
    _write(blocks, Path(arguments.out))
    return 0


def _blocks(out: Path, is_quick: bool, names: Sequence[str]) -> list[Block]:
    """What the named sections say; only the runs they need are made."""
    from reports import sections
    from reports.sections import paper

    out.mkdir(parents=True, exist_ok=True)
    blocks: list[Block] = []
    if set(names) - {PAPER}:
        blocks += sections.blocks(_collect(out, is_quick), names)
    if PAPER in names:
        records = _collect_paper(out)
        print(paper.score(records))
        blocks += paper.render(records)
    return blocks


def _collect_paper(out: Path) -> runs.Records:
    """The runs of the paper's tables and figures; raw records stay in ``out``/paper.jsonl."""
    path, cases = out / "paper.jsonl", runs.cases()
    with shown("the paper's runs", len(cases)) as progress:
        records = runs.run(path, cases, progress)
    more = runs.follow_ups(records)
    with shown("their errors", len(more)) as progress:
        records |= runs.run(path, more, progress)
    cases = runs.timed()
    single = runs.run(path, cases)
    timed = with_timings(list(cases.values()), list(single.values()), out / "paper-timings.jsonl", _notice)
    return records | dict(zip(cases, timed, strict=True))


def _collect(out: Path, is_quick: bool) -> list[SceneRuns]:
    """The runs of the study by scene; raw records stay in ``out``/records.jsonl."""
    engines = find_engines(None, _notice)
    _notice("planning the sweep")
    scenes, cases, unable = (sweep.quick if is_quick else sweep.whole)(engines)
    for pair in unable:
        _notice(f"{pair.engine} cannot run {pair.scene.name}: {pair.cannot}")
    (out / "scenes").mkdir(parents=True, exist_ok=True)
    for scene in scenes:
        scene.save(out / "scenes" / f"{scene.name}.toml")
    gates = [case for scene in scenes for case in gate_cases(scene, engines, sweep.QUICK_LIMIT)]
    records = _records([*cases, *gates], out / "records.jsonl")
    timed = with_timings(cases, records[: len(cases)], out / "timings.jsonl", _notice)
    return by_scene(timed, {scene.name: scene for scene in scenes}, records[len(cases) :])


def _records(cases: Sequence[Case], path: Path) -> list[Record]:
    _notice(f"{len(cases)} runs, of which {path} has {len(known(cases, path))}")
    with shown("running", len(cases)) as progress:
        return study(cases, records_path=path, progress=progress)


def _write(blocks: Sequence[Block], out: Path) -> None:
    from reports import render

    render.write(blocks, out)
    _notice(f"written: {out / 'index.html'} and {out / 'report.md'}")


def _parser(sections: Sequence[str]) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m reports",
        description="Run the study, or what is missing of it, and render the report.",
        epilog="example: python -m reports --quick --out report",
    )
    parser.add_argument("--quick", action="store_true", help="fewer scenes and settings, minutes")
    parser.add_argument("--section", action="append", choices=sections, help="only this one; may repeat")
    parser.add_argument("--out", default="report", metavar="DIR", help="folder to write (default: report)")
    return parser


def _notice(sentence: str) -> None:
    print(sentence, file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
