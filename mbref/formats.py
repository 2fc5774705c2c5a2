"""Other programs' files as scenes, and scenes as such files, by plug-ins of the group ``mbref.formats``."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import entry_points
from pathlib import Path
from typing import Protocol

from mbref.scene import Scene

GROUP = "mbref.formats"


@dataclass(frozen=True)
class ImportOptions:
    """Options for reading a file.

    Attributes
    ----------
    without : collection of str
        Kinds of parts that may be left out although they change the motion, such as ``armature``.
    keyframe : str
        Name of the pose to begin at; the reference pose if empty.
    pose : mapping of str to float
        Joint coordinates to begin at (rad or m), by joint.
    close : sequence of str
        Pairs of frames that close a loop, such as ``frame_a=frame_b:revolute:y``.
    """

    without: Collection[str] = ()
    keyframe: str = ""
    pose: Mapping[str, float] = field(default_factory=dict)
    close: Sequence[str] = ()


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
    """

    scene: Scene
    left_out: tuple[str, ...]
    notes: tuple[str, ...] = ()


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
    """A kind of file; ``reads`` and ``writes`` are the endings of its names."""

    reads: tuple[str, ...]
    writes: tuple[str, ...]

    def read(self, path: Path, options: ImportOptions) -> Imported:
        """The scene of a file; raises SceneError, ValueError for an option, OSError."""

    def write(self, scene: Scene) -> Exported:
        """The scene as text."""


def read(path: str | Path, options: ImportOptions | None = None) -> Imported:
    """The scene of a file, by the format of its ending; raises ValueError, SceneError, OSError."""
    return _found(path, "reads").read(Path(path), options or ImportOptions())


def write(scene: Scene, path: str | Path) -> tuple[str, ...]:
    """Write a scene in the format of the file suffix.

    Returns
    -------
    tuple of str
        One sentence for each part of the scene that the file does not represent.

    Raises
    ------
    ValueError
        If no installed format has this suffix.
    """
    exported = _found(path, "writes").write(scene)
    Path(path).write_text(exported.text, encoding="utf-8")
    return exported.left_out


def _found(path: str | Path, does: str) -> Format:
    """The format that reads or writes a path; ValueError where no installed one does."""
    formats: list[Format] = [point.load() for point in entry_points(group=GROUP)]
    ending = Path(path).suffix
    for item in formats:
        if ending in getattr(item, does):
            return item
    known = ", ".join(sorted(end for item in formats for end in getattr(item, does))) or "none installed"
    raise ValueError(f"{path}: no format {does} {ending or 'a name without an ending'}; known: {known}")
