"""mbref import and mbref export: other programs' files, such as MJCF and URDF."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mbref import formats
from mbref.cli.options import TEXT, add_scene
from mbref.scenes import find_scene


def add(commands: Any) -> None:
    """The commands' grammar."""
    take = commands.add_parser(
        "import", help="a scene file from MJCF or URDF", formatter_class=TEXT,
        description="Make a scene file from a MuJoCo model (.xml) or a URDF with loops (.urdf); lists\n"
        "everything that a scene cannot hold. Needs the extra engines.",
        epilog="example:\n  mbref import robot.xml --out robot.toml",
    )  # fmt: skip
    take.add_argument("file", metavar="FILE", help="the .xml or .urdf file")
    take.add_argument("--out", metavar="FILE", help="the scene file (default: the same name with .toml)")
    take.set_defaults(action=_import)

    give = commands.add_parser(
        "export", help="a scene as MJCF", formatter_class=TEXT,
        description="Write a scene as a MuJoCo model (.xml); lists everything that it cannot hold.\n"
        "Needs the extra engines.",
        epilog="example:\n  mbref export four_bar_gravity --out four_bar.xml",
    )  # fmt: skip
    add_scene(give)
    give.add_argument("--out", metavar="FILE", required=True, help="the .xml file")
    give.set_defaults(action=_export)


def _import(options: argparse.Namespace) -> int:
    out = Path(options.out or Path(options.file).with_suffix(".toml"))
    if out.suffix != ".toml":
        raise ValueError(f"--out: must end in .toml, got {str(out)!r}")
    found = formats.read(options.file)
    found.scene.save(out)
    return _told(out, found.left_out)


def _export(options: argparse.Namespace) -> int:
    return _told(Path(options.out), formats.write(find_scene(options.scene), options.out))


def _told(path: Path, left_out: Sequence[str]) -> int:
    print(path)
    for sentence in left_out:
        print(f"left out: {sentence}")
    return 0
