"""The Engine interface, what an engine cannot do, and the table of engines."""

from __future__ import annotations

import enum
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module, metadata
from typing import Any

import numpy as np

from mbref.scene import Scene
from mbref.trajectory import Trajectory

FamilyParts = Mapping[str, Mapping[str, Mapping[str, float]]]  # kind of part → name → options and defaults


class Why(enum.Enum):
    """Why an engine lacks something: who could add it, if anyone."""

    UNBUILT = "not built here yet"
    UPSTREAM = "waits for the engine"
    NEVER = "the engine's model excludes it"


@dataclass(frozen=True)
class Cannot:
    """Something an engine cannot do with a scene, declared before any run."""

    why: Why
    reason: str

    def __str__(self) -> str:
        return f"{self.reason} ({self.why.value})"


@dataclass(frozen=True)
class Setting:
    """One way of running an engine.

    ``family`` groups the settings that differ only in accuracy: "defaults" are the library's own,
    "tuned" the most accurate that its documentation allows.  ``options`` are the engine's own numbers;
    (family, options) reproduce the run.
    """

    family: str
    options: Mapping[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        return self.family + "".join(f" {k}={v:g}" if isinstance(v, float) else f" {k}={v}"
                                     for k, v in self.options.items())  # fmt: skip


class Engine(ABC):
    """A simulator that takes a Scene and gives a Trajectory. Constructed without arguments.

    The third-party package is imported inside the methods, so that naming an engine loads nothing.
    """

    name: str
    package: str  # what to install when it is missing

    @abstractmethod
    def version(self) -> str:
        """Version of the engine; raises ImportError when its package is not installed."""

    @abstractmethod
    def cannot(self, scene: Scene) -> Cannot | None:
        """Why this scene cannot be run, or None."""

    @abstractmethod
    def settings(self, scene: Scene) -> Sequence[Setting]:
        """The sweep over this engine's families and accuracies for a scene, coarse to fine in each
        family."""

    def has_family(self, family: str) -> bool:
        """Whether `run` takes this family although the sweep of `settings` may leave it out."""
        return False

    def family_parts(self) -> FamilyParts:
        """The parts from which an engine's families are composed; empty where it only has its sweep's."""
        return {}

    def prepare(self, families: Sequence[str]) -> None:  # noqa: B027 - most engines need nothing
        """What a process does before its first run of these families, such as importing and compiling."""

    @abstractmethod
    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        """Simulate from t = 0 and sample at ``times`` (k,), increasing, the first may be 0.

        A failure of the engine is an Outcome of the trajectory, with the states reached before it.
        ``cost.seconds`` is the process CPU time of the stepping alone.
        """


BUILT_IN = ("mbref", "mujoco", "pinocchio", "exudyn")
OPTIONAL = ("simbody", "sundials", "ondsel")  # take part where their packages are installed
ENTRY_POINTS = "crosscheck.engines"


def engine_names() -> tuple[str, ...]:
    """Names of the built-in and optional engines and of those that installed packages offer."""
    return (*BUILT_IN, *OPTIONAL, *(point.name for point in metadata.entry_points(group=ENTRY_POINTS)))


def default_engines() -> tuple[str, ...]:
    """The engines that run when none is named: all but the optional ones that are not installed."""
    return tuple(name for name in engine_names() if name not in OPTIONAL or installed(name))


def installed(name: str) -> bool:
    """Whether the package of a known engine is installed."""
    try:
        engine(name).version()
    except ImportError:
        return False
    return True


def engine(name: str) -> Engine:
    """The engine of that name, or at ``module:attribute``; raises LookupError with the known names."""
    if name in BUILT_IN + OPTIONAL:
        return _as_engine(name, import_module(f"crosscheck.engines.{name}").ENGINE)
    for point in metadata.entry_points(group=ENTRY_POINTS):
        if point.name == name:
            return _as_engine(name, point.load())
    if ":" in name:
        module, attribute = name.split(":", 1)
        return _as_engine(name, getattr(import_module(module), attribute))
    raise LookupError(f"unknown engine {name!r}; known: {', '.join(engine_names())}")


def _as_engine(name: str, found: object) -> Engine:
    if isinstance(found, Engine):
        return found
    raise LookupError(f"{name!r} is no engine: it does not implement crosscheck.engine.Engine")
