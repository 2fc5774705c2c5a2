"""mbref import and mbref export: files of other programs, such as MJCF and URDF."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from mbref import formats
from mbref.cli.request import add_scene
from mbref.command_line import add_output
from mbref.files import free
from mbref.input_error import InputError
from mbref.printable import shortened
from mbref.scenes import find_scene


def add(commands: Any) -> None:
    """Add the parsers of both commands."""
    take = commands.add_parser(
        "import",
        action=_import,
        help="a scene file from MJCF, URDF or SDF",
        description="Make a scene file from a MuJoCo model (.xml), a URDF or an SDF (.sdf). Open loops of\n"
        "MJCF and URDF are closed by moving the joints; mass matrix, bias forces and rows of loops are\n"
        "compared with MuJoCo's own at three poses. Joints of an SDF may close loops themselves. A part\n"
        "that changes the motion and that a scene does not have is an error, unless --without leaves it\n"
        "out; other parts are listed. MJCF and URDF need the extra engines.",
        epilog="examples:\n  mbref import robot.xml --out robot.toml\n"
        "  mbref import robot.xml --keyframe home --without armature,damping\n"
        "  mbref import legs.urdf --close foot_a=foot_b:revolute:y --pose knee=0.4",
    )
    take.add_argument("file", metavar="FILE", help="the .xml, .urdf or .sdf file")
    add_output(take, "--out", metavar="FILE", help="the scene file (default: the same name with .toml)")
    formats.add_options(take)

    give = commands.add_parser(
        "export",
        action=_export,
        help="a scene as MJCF",
        description="Write a scene as a MuJoCo model (.xml); lists everything that MJCF cannot describe.\n"
        "Needs the extra engines.",
        epilog="example:\n  mbref export four_bar_gravity --out four_bar.xml",
    )
    add_scene(give)
    add_output(give, "--out", metavar="FILE", required=True, help="the .xml file")


def _import(options: argparse.Namespace) -> int:
    if not Path(options.file).name:
        raise InputError(f"FILE: must be a file, got {options.file!r}")
    out = free(options.out or Path(options.file).with_suffix(".toml"), options.force)
    if out.suffix != ".toml":
        raise InputError(f"--out: must end in .toml, got {str(out)!r}")
    asked = replace(formats.import_options(options), say=lambda text: print(text, file=sys.stderr))
    found = formats.read(options.file, asked)
    found.scene.save(out)
    status = _report(out, found.left_out)
    for sentence in found.notes:
        print(shortened(f"note: {sentence}"))
    return status


def _export(options: argparse.Namespace) -> int:
    return _report(Path(options.out), formats.write(find_scene(options.scene), options.out))


def _report(path: Path, left_out: Sequence[str]) -> int:
    print(path)
    for sentence in left_out:
        print(shortened(f"left out: {sentence}"))
    return 0
