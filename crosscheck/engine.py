"""The interface ``Engine`` of every engine adapter, and the table of the known engines. An adapter in another
package needs to import this module only."""

from __future__ import annotations

import os
import sys
from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from functools import lru_cache
from importlib import import_module, metadata

import numpy as np

from crosscheck.judge.constraints import inertia_matrices, initial_poses, initial_twists
from crosscheck.refusals import Cannot, Owner, Supports, within_tables
from crosscheck.setting import Alternatives, FamilyParts, Setting, best_family
from mbref import rotations
from mbref.motions.trajectory import Cost, Outcome, Trajectory
from mbref.scene import GROUND, Scene
from mbref.scene.fields import meant

__all__ = [
    "ALL",
    "BUILT_IN",
    "ENTRY_POINTS",
    "GENERATORS",
    "GROUND",
    "LARGE",
    "ON_REQUEST",
    "OPTIONAL",
    "Alternatives",
    "Cannot",
    "Cost",
    "Engine",
    "Outcome",
    "Owner",
    "Scene",
    "Setting",
    "Supports",
    "Trajectory",
    "all_engines",
    "default_engines",
    "engine",
    "engine_names",
    "inertia_matrices",
    "initial_poses",
    "initial_twists",
    "installed",
    "rotations",
]


class Engine(ABC):
    """Interface of an engine adapter, which simulates a Scene and returns a Trajectory.

    The constructor takes no arguments. Only methods import the engine's package.

    Attributes
    ----------
    name, package : str
        Name of the engine, and the package to install when it is missing.
    modules : collection of str
        Modules of the package that `prepare` imports before the first run.
    supports : Supports
        Joint types, drivers and loads that the adapter maps. Everything else is refused.
    rounding : float
        Relative rounding of the engine's numbers: 2**-52, or 2**-23 in single precision.
    families, options : mapping of str to str
        Families of settings, and options of a setting with units, each with a description.
    integrated_here : collection of str
        Families whose integrator or extrapolation belongs to crosscheck.
    with_default : collection of str
        Options that a setting may leave out.
    defaults_of : collection of str
        Places of default values in the library, which `crosscheck versions` compares: an object or a part of
        it, such as ``mujoco.MjSpec().option``, or a function with a signature, such as ``module.function``.
    alternatives : sequence of Alternatives
        Ways to solve the same equations, which must agree: linear solvers, sparse and dense matrices, warm
        starts, threads. `settings` need not list their families.
    compile_seconds : float
        CPU time, s, by which the time limit of a run is extended, for an engine that compiles code for each
        model within its runs.
    """

    name: str
    package: str
    modules: Collection[str] = ()
    supports: Supports = Supports()
    rounding: float = 2.0**-52
    families: Mapping[str, str] = {}
    integrated_here: Collection[str] = ()
    options: Mapping[str, str] = {}
    with_default: Collection[str] = ()
    defaults_of: Collection[str] = ()
    alternatives: Sequence[Alternatives] = ()
    compile_seconds: float = 0.0

    def __init_subclass__(cls) -> None:
        if "run" in vars(cls):
            cls.run = within_tables(cls.run)  # type: ignore[method-assign]

    def version(self) -> str:
        """Return the version of the engine, of ``package`` by default; raises ImportError if missing."""
        return metadata.version(self.package)

    def cannot(self, scene: Scene) -> Cannot | None:
        """Return the refusal of a scene: first by ``supports``, then by ``refuses``.

        Parameters
        ----------
        scene : Scene
        """
        return self.supports.missing(scene) or self.refuses(scene)

    def refuses(self, scene: Scene) -> Cannot | None:
        """Return a refusal beyond the declared joints, drivers and loads.

        Parameters
        ----------
        scene : Scene
            The mechanism to simulate.
        """
        return None

    @abstractmethod
    def settings(self, scene: Scene) -> Sequence[Setting]:
        """Return the settings of all families for a scene.

        Parameters
        ----------
        scene : Scene
            A mechanism that the engine does not refuse.

        Returns
        -------
        sequence of Setting
            Coarse to fine in each family.
        """

    def settings_of(self, scene: Scene, family: str) -> Sequence[Setting]:
        """Return the settings of one family for a scene.

        Parameters
        ----------
        scene : Scene
            The mechanism to simulate.
        family : str
            Name of a family; an unknown one has no settings.

        Returns
        -------
        sequence of Setting
            Coarse to fine; empty if the family cannot run the scene.
        """
        return [setting for setting in self.settings(scene) if setting.family == family]

    def serves(self, scene: Scene, family: str) -> bool:
        """Return whether a family has settings for a scene.

        Parameters
        ----------
        scene : Scene
            The mechanism to simulate.
        family : str
            Name of a family.
        """
        return bool(self.settings_of(scene, family))

    def best_settings(self, scene: Scene) -> Sequence[Setting]:
        """Return the settings of the family "tuned", or of the first family.

        Parameters
        ----------
        scene : Scene

        Returns
        -------
        sequence of Setting
            Coarse to fine.
        """
        return best_family(self.settings(scene))

    def has_family(self, family: str) -> bool:
        """Return whether `run` accepts a family, which `settings` need not list.

        Parameters
        ----------
        family : str
        """
        return False

    def family_parts(self) -> FamilyParts:
        """Return the parts of which names of families are composed, such as integrators.

        Returns
        -------
        mapping
            Kind of part → name → options with their defaults. Empty if names are not composed of parts.
        """
        return {}

    def own_code(self, scene: Scene, setting: Setting) -> str:
        """Return the line of the engine's own code or XML that makes a setting.

        Parameters
        ----------
        scene : Scene
        setting : Setting

        Returns
        -------
        str
            Empty if no such line is known.
        """
        return ""

    def prepare(self, families: Sequence[str]) -> None:
        """Import ``modules``; or import and compile what the families need, before a process's first run.

        Parameters
        ----------
        families : sequence of str
        """
        for module in self.modules:
            import_module(module)

    @abstractmethod
    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        """Simulate a scene from t = 0 and return the states at the sample times.

        Parameters
        ----------
        scene : Scene
        times : ndarray, shape (k,)
            Increasing sample times, s. The first one may be 0. A table that ends before raises SceneError.
        setting : Setting

        Returns
        -------
        Trajectory
            The states that the run reached. A failure of the engine is the outcome, not an exception.
            ``cost.seconds`` is the process CPU time of the stepping alone.
        """

    def with_error_estimate(self, run: Trajectory, seconds: float) -> Trajectory:
        """Return a run of this engine with the engine's own estimate of the error, by default without one.

        Parameters
        ----------
        run : Trajectory
        seconds : float
            CPU time (s) for the estimate.
        """
        return run


