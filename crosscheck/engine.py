"""The Engine interface, the refusals of engines, and the table of engines.

An engine of a third party needs to import nothing but this module.
"""

from __future__ import annotations

import enum
import os
import sys
from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module, metadata
from typing import Any

import numpy as np

from crosscheck.judge.constraints import inertia_matrices, initial_poses, initial_twists
from mbref import rotations
from mbref.scene import GROUND, Scene
from mbref.scene_fields import meant
from mbref.trajectory import Cost, Outcome, Trajectory

__all__ = [
    "BUILT_IN", "ENTRY_POINTS", "GROUND", "ON_REQUEST", "OPTIONAL", "Cannot", "Cost", "Engine", "Outcome",
    "Owner", "Scene", "Setting", "Supports", "Trajectory", "default_engines", "engine", "engine_names",
    "inertia_matrices", "initial_poses", "initial_twists", "installed", "rotations",
]  # fmt: skip

BRANCHES = "branches"  # the option that chooses branches at singular positions, where an engine has one
BEST = "tuned"  # the family that is an engine's best, where it has one of that name
FamilyParts = Mapping[str, Mapping[str, Mapping[str, float]]]  # kind of part → name → options and defaults


class Owner(enum.Enum):
    """The part that would have to change before the engine could do what it refuses."""

    ADAPTER = "missing in the adapter"
    ENGINE = "missing in the engine"
    MODEL = "excluded by the engine's model"


@dataclass(frozen=True)
class Cannot:
    """A refusal, given before running: a sentence about the scene, and the part that is the cause."""

    owner: Owner
    reason: str

    def __str__(self) -> str:
        return f"{self.reason} ({self.owner.value})"


@dataclass(frozen=True)
class Supports:
    """The joint types, driven coordinates ("angle", "displacement") and load types that an adapter maps to
    its engine."""

    joints: Collection[str] = ()
    drivers: Collection[str] = ()
    loads: Collection[str] = ()

    def missing(self, scene: Scene) -> Cannot | None:
        """The refusal of the first joint, driver or load of a scene that is not declared, or None."""
        reasons = [
            f"joint {joint.name!r} is of type {joint.type!r}, which the adapter does not map"
            for joint in scene.joint
            if joint.type not in self.joints
        ]
        for driver in scene.driver:
            coordinate = scene.joint_named(driver.joint).facts.driven
            if coordinate not in self.drivers:
                reasons.append(f"the driver of joint {driver.joint!r} prescribes its {coordinate}, "
                               "which the adapter does not map")  # fmt: skip
        reasons += [
            f"load[{k}] is of type {load.type!r}, which the adapter does not map"
            for k, load in enumerate(scene.load)
            if load.type not in self.loads
        ]
        return Cannot(Owner.ADAPTER, reasons[0]) if reasons else None


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


def best_family(settings: Sequence[Setting]) -> list[Setting]:
    """Of settings, those of the family "tuned", else of the first family, coarse to fine."""
    families = [setting.family for setting in settings]
    best = BEST if BEST in families or not families else families[0]
    return [setting for setting in settings if setting.family == best]


