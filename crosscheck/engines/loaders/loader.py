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

    def accelerations(
        self, pose: Mapping[str, float], rates: Mapping[str, float], gravity: Vector
    ) -> dict[str, float]:
        """Return the engine's own accelerations of hinges and slides at a pose and rates, without motors,
        limits and dry friction. A reader without dynamics raises NotImplementedError."""
        raise NotImplementedError


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
    """Version of the package, the machine, statics and accelerations at each pose; ``fault`` is why they are
    missing."""

    version: str
    machine: Machine
    statics: tuple[Statics, ...]
    accelerations: tuple[dict[str, float], ...] = ()
    fault: str = ""


def built(
    loader: Loader,
    path: Path,
    form: str,
    poses: Sequence[Mapping[str, float]],
    rates: Sequence[Mapping[str, float]],
    gravity: Vector,
) -> Built:
    """Return the engine's reading of a file; raises whatever the engine raises while it reads."""
    loaded = loader.load(path, form)
    machine, fault = loaded.machine(), ""
    found, moved = list[Statics](), list[dict[str, float]]()
    try:
        found = [loaded.statics(pose, gravity) for pose in poses]
        moved = [loaded.accelerations(p, v, gravity) for p, v in zip(poses, rates, strict=False)]
    except NotImplementedError as reason:
        fault = str(reason)
    except Exception as error:  # an engine may raise anything about its own model
        fault = f"{type(error).__name__}: {error}"
    return Built(loader.installed(), machine, tuple(found), tuple(moved), fault)
