"""mbref import and mbref export: other programs' files, such as MJCF and URDF."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mbref import formats
from mbref.cli.options import TEXT, add_scene
from mbref.scenes import find_scene


def add(commands: Any) -> None:
    """The commands' grammar."""
    take = commands.add_parser(
        "import",
        help="a scene file from MJCF or URDF",
        formatter_class=TEXT,
        description="Make a scene file from a MuJoCo model (.xml) or a URDF (.urdf). Open loops are closed\n"
        "by moving the joints. Mass matrix, bias forces and rows of loops are compared with MuJoCo's own\n"
        "at three poses. A part that changes the motion and that a scene does not have is an error, unless\n"
        "--without leaves it out; other parts are listed. Needs the extra engines.",
        epilog="examples:\n  mbref import robot.xml --out robot.toml\n"
        "  mbref import robot.xml --keyframe home --without armature,damping\n"
        "  mbref import legs.urdf --close foot_a=foot_b:revolute:y --pose knee=0.4",
    )
    take.add_argument("file", metavar="FILE", help="the .xml or .urdf file")
    take.add_argument("--out", metavar="FILE", help="the scene file (default: the same name with .toml)")
    take.add_argument(
        "--without",
        metavar="KINDS",
        default="",
        help="kinds of parts that may be left out although they change the motion, separated by commas:\n"
        "armature, couplings, damping, flexible-bodies, fluid, friction, gravity-compensation, motors,\n"
        "springs, or everything",
    )
    take.add_argument("--keyframe", metavar="NAME", default="", help="begin at the pose of a keyframe (MJCF)")
    take.add_argument(
        "--pose",
        metavar="JOINT=VALUE",
        action="append",
        default=[],
        help="begin with a joint coordinate (rad or m); may be given several times",
    )
    take.add_argument(
        "--close",
        metavar="A=B[:TYPE[:AXIS]]",
        action="append",
        default=[],
        help="close a loop between two links, bodies or sites: spherical (default), revolute,\n"
        "translational, cylindrical or fixed, about the axis x, y or z (default) of both frames;\n"
        "or a .yaml file with closed_loop: [[A, B], ...] and type: [3d, 6d, ...]; may be given several times",
    )
    take.set_defaults(action=_import)

    give = commands.add_parser(
        "export",
        help="a scene as MJCF",
        formatter_class=TEXT,
        description="Write a scene as a MuJoCo model (.xml); lists everything that it cannot hold.\n"
        "Needs the extra engines.",
        epilog="example:\n  mbref export four_bar_gravity --out four_bar.xml",
    )
    add_scene(give)
    give.add_argument("--out", metavar="FILE", required=True, help="the .xml file")
    give.set_defaults(action=_export)


def _import(options: argparse.Namespace) -> int:
    out = Path(options.out or Path(options.file).with_suffix(".toml"))
    if out.suffix != ".toml":
        raise ValueError(f"--out: must end in .toml, got {str(out)!r}")
    found = formats.read(options.file, _import_options(options))
    found.scene.save(out)
    status = _report(out, found.left_out)
    for sentence in found.notes:
        print(f"note: {sentence}")
    return status


def _import_options(options: argparse.Namespace) -> formats.ImportOptions:
    kinds = [word.strip() for word in options.without.split(",") if word.strip()]
    pose = dict(_coordinate(text) for text in options.pose)
    return formats.ImportOptions(kinds, options.keyframe, pose, options.close)


def _coordinate(text: str) -> tuple[str, float]:
    """A joint and its coordinate from ``joint=value``; raises ValueError."""
    name, _, value = text.rpartition("=")
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not name or not math.isfinite(number):
        raise ValueError(f"--pose: must be joint=value with a number, got {text!r}")
    return name, number


def _export(options: argparse.Namespace) -> int:
    return _report(Path(options.out), formats.write(find_scene(options.scene), options.out))


def _report(path: Path, left_out: Sequence[str]) -> int:
    print(path)
    for sentence in left_out:
        print(f"left out: {sentence}")
    return 0
