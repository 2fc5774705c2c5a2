"""A loader: an engine's own reader of files, which reports the machine that it built."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from crosscheck.engines.loaders.machine import Machine, Statics, Vector

MJCF, URDF, SDF = "MJCF", "URDF", "SDF"
DOUBLE, SINGLE = 1e-6, 1e-4  # largest relative difference of numbers that agree, by the engine's precision


class Loaded(ABC):
    """A file in an engine."""

    @abstractmethod
    def machine(self) -> Machine:
        """Return the machine that the engine built."""

    @abstractmethod
    def statics(self, pose: Mapping[str, float], gravity: Vector) -> Statics:
        """Return the engine's own mass matrix and gravity torques at displacements (rad or m) of joints from
        the reference pose; a joint without entry stays there."""


class Loader(ABC):
    """A reader of files of ``formats`` in ``package``; ``version`` is installed where the package is
    missing."""

    name: str
    package: str
    version: str
    formats: Sequence[str]
    tolerance: float = DOUBLE
    convention: str = ""  # a choice that the format leaves open, in a sentence

    @abstractmethod
    def load(self, path: Path, form: str) -> Loaded:
        """Read a file; raises whatever the engine raises."""

    def installed(self) -> str:
        """Return the version of the installed package; empty if it is missing."""
        try:
            return metadata.version(self.package)
        except metadata.PackageNotFoundError:
            return ""


@dataclass(frozen=True)
class Built:
    """Version of the package, the machine, and statics at each pose; ``fault`` is why statics are missing."""

    version: str
    machine: Machine
    statics: tuple[Statics, ...]
    fault: str = ""


def built(
    loader: Loader, path: Path, form: str, poses: Sequence[Mapping[str, float]], gravity: Vector
) -> Built:
    """Return the engine's reading of a file; raises whatever the engine raises while it reads."""
    loaded = loader.load(path, form)
    machine, fault = loaded.machine(), ""
    found: list[Statics] = []
    try:
        found = [loaded.statics(pose, gravity) for pose in poses]
    except NotImplementedError as reason:
        fault = str(reason)
    except Exception as error:  # an engine may raise anything about its own model
        fault = f"{type(error).__name__}: {error}"
    return Built(loader.installed(), machine, tuple(found), fault)