class Engine(ABC):
    """A simulator that takes a Scene and gives a Trajectory. Constructed without arguments.

    The third-party package is imported inside the methods, so that naming an engine loads nothing.
    """

    name: str
    package: str  # to install when it is missing
    supports: Supports = Supports()  # everything else is refused
    rounding: float = 2.0**-52  # relative, of the numbers it computes with; 2**-23 in single precision
    families: Mapping[str, str] = {}  # family of settings → its description, for `crosscheck list settings`
    integrated_here: Collection[str] = ()  # families whose integrator, or extrapolation, is crosscheck's
    options: Mapping[str, str] = {}  # option of a setting → its description, with the unit

    @abstractmethod
    def version(self) -> str:
        """Version of the engine; raises ImportError when its package is not installed."""

    def cannot(self, scene: Scene) -> Cannot | None:
        """The refusal of a scene that cannot be run, or None: anything that ``supports`` does not declare,
        then what ``refuses`` says."""
        return self.supports.missing(scene) or self.refuses(scene)

    def refuses(self, scene: Scene) -> Cannot | None:
        """The refusal of a scene of declared joints, drivers and loads that still cannot be run, or None."""
        return None

    @abstractmethod
    def settings(self, scene: Scene) -> Sequence[Setting]:
        """The sweep over this engine's families and accuracies for a scene, coarse to fine in each
        family."""

    def settings_of(self, scene: Scene, family: str) -> Sequence[Setting]:
        """The sweep over the accuracies of one family, coarse to fine; none where it does not serve the
        scene."""
        return [setting for setting in self.settings(scene) if setting.family == family]

    def serves(self, scene: Scene, family: str) -> bool:
        """Whether the sweep of a scene has the family; here by making that sweep."""
        return bool(self.settings_of(scene, family))

    def best_settings(self, scene: Scene) -> Sequence[Setting]:
        """The sweep of the engine's best family, "tuned", or without that of its first."""
        return best_family(self.settings(scene))

    def has_family(self, family: str) -> bool:
        """Whether `run` takes this family although the sweep of `settings` may leave it out."""
        return False

    def family_parts(self) -> FamilyParts:
        """The parts from which an engine's families are composed; empty where it only has its sweep's."""
        return {}

    def prepare(self, families: Sequence[str]) -> None:  # noqa: B027 - most engines need nothing
        """Import and compile ahead of the first run of these families in a process."""

    @abstractmethod
    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        """Simulate from t = 0 and sample at ``times`` (k,), increasing, the first may be 0.

        A failure of the engine is an Outcome of the trajectory, with the states reached before it.
        ``cost.seconds`` is the process CPU time of the stepping alone.
        """


BUILT_IN = ("mbref", "mujoco", "pinocchio", "exudyn")
OPTIONAL = ("simbody", "sundials", "ondsel")  # take part where their packages are installed
ON_REQUEST = ("casadi", "heyoka")  # take part where they are named: each scene is compiled first
ENTRY_POINTS = "crosscheck.engines"


def engine_names() -> tuple[str, ...]:
    """Names of crosscheck's own engines and of those that installed packages offer."""
    return (
        *BUILT_IN,
        *OPTIONAL,
        *ON_REQUEST,
        *(point.name for point in metadata.entry_points(group=ENTRY_POINTS)),
    )


def default_engines() -> tuple[str, ...]:
    """The engines that run when none is named: all but those that run on request, and the optional ones that
    are not installed."""
    asked = (name for name in engine_names() if name not in ON_REQUEST)
    return tuple(name for name in asked if name not in OPTIONAL or installed(name))


def installed(name: str) -> bool:
    """Whether the package of a known engine is installed."""
    try:
        engine(name).version()
    except ImportError:
        return False
    return True


def engine(name: str) -> Engine:
    """The engine of that name, or at ``module:attribute`` of a module that can be imported or lies in the
    working directory; raises LookupError with the known names."""
    if name in BUILT_IN + OPTIONAL + ON_REQUEST:
        return _as_engine(name, import_module(f"crosscheck.engines.{name}").ENGINE)
    for point in metadata.entry_points(group=ENTRY_POINTS):
        if point.name == name:
            return _as_engine(name, point.load())
    if ":" in name:
        module, attribute = name.split(":", 1)
        if (here := os.getcwd()) not in sys.path:
            sys.path.append(here)
        return _as_engine(name, getattr(import_module(module), attribute))
    known = engine_names()
    raise LookupError(f"unknown engine {name!r}; known: {', '.join(known)}{meant(name, known)}")


def _as_engine(name: str, found: object) -> Engine:
    if isinstance(found, Engine):
        return found
    raise LookupError(f"{name!r} is no engine: it does not implement crosscheck.engine.Engine")
