"""Other programs' files as scenes, and scenes as such files, by plug-ins of the group ``mbref.formats``."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path
from typing import Protocol

from mbref.scene import Scene

GROUP = "mbref.formats"


@dataclass(frozen=True)
class Imported:
    """A scene read from a file of another program.

    Attributes
    ----------
    scene : Scene
        The scene.
    left_out : tuple of str
        One sentence for each part of the file that the scene does not represent.
    """

    scene: Scene
    left_out: tuple[str, ...]


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

    def read(self, path: Path) -> Imported:
        """The scene of a file; raises SceneError where none can be made, OSError."""

    def write(self, scene: Scene) -> Exported:
        """The scene as text."""


def read(path: str | Path) -> Imported:
    """The scene of a file, by the format of its ending; raises ValueError, SceneError, OSError."""
    return _found(path, "reads").read(Path(path))


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