BUILT_IN = ("mbref", "mujoco", "pinocchio", "exudyn")
OPTIONAL = ("simbody", "sundials", "ondsel")  # these run by default if their packages are installed
GENERATORS = ("casadi", "heyoka")  # these run only if they are named: they compile code for each scene
LARGE = ("drake", "dart", "bullet", "mjx", "warp", "newton")  # these run only if named: large packages
ON_REQUEST = (*GENERATORS, *LARGE)
ALL = "all"  # this name selects every installed engine
ENTRY_POINTS = "crosscheck.engines"


def engine_names() -> tuple[str, ...]:
    """Return the names of crosscheck's engines and of the engines that installed packages register."""
    registered = (point.name for point in _registered(tuple(sys.path)))
    return (*BUILT_IN, *OPTIONAL, *ON_REQUEST, *registered)


@lru_cache(maxsize=1)
def _registered(_path: tuple[str, ...]) -> tuple[metadata.EntryPoint, ...]:
    """Return the engines that packages in the folders of Python's path register."""
    return tuple(metadata.entry_points(group=ENTRY_POINTS))


def default_engines() -> tuple[str, ...]:
    """Return the names of the engines that run if the user names none: without engines that run on request
    only, and without optional engines that are not installed."""
    asked = (name for name in engine_names() if name not in ON_REQUEST)
    return tuple(name for name in asked if name not in OPTIONAL or installed(name))


def all_engines() -> tuple[str, ...]:
    """Return the names of all installed engines, including engines that run only if they are named."""
    return tuple(name for name in engine_names() if installed(name))


def installed(name: str) -> bool:
    """Return whether the package of a known engine is installed."""
    try:
        engine(name).version()
    except ImportError:
        return False
    return True


def engine(name: str) -> Engine:
    """Return an engine.

    Parameters
    ----------
    name : str
        The name of an engine, or ``module:attribute`` of a module that can be imported or is in the working
        directory.

    Raises
    ------
    LookupError
        If there is no such engine; the message lists the known engines.
    """
    found: object
    if name in BUILT_IN + OPTIONAL + ON_REQUEST:
        found = import_module(f"crosscheck.engines.{name}").ENGINE
    elif registered := [point for point in _registered(tuple(sys.path)) if point.name == name]:
        found = registered[0].load()
    elif ":" in name:
        module, attribute = name.split(":", 1)
        if (here := os.getcwd()) not in sys.path:
            sys.path.append(here)
        found = getattr(import_module(module), attribute)
    else:
        known = engine_names()
        raise LookupError(f"unknown engine {name!r}; known: {', '.join(known)}{meant(name, known)}")
    if isinstance(found, Engine):
        return found
    raise LookupError(f"{name!r} is not an engine: the object does not implement crosscheck.engine.Engine")
