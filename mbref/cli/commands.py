"""Commands of mbref, their exit statuses and the printing of faults."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from mbref import __version__
from mbref.cli.diagnose import add as add_diagnose
from mbref.cli.ensemble import add as add_ensemble
from mbref.cli.exchange import add as add_exchange
from mbref.cli.pictures import add as add_pictures
from mbref.cli.plotting import add as add_plotting
from mbref.cli.run import add as add_run
from mbref.cli.scene_files import add as add_scene_files
from mbref.cli.sensitivities import add as add_sensitivities
from mbref.cli.statics import add as add_statics
from mbref.cli.synthesis import add as add_synthesis
from mbref.cli.tables import add as add_tables
from mbref.command_line import Parser, commands, status_of
from mbref.method import MethodError
from mbref.scene import SceneError
from mbref.scene.toml import with_lines

EPILOG = """\
first steps:
  mbref new my.toml             a commented scene to start from
  mbref draw my.toml            its picture, my.svg
  mbref diagnose my.toml        redundant constraints, degrees of freedom, singular positions
  mbref run my.toml             simulate it
  mbref animate my.toml         see it move

exit status: 0 done, 1 a run ended early, 2 bad input, 130 interrupted"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line and return the exit status: 0 if the run completed, 1 if the run ended early, 2 for
    faulty input, 130 after an interrupt."""
    return status_of(lambda: _command(arguments), MethodError)


def _command(arguments: Sequence[str] | None) -> int:
    options = parser().parse_args(arguments)
    try:
        return int(options.action(options))
    except SceneError as error:
        raise SceneError(_with_lines(options, error.faults)) from None


def _with_lines(options: argparse.Namespace, faults: Sequence[str]) -> Sequence[str]:
    """Return the faults with line numbers of the scene's file, including faults found during the
    simulation."""
    path = Path(getattr(options, "scene", ""))
    if path.suffix != ".toml" or not path.is_file():
        return faults
    return with_lines(path.read_text(encoding="utf-8-sig", errors="replace"), faults)


@cache
def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    whole = Parser(
        prog="mbref",
        epilog=EPILOG,
        description="Reference implementation of the constraint-handling methods of multibody dynamics.",
    )
    whole.add_argument(
        "--version",
        action=_Version,
        nargs=0,
        dest=argparse.SUPPRESS,
        help="show the versions of mbref and of the packages that it computes with",
    )
    known = commands(whole, title="commands", required=True, metavar="COMMAND")
    for add in (
        add_scene_files,
        add_pictures,
        add_diagnose,
        add_run,
        add_plotting,
        add_statics,
        add_sensitivities,
        add_synthesis,
        add_ensemble,
        add_exchange,
        add_tables,
    ):
        add(known)
    whole.set_defaults(grammar=parser)
    return whole


class _Version(argparse.Action):
    """Command-line action that prints the versions and exits. Versions are looked up only when they are
    printed."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        print(_versions())
        parser.exit()


def _versions() -> str:
    """Return the versions of this package and of the packages that influence its numbers."""
    from importlib.metadata import version

    others = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "numba"))
    return f"mbref {__version__} (Python {sys.version.split()[0]}, {others})"
