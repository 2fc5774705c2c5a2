"""Import of scenes from files of other programs and export to them, by plug-ins of the entry-point group
``mbref.formats``."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, Protocol

from mbref import files
from mbref.command_line import each_once
from mbref.input_error import InputError
from mbref.scene import Scene, refuse_intervals, refuse_rolling

GROUP = "mbref.formats"
REMEDIES = {".xacro": "; write a URDF with `xacro FILE > robot.urdf`"}  # by endings that no format reads


def quiet(_: str) -> None:
    """Discard a sentence on long work."""


@dataclass(frozen=True)
class ImportOptions:
    """Options for reading a file.

    Attributes
    ----------
    without : collection of str
        Kinds of parts that may be left out although they change the motion, such as ``armature``.
    keyframe : str
        Name or number of the pose to begin at; the reference pose if empty.
    pose : mapping of str to float
        Joint coordinates to begin at (rad or m), by joint.
    close : sequence of str
        Pairs of frames that close a loop, such as ``frame_a=frame_b:revolute:y``.
    hold : sequence of str
        Bodies that hang on the world and lose their joints there, such as the trunk of a walking robot.
    say : callable
        Function that receives sentences on long work, such as closing loops; by default they are discarded.
    """

    without: Collection[str] = ()
    keyframe: str = ""
    pose: Mapping[str, float] = field(default_factory=dict)
    close: Sequence[str] = ()
    hold: Sequence[str] = ()
    say: Callable[[str], None] = field(default=quiet, compare=False, repr=False)

    def words(self) -> list[str]:
        """Return the words of a command line that give these options."""
        words = ["--without", ",".join(self.without)] if self.without else []
        words += ["--keyframe", self.keyframe] if self.keyframe else []
        for name, values in (
            ("--pose", [f"{joint}={value!r}" for joint, value in self.pose.items()]),
            ("--close", self.close),
            ("--hold", self.hold),
        ):
            words += [word for value in values for word in (name, value)]
        return words


def add_options(parser: Any) -> None:
    """Add the options for reading a file to a parser or a group of options."""
    parser.add_argument(
        "--without",
        metavar="KINDS",
        default="",
        help="kinds of parts that may be left out although they change the motion, separated by commas:\n"
        "armature, couplings, damping, flexible-bodies, fluid, friction, gravity-compensation,\n"
        "kinematic-links, limits, motors, sleep, springs, start, or everything;\n"
        "what a scene can describe stays",
    )
    parser.add_argument(
        "--keyframe",
        metavar="NAME",
        default="",
        help="begin at the pose of a keyframe, by its name or its number from 0 (MJCF)",
    )
    parser.add_argument(
        "--pose",
        metavar="JOINT=VALUE",
        action="append",
        type=_coordinate,
        default=[],
        help="begin with a joint coordinate (rad or m); may be given several times",
    )
    parser.add_argument(
        "--close",
        metavar="A=B[:TYPE[:AXIS]]",
        action="append",
        default=[],
        help="close a loop between two links, bodies, sites or joints: spherical (default), revolute,\n"
        "translational, cylindrical or fixed, about the axis x, y or z (default) of both frames;\n"
        "or a .yaml file with closed_loop: [[A, B], ...] and type: [3d, 6d, ...]; may be given several times",
    )
    parser.add_argument(
        "--hold",
        metavar="BODY",
        action="append",
        default=[],
        help="fix a body to the ground, such as the trunk of a walking robot; may be given several times",
    )


def import_options(arguments: argparse.Namespace) -> ImportOptions:
    """Return the options that a command line gives."""
    kinds = [word.strip() for word in arguments.without.split(",") if word.strip()]
    pose = each_once("--pose", arguments.pose)
    return ImportOptions(kinds, arguments.keyframe, pose, arguments.close, arguments.hold)


def _coordinate(text: str) -> tuple[str, float]:
    """Return the joint and the coordinate of ``joint=value``."""
    name, _, value = text.rpartition("=")
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not name or not math.isfinite(number):
        raise argparse.ArgumentTypeError(f"must be joint=value with a number, got {text!r}")
    return name, number


@dataclass(frozen=True)
class OriginalRun:
    """A run of the file's own model by the program that the file is written for.

    Attributes
    ----------
    engine, family : str
        The engine, and its family of settings that runs the file.
    options : mapping of str to Any
        Options of the setting, among them the file.
    """

    engine: str
    family: str
    options: Mapping[str, Any]


@dataclass(frozen=True)
class Imported:
    """A scene read from a file of another program.

    Attributes
    ----------
    scene : Scene
        The scene.
    left_out : tuple of str
        One sentence for each part of the file that the scene does not represent.
    notes : tuple of str
        One sentence for each decision made while the file was read, such as a loop that was closed.
    originals : tuple of OriginalRun
        Runs of the file's own model, the file's own settings first. Empty where no engine runs the file.
    """

    scene: Scene
    left_out: tuple[str, ...]
    notes: tuple[str, ...] = ()
    originals: tuple[OriginalRun, ...] = ()


@dataclass(frozen=True)
class Exported:
    """The text of a file for another program.

    Attributes
    ----------
    text : str
        The text.
    left_out : tuple of str
        One sentence for each part of the scene that the file does not represent.
    """

    text: str
    left_out: tuple[str, ...]


class Format(Protocol):
    """A file format; ``reads`` and ``writes`` are the suffixes of its file names."""

    reads: tuple[str, ...]
    writes: tuple[str, ...]

    def read(self, path: Path, options: ImportOptions) -> Imported:
        """Return the scene in a file; raises SceneError for a faulty file, InputError for a faulty option,
        OSError."""

    def write(self, scene: Scene) -> Exported:
        """Return the scene as the text of a file, with the features that the format lacks."""


def numbered(number: int, one: str, many: str) -> str:
    """Return a number with the word for one thing or for several, such as ``3 sensors``."""
    return f"{number} {one if number == 1 else many}"


def read(path: str | Path, options: ImportOptions | None = None) -> Imported:
    """Return the scene in a file, by the format of its suffix; raises the errors of ``Format.read``."""
    return _found(path, "reads").read(Path(path), options or ImportOptions())


def is_readable(path: str | Path) -> bool:
    """Return whether an installed format reads files of this suffix."""
    ending = Path(path).suffix
    return bool(ending) and any(ending in point.load().reads for point in entry_points(group=GROUP))


def write(scene: Scene, path: str | Path) -> tuple[str, ...]:
    """Write a scene in the format of the file suffix.

    Returns
    -------
    tuple of str
        One sentence for each part of the scene that the file does not represent.

    Raises
    ------
    InputError
        If no installed format has this suffix.
    SceneError
        If a joint or a coupling has intervals, or a wheel rolls without slip.
    """
    refuse_intervals(scene)
    refuse_rolling(scene, "exported files")
    from mbref.equations.offsets import assembled  # imported here: reading needs no equations

    exported = _found(path, "writes").write(assembled(scene))
    files.write(path, exported.text)
    return exported.left_out


def _found(path: str | Path, does: str) -> Format:
    """Return the format that reads or writes a path; raises InputError if no installed format does."""
    formats: list[Format] = [point.load() for point in entry_points(group=GROUP)]
    ending = Path(path).suffix
    for item in formats:
        if ending in getattr(item, does):
            return item
    known = ", ".join(sorted(end for item in formats for end in getattr(item, does))) or "none installed"
    what = f"no format {does} {ending or 'a name without an ending'}; known: {known}"
    raise InputError(f"{path}: {what}{REMEDIES.get(ending, '')}")
