"""Steps of engines with their own integrators: step lengths for a scene, and runs from sample to sample."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from crosscheck.engine import Cannot, Engine, Owner, Setting
from crosscheck.engines.shared.driver_motion import fastest_rate
from crosscheck.engines.shared.sampling import Counts, Failed, Sample, labels_of, run_through, step_count
from crosscheck.engines.shared.spanning_tree import Closure, Tree
from crosscheck.engines.shared.tree_reactions import LinkMotion, applied, sample_of
from crosscheck.judge.constraints import scene_length
from crosscheck.judge.time_functions import ends
from crosscheck.setting import unknown_family
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.rotations import unit
from mbref.scene import Moment, Scene

ANGLES = (0.15, 0.05, 0.015, 0.005, 0.0015)  # rad; rotation in a step, for each setting
MOST_STEPS = 250_000
SCOUT_SAMPLES = 41  # number of samples of the coarse run that measures the scene's fastest rate
ARM = 0.1  # half the distance of the two points that close a hinge / scene's length


class Simulation(Protocol):
    """Interface of a simulation of a scene at a setting."""

    counts: Counts

    def advance(self, t0: float, t1: float) -> None:
        """Move the state from t0 to t1 (s); raises Failed."""

    def sample(self, t: float) -> Sample:
        """Return the scene's bodies at the present state."""


class Stepper(Protocol):
    """Interface of an engine that has the tree of a scene."""

    def step(self, t: float, h: float, count: int) -> None:
        """Take ``count`` steps of length h (s) from time t."""

    def motion(self) -> LinkMotion:
        """Return the motion of the links, without accelerations if the engine gives none."""


class FixedSteps:
    """A simulation in equal steps from sample to sample, none longer than ``longest`` (s)."""

    def __init__(self, scene: Scene, tree: Tree, stepper: Stepper, longest: float):
        self.scene, self.tree, self.stepper, self.longest = scene, tree, stepper, longest
        self.counts = Counts()

    def advance(self, t0: float, t1: float) -> None:
        """Move the state from t0 to t1; raises Failed."""
        n = step_count(t0, t1, self.longest)
        self.stepper.step(t0, (t1 - t0) / n, n)
        self.counts.steps += n
        self.counts.rhs += n
        if not np.isfinite(self.stepper.motion().position).all():
            message = f"the state became infinite or NaN between {t0:.6g} s and {t1:.6g} s"
            raise Failed(Outcome.NOT_FINITE, t0, message)

    def sample(self, t: float) -> Sample:
        """Return poses and velocities."""
        return sample_of(self.scene, self.tree, self.stepper.motion(), None)


def simulated(
    engine: Engine, scene: Scene, times: np.ndarray, setting: Setting, make: Callable[[], Simulation]
) -> Trajectory:
    """Return the trajectory of the simulation that ``make`` constructs; raises ValueError for an unknown
    family."""
    if setting.family not in engine.families:
        raise unknown_family(engine.name, setting.family)
    start = time.process_time()
    with np.errstate(all="ignore"):
        run = make()
        labels = labels_of(engine, setting)
        built = time.process_time() - start
        return run_through(scene, times, run.advance, run.sample, run.counts, built, labels)


def scouted_rate(engine: Engine, scene: Scene, family: str, **options: Any) -> float:
    """Return the fastest angular velocity (rad/s) of a scene in a coarse run of an engine."""

    def coarse(step: float) -> Trajectory:
        times = np.linspace(0, scene.duration, SCOUT_SAMPLES)
        return engine.run(scene, times, Setting(family, {"step": step, **options}))

    return fastest_rate(scene, coarse)


def steps(scene: Scene, rate: float, finer: int = 0, most: int = MOST_STEPS) -> list[float]:
    """Return steps (s), coarse to fine, in which a body turns by ANGLES at a rate (rad/s), and ``finer``
    further steps, each a third of the previous step. Steps so short that a run takes more than ``most`` are
    left out.
    """
    return turning(scene, rate, [*ANGLES, *(ANGLES[-1] / 3.0 ** (k + 1) for k in range(finer))], most)


def turning(scene: Scene, rate: float, angles: Sequence[float], most: int = MOST_STEPS) -> list[float]:
    """Return steps (s) in which a body at a rate (rad/s) turns by the angles (rad); steps so short that a run
    takes more than ``most`` are left out."""
    found = [float(f"{angle / rate:.2g}") for angle in angles]
    return [h for h in found if scene.duration / h <= most] or found[:1]


class Loads:
    """The loads of a scene on the links of its tree, at the motion that ``motion`` returns.

    A moment that does not change with time is constant in world axes. If a scene has no other loads,
    ``motion`` is called once, when this object is made.
    """

    def __init__(self, scene: Scene, tree: Tree, motion: Callable[[], LinkMotion]):
        self.scene, self.tree, self.motion = scene, tree, motion
        is_constant = all(isinstance(load, Moment) and not load.over_time for load in scene.load)
        self.constant = applied(scene, tree, motion()) if is_constant else None

    def at(self, t: float) -> list[tuple[int, np.ndarray, np.ndarray]]:
        """Return links, each with a force and a moment about the origin of its frame (world), at time t
        (s)."""
        if self.constant is not None:
            return self.constant
        return applied(self.scene, self.tree, replace(self.motion(), time=t))


def unended_piece(scene: Scene) -> Cannot | None:
    """Return the refusal of a load whose function of time has pieces, for steps that do not end where a piece
    ends; None for all other scenes."""
    for k, load in enumerate(scene.load):
        if load.over_time and ends(load.over_time):
            reason = f"load[{k}] follows a table or is switched, but steps do not end where its pieces do"
            return Cannot(Owner.ADAPTER, reason)
    return None


def held_points(scene: Scene, closure: Closure) -> Sequence[np.ndarray]:
    """Return points (world at t = 0) whose coincidence closes a loop: one for a spherical joint, two on the
    axis of a hinge, three points not on a line for a weld."""
    if closure.kind == "point":
        return [closure.anchor]
    arm = ARM * scene_length(scene)
    if closure.kind == "weld":
        return [closure.anchor + arm * e for e in np.eye(3)]
    along = arm * unit(scene.joint[closure.joint].directions[0])
    return [closure.anchor - along, closure.anchor + along]
