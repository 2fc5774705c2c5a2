"""`python -m reports`: make the missing records with crosscheck, then render the report from them."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from crosscheck.cli import collection
from crosscheck.cli.moving_picture import moving_picture
from crosscheck.cli.options import add_depth, add_engines, add_folder, add_reference_time
from crosscheck.cli.scene_request import RequestError, find_scenes
from mbref.command_line import INTERRUPTED, Parser, output_file, status_of
from mbref.files import write
from mbref.scene import Scene, intermittent

from .blocks import Block
from .runs import Run, SceneRuns, by_scene

# module → package to install
NEEDS = {"matplotlib": "matplotlib", "jinja2": "jinja2", "resvg_py": "resvg-py"}
PAPER, STABILITY, CLOSED_LOOPS = "paper", "stability", "closed_loops"
OF_ONE_SET = ("verdict", "mechanism", "violation", "energy", "accelerations", "reactions")
OWN = (STABILITY, CLOSED_LOOPS, PAPER)  # sections with runs of their own
TITLES: dict[tuple[str, ...], str] = {  # titles of pages of one section
    (PAPER,): "Stabilisation methods for redundant constraints",
    (STABILITY,): "Methods on mechanisms that become difficult",
    (CLOSED_LOOPS,): "Engines on closed loops, compared with the true motion",
}


def main(argv: Sequence[str] | None = None) -> int:
    """Write the report; returns 0, 2 for bad input or a missing package, or 130 after an interrupt."""
    return status_of(lambda: _report(argv), RequestError)


def _report(argv: Sequence[str] | None) -> int:
    if missing := [package for module, package in NEEDS.items() if find_spec(module) is None]:
        raise RequestError(f"the report needs {' and '.join(missing)}: pip install 'mbref[report]'")
    from .sections import NAMES

    arguments = _parser((*NAMES, *OWN)).parse_args(argv)
    if arguments.picture:
        return _picture(Path(arguments.picture))
    if arguments.render:
        return _render(Path(arguments.render), arguments.section or NAMES)
    is_quick, out = arguments.depth == "quick", Path(arguments.out)
    names = arguments.section or (NAMES if is_quick or arguments.scene else (*NAMES, *OWN))
    given = "scenes" if arguments.scene else "engines" if arguments.engine and names != [STABILITY] else ""
    if set(names) <= set(OWN) and given:
        raise RequestError(
            f"--section {names[0]}: has {given} of its own; leave them out, or ask for another section"
        )
    try:
        scenes = find_scenes(arguments.scene) if arguments.scene else None
        _refuse_intermittent(scenes or (), names)
        wanted = collection.Runs(scenes, arguments.engine, is_quick, arguments.reference_time)
        collection.claim(out, arguments.force)
        _write(_blocks(out, wanted, names), out, names)
    except KeyboardInterrupt:
        _notice(f"interrupted; the finished runs are in {arguments.out}, the same command resumes from there")
        return INTERRUPTED
    return 0


def _refuse_intermittent(scenes: Sequence[Scene], names: Sequence[str]) -> None:
    """Raise RequestError if a section needs one set of constraints and a scene has several."""
    several = [path for scene in scenes for path in intermittent(scene)]
    if several and (needing := [name for name in names if name in OF_ONE_SET]):
        raise RequestError(
            f"{several[0]}: no report's section {' or '.join(needing)} has joints that come and go, or end "
            "stops; choose others by --section, or use crosscheck compare"
        )


def _picture(path: Path) -> int:
    """Write the animated picture of the README."""
    from . import mechanisms

    found = moving_picture()
    runs = [Run(record) for record in found.records]
    write(path, mechanisms.compared(found.scene, found.exact, runs, found.singular))
    _notice(f"written: {path}")
    return 0


def _render(folder: Path, names: Sequence[str]) -> int:
    """Render the records of a folder again; nothing runs."""
    try:
        _write(_blocks(folder, None, names), folder, names)
    except FileNotFoundError as error:
        raise RequestError(str(error)) from None
    return 0


def _blocks(out: Path, wanted: collection.Runs | None, names: Sequence[str]) -> list[Block]:
    """Return the blocks of the named sections from a folder's records; with ``wanted`` missing records that
    they need are made before."""
    from . import sections, stored
    from .sections import closed_loops, paper, stability

    blocks: list[Block] = []
    if set(names) - set(OWN):
        groups = _compared(out, wanted) if wanted else stored.groups(out)
        blocks += sections.blocks(groups, names, stored.verified(out))
    if STABILITY in names:
        ladders = collection.stability_ladders
        runs = ladders(out, wanted.engines, _notice) if wanted else collection.stored_ladders(out)
        blocks += stability.render(runs)
    if CLOSED_LOOPS in names:
        blocks += closed_loops.render(collection.closed_loops())
    if PAPER in names:
        if wanted:
            print(paper.score(collection.paper(out, not wanted.is_quick, _notice).records))
        blocks += paper.render(*collection.stored_paper(out))
    return blocks


def _compared(out: Path, wanted: collection.Runs) -> list[SceneRuns]:
    """Return the runs of a comparison, of which missing records are made."""
    found = collection.comparison(out, wanted, _notice)
    named = {scene.name: scene for scene in found.scenes}
    return by_scene(found.records, named, found.identities, found.truths, found.motions, found.branches)


def _write(blocks: Sequence[Block], out: Path, names: Sequence[str]) -> None:
    from . import render

    render.write(blocks, out, TITLES.get(tuple(names), render.TITLE))
    _notice(f"written: {out / 'index.html'} and {out / 'report.md'}")


def _parser(sections: Sequence[str]) -> argparse.ArgumentParser:
    parser = Parser(
        prog="crosscheck report",
        description="Run the study, or what is missing of it, and render the report.",
        epilog="example: python -m reports --quick --out report",
    )
    parser.add_argument("scene", nargs="*", metavar="SCENE", help="default: built-in scenes")
    add_engines(parser)
    add_depth(parser)
    parser.add_argument("--quick", dest="depth", action="store_const", const="quick")
    add_reference_time(parser)
    parser.add_argument(
        "--section", action="append", choices=sections, metavar="S", help="only this one; may repeat"
    )
    add_folder(parser, "report")
    parser.add_argument(
        "--render", metavar="DIR", help="render the records of a report again, without any run"
    )
    parser.add_argument(
        "--picture", type=output_file, metavar="FILE", help="write only the animated picture of the README"
    )
    return parser


def _notice(sentence: str) -> None:
    print(sentence, file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
