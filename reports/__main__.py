"""`python -m reports`: have crosscheck make the missing records, then render the report from them."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from crosscheck.cli import collection
from crosscheck.cli.passage import passage
from crosscheck.cli.request import RequestError
from reports.blocks import Block
from reports.runs import Run, by_scene

NEEDS = ("matplotlib", "jinja2")
PAPER = "paper"  # the section whose runs are its own


def main(argv: Sequence[str] | None = None) -> int:
    """Write the report; returns 0, or 2 when something is missing, or 130 when interrupted."""
    if missing := [package for package in NEEDS if find_spec(package) is None]:
        _notice(f"the report needs {' and '.join(missing)}: pip install 'mbref[report]'")
        return 2
    from reports.sections import NAMES

    arguments = _parser((*NAMES, PAPER)).parse_args(argv)
    if arguments.picture:
        return _picture(Path(arguments.picture))
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


def _picture(path: Path) -> int:
    """Write the README's moving picture."""
    from reports import animation

    found = passage()
    panels = [animation.panel(Run(record)) for record in found.records]
    path.write_text(animation.animated(found.scene, found.exact, panels, found.singular))
    _notice(f"written: {path}")
    return 0


def _blocks(out: Path, is_quick: bool, names: Sequence[str]) -> list[Block]:
    """The blocks of the named sections; only the records they need are made."""
    from reports import sections
    from reports.sections import paper

    blocks: list[Block] = []
    if set(names) - {PAPER}:
        scenes, records, gates = collection.comparison(out, is_quick, _notice)
        groups = by_scene(records, {scene.name: scene for scene in scenes}, gates)
        blocks += sections.blocks(groups, names)
    if PAPER in names:
        records_of_paper, illustration = collection.paper(out, _notice)
        print(paper.score(records_of_paper))
        blocks += paper.render(records_of_paper, illustration)
    return blocks


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
    parser.add_argument("--picture", metavar="FILE", help="write only the moving picture of the README")
    return parser


def _notice(sentence: str) -> None:
    print(sentence, file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
