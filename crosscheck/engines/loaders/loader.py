"""A loader: an engine's own reader of files, which reports the machine that it built."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

from crosscheck.engines.loaders.machine import Machine, Rows, Statics, Vector
from crosscheck.engines.loaders.posed import Pose

MJCF, URDF, SDF = "MJCF", "URDF", "SDF"
DOUBLE, SINGLE = 1e-6, 1e-4  # largest relative difference of numbers that agree, by the engine's precision
DURATION, STEPS = (
    0.1,
    (2e-3, 1e-3, 5e-4),
)  # s, of a compared motion and of its steps, each half of the last one


class Loaded(ABC):
    """A file in an engine. Poses are displacements (rad or m) of hinges and slides from the reference pose; a
    joint without entry stays there. A function that the engine lacks raises NotImplementedError, whose words
    say why."""

    @abstractmethod
    def machine(self) -> Machine:
        """Return the machine that the engine built."""

    @abstractmethod
    def statics(self, pose: Pose, gravity: Vector) -> Statics:
        """Return the engine's own mass matrix and gravity torques at a pose."""

    def rows(self, pose: Pose) -> Rows:
        """Return the engine's own Jacobian of loops and couplings at a pose that obeys them."""
        raise NotImplementedError

    def accelerations(self, pose: Pose, rates: Pose, gravity: Vector) -> dict[str, float]:
        """Return the engine's own accelerations of hinges and slides at a pose and rates, without motors,
        limits and dry friction."""
        raise NotImplementedError

    def motion(
        self, pose: Pose, rates: Pose, gravity: Vector, duration: float, step: float
    ) -> dict[str, float]:
        """Return the displacements of hinges and slides after the engine's simulation in steps (s), without
        motors, limits, dry friction and contacts."""
        raise NotImplementedError("the reader has no simulation of its own")


class Loader(ABC):
    """A reader of files of ``formats`` in ``package``; ``version`` is installed where the package is
    missing."""

    name: str
    package: str
    version: str
    formats: Sequence[str]
    tolerance: float = DOUBLE
    beside: Sequence[str] = ()  # further packages that it needs for some files, as pip's requirements
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
class Asked:
    """Poses for statics, poses that obey loops and couplings, states (pose and rates) for accelerations, the
    states from which to move for ``DURATION``, and gravity (3,)."""

    poses: Sequence[Pose]
    closed: Sequence[Pose]
    states: Sequence[tuple[Pose, Pose]]
    starts: Sequence[tuple[Pose, Pose]]
    gravity: Vector


@dataclass(frozen=True)
class Built:
    """Version of the package, the machine, and the engine's answers to each question.

    ``ends`` are displacements after a motion from each start, extrapolated to step zero from the two shortest
    steps, and from the two longest ones. ``faults`` is why a quantity is missing, by its name.
    """

    version: str
    machine: Machine
    statics: Sequence[Statics] = ()
    rows: Sequence[Rows] = ()
    accelerations: Sequence[Mapping[str, float]] = ()
    ends: Sequence[tuple[Mapping[str, float], Mapping[str, float]]] = ()
    faults: Mapping[str, str] = field(default_factory=dict)


def built(loader: Loader, path: Path, form: str, asked: Asked) -> Built:
    """Return the engine's reading of a file; raises whatever the engine raises while it reads."""
    loaded, faults = loader.load(path, form), dict[str, str]()
    machine, gravity = loaded.machine(), asked.gravity

    def answers(name: str, ask: Callable[..., Any], questions: Iterable[Sequence[Any]]) -> list[Any]:
        try:
            return [ask(*question) for question in questions]
        except NotImplementedError as reason:
            fault = str(reason)
        except Exception as error:  # an engine may raise anything about its own model
            fault = f"{type(error).__name__}: {error}"
        faults.update({name: fault} if fault else {})
        return []

    def ends(pose: Pose, rates: Pose) -> tuple[dict[str, float], dict[str, float]]:
        long, middle, short = (loaded.motion(pose, rates, gravity, DURATION, step) for step in STEPS)
        by_long, by_short = (  # errors are of order one
            {name: 2 * fine[name] - coarse[name] for name in fine}
            for coarse, fine in ((long, middle), (middle, short))
        )
        return by_short, by_long

    return Built(
        loader.installed(),
        machine,
        answers("mass matrix", loaded.statics, ((pose, gravity) for pose in asked.poses)),
        answers("rows of loops and couplings", loaded.rows, ((pose,) for pose in asked.closed)),
        answers("accelerations", loaded.accelerations, ((*state, gravity) for state in asked.states)),
        answers("motion", ends, asked.starts),
        faults,
    )
