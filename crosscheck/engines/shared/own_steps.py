"""Engines that take steps of their own: settings by the angle that a body turns in one step, and worlds in
which drivers and loads act in every step."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from crosscheck.engine import Cannot, Engine, Setting
from crosscheck.engines.shared import terms
from crosscheck.engines.shared.driver_motion import mean_rate, stated_rate
from crosscheck.engines.shared.fixed_steps import (
    MOST_STEPS,
    FixedSteps,
    Loads,
    Simulation,
    Stepper,
    scouted_rate,
    simulated,
    steps,
    unended_piece,
)
from crosscheck.engines.shared.initial_velocities import lacks_mass
from crosscheck.engines.shared.planar_scene import planar_scene
from crosscheck.engines.shared.sampling import step_count
from crosscheck.engines.shared.spanning_tree import Tree, spanning_tree
from crosscheck.engines.shared.tree_reactions import LinkMotion
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

STEP = {"step": "time step, s"}  # the option of each family with own steps


class Steps(Stepper, Protocol):
    """Interface of an engine that has the tree of a scene and prepares steps of a given length."""

    tree: Tree

    def begin(self, h: float) -> None:
        """Prepare steps of length h (s); also called before the timed run."""


class World(ABC):
    """A mechanism in an engine that takes steps, with its drivers and loads."""

    def __init__(self, mechanism: Any):
        self.mechanism, self.scene, self.tree = mechanism, mechanism.scene, mechanism.tree
        self.driven = [(mechanism.joints[i], driver) for i, driver in self.tree.driven(self.scene)]
        self.loads = Loads(self.scene, self.tree, self.motion)

    def motion(self) -> LinkMotion:
        """Return the motion of the links."""
        moved: LinkMotion = self.mechanism.motion()
        return moved

    def step(self, t: float, h: float, count: int) -> None:
        """Take ``count`` steps of length h (s) from time t."""
        self.begin(h)
        for n in range(count):
            now = t + n * h
            for joint, driver in self.driven:
                self.drive(joint, mean_rate(driver, now, h), h)
            if self.scene.load:
                self.push(self.loads.at(now))
            self.advance(now, h)

    @abstractmethod
    def begin(self, h: float) -> None:
        """Prepare steps of length h (s); also called before the timed run."""

    def drive(self, joint: Any, rate: float, h: float) -> None:
        """Prescribe the mean rate of a driven joint over the next step of length h (s)."""
        raise NotImplementedError(f"{type(self).__module__} moves no joint")

    @abstractmethod
    def push(self, loads: Sequence[tuple[int, np.ndarray, np.ndarray]]) -> None:
        """Apply loads in the next step: links, each with a force and a moment about the origin of its frame
        (world)."""

    @abstractmethod
    def advance(self, t: float, h: float) -> None:
        """Take a step of length h (s) from time t; raises Failed."""


class SteppingEngine(Engine):
    """Base of engines with steps of their own; some have a family whose terms crosscheck integrates.

    Attributes
    ----------
    own_steps : mapping of str to mapping
        Families of own steps, each with its further options.
    default_steps : mapping of str to float
        Step of the library itself, s, which is added to the steps of a family.
    finer, most_steps : int
        Number of further, finer steps, each a third of the previous one; and the most steps of a run.
    scout : str
        Family whose coarse run measures the fastest rate; without one, the scene's data give the rate.
    planar : collection of str
        Families that simulate a planar mechanism with the fewest joint coordinates.
    with_terms : callable or None
        Constructor of a mechanism with terms from a scene and its tree, for the family `terms.FAMILY`.
    """

    own_steps: Mapping[str, Mapping[str, float]]
    default_steps: Mapping[str, float] = {}
    finer: int = 0
    most_steps: int = MOST_STEPS
    scout: str = ""
    planar: Collection[str] = ()
    with_terms: Callable[[Scene, Tree], terms.Mechanism] | None = None

    def refuses(self, scene: Scene) -> Cannot | None:
        """Refuse scenes without masses whose motion the drivers do not determine completely, and loads over
        time that have pieces."""
        return lacks_mass(scene) or unended_piece(scene)

    def serves(self, scene: Scene, family: str) -> bool:
        """Return whether the family exists; by default every family can run every scene."""
        return family in self.families

    def settings(self, scene: Scene) -> Sequence[Setting]:
        """Return settings by tolerance for the family of terms, and settings by step for each family of own
        steps that can run the scene, coarse to fine."""
        own = {family: options for family, options in self.own_steps.items() if self.serves(scene, family)}
        rate = stated_rate(scene)
        if self.scout in own:
            rate = scouted_rate(self, scene, self.scout, **own[self.scout])
        found = terms.sweep(rate) if terms.FAMILY in self.families else []
        fine = steps(scene, rate, finer=self.finer, most=self.most_steps)
        for family, options in own.items():
            default = {self.default_steps[family]} if family in self.default_steps else set()
            lengths = sorted({*fine, *default}, reverse=True)
            found += [Setting(family, {"step": h, **options}) for h in lengths]
        return found

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        """Simulate a scene; raises ValueError for an unknown family, or a family that cannot run the
        scene."""
        if setting.family in self.families and not self.serves(scene, setting.family):
            raise ValueError(f"family {setting.family!r} of {self.name} cannot run the scene {scene.name!r}")
        if setting.family in self.planar:
            scene = planar_scene(scene)
        return simulated(self, scene, times, setting, lambda: self.simulation(scene, times, setting))

    def simulation(self, scene: Scene, times: np.ndarray, setting: Setting) -> Simulation:
        """Return a simulation whose first step is prepared."""
        if setting.family == terms.FAMILY and self.with_terms:
            return terms.Simulation(self.with_terms(scene, spanning_tree(scene)), setting)
        world, longest = self.world(scene, setting), setting.options["step"]
        for end in times[times > 0.0][:1]:
            world.begin(end / step_count(0.0, end, longest))
        return FixedSteps(scene, world.tree, world, longest)

    @abstractmethod
    def world(self, scene: Scene, setting: Setting) -> Steps:
        """Return a mechanism that takes own steps at a setting."""
