"""Bench: one engine on one specimen scene; its runs, made once and only when a property asks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from crosscheck.conformance.closed_forms import CLOSED_FORMS, Exact
from crosscheck.conformance.features import feature_scenes
from crosscheck.engine import Cannot, Setting
from crosscheck.judge.metrics import error_series, in_scene_order
from crosscheck.judge.reference.reference import SECONDS
from crosscheck.judge.tolerances import OWN_ACCURACY, SAME_MOTION
from crosscheck.judge.truth import NoSolution, truth_for
from crosscheck.processes.pool import Observation, observe, offers, run_isolated
from mbref.scene import Scene
from mbref.scenes import SCENES
from mbref.trajectory import Outcome, Trajectory

SAMPLES = 9
BEST = "tuned"  # the family an engine calls its best; without it, its first family counts as that
SHORT = {  # built-in scenes with a truth, and end times (s) before their first singular position
    "four_bar": 0.01,
    "four_bar_gravity": 0.12,
    "planar_slider_crank": 0.1,
    "spatial_slider_crank": 0.02,
    "spatial_slider_crank_driven": 0.02,
}
RELATED = ("pendulum", "torsion", "oscillator", "four_bar_gravity", "spatial_slider_crank")


class Broken(Exception):
    """A run that a property needs did not complete."""


@dataclass(frozen=True)
class Specimen:
    """A scene of the suite; ``exact`` gives its poses where a formula does, ``related`` asks for the
    metamorphic relations too, ``reference_time`` is CPU time (s) for a scene without a closed form."""

    scene: Scene
    exact: Exact | None = None
    related: bool = False
    reference_time: float = SECONDS


def specimens() -> list[Specimen]:
    """Closed forms, scenes with a truth, and one probe for every feature."""
    forms = [Specimen(*make(), make.__name__ in RELATED) for make in CLOSED_FORMS]
    truths = [
        Specimen(SCENES[name]().with_(duration=end), None, name in RELATED) for name, end in SHORT.items()
    ]
    known = {specimen.scene.name for specimen in truths}
    probes = feature_scenes().items()
    return forms + truths + [Specimen(_named(n, scene)) for n, scene in probes if scene.name not in known]


def _named(feature: str, scene: Scene) -> Scene:
    return scene.with_(name=feature)


@dataclass(frozen=True)
class Bench:
    """``engine`` is a name or ``module:attribute``; ``settings`` are the best family's, coarse to fine."""

    engine: str
    specimen: Specimen
    version: str
    cannot: Cannot | None
    settings: Sequence[Setting]
    time_limit: float  # s, of each run

    @property
    def scene(self) -> Scene:
        return self.specimen.scene

    @cached_property
    def times(self) -> np.ndarray:
        """Sample times (k,), s, both ends included."""
        return np.linspace(0.0, self.scene.duration, SAMPLES)

    @cached_property
    def finest(self) -> Observation:
        """The run at the finest setting."""
        return self.observed(self.scene, self.times, self.settings[-1])

    @cached_property
    def motion(self) -> Trajectory:
        """The completed run at the finest setting; raises Broken when there is none."""
        return completed(self.scene, self.finest.value, len(self.times))

    def run(self, scene: Scene, times: np.ndarray) -> Trajectory:
        """A completed run of a scene at the finest setting of the specimen; raises Broken."""
        return completed(scene, self.observed(scene, times, self.settings[-1]).value, len(times))

    def observed(self, scene: Scene, times: np.ndarray, setting: Setting) -> Observation:
        """A run in a process of its own, and what it printed and left behind."""
        return observe(self.engine, scene, times, setting, self.time_limit)

    @property
    def shared_runs(self) -> list[Trajectory]:
        """Completed runs at the finest setting, with one at the coarsest between them, in one process."""
        settings = self.settings[-1], self.settings[0], self.settings[-1]
        runs = [run_isolated(self.engine, self.scene, self.times, s, self.time_limit) for s in settings]
        return [completed(self.scene, run, len(self.times)) for run in (runs[0], runs[2])]

    @cached_property
    def own_accuracy(self) -> float:
        """Largest error that runs which should agree may have between them: multiples of the difference
        of the two finest settings, and no less than SAME_MOTION."""
        coarser = self.observed(self.scene, self.times, self.settings[-2:][0])
        apart = difference(self.scene, self.motion, completed(self.scene, coarser.value, len(self.times)))
        return max(SAME_MOTION, OWN_ACCURACY * apart)

    @cached_property
    def exact(self) -> Trajectory | None:
        """The exact motion at the sample times, where it is known."""
        return exact_motion(self.specimen, self.times)


def set_up(engine: str, specimen: Specimen, time_limit: float) -> Bench:
    """A bench with what the engine says of the specimen; raises ChildFailed when it cannot even say."""
    version, cannot, settings = offers(engine, specimen.scene, time_limit)
    return Bench(engine, specimen, version, cannot, best_family(settings), time_limit)


def best_family(settings: Sequence[Setting]) -> list[Setting]:
    """The settings of the family an engine calls its best, else of its first family, coarse to fine."""
    families = [setting.family for setting in settings]
    best = BEST if BEST in families or not families else families[0]
    return [setting for setting in settings if setting.family == best]


def completed(scene: Scene, run: Trajectory, samples: int) -> Trajectory:
    """The run with its bodies in the scene's order; raises Broken unless it completed with its samples."""
    if run.outcome is not Outcome.COMPLETED:
        raise Broken(f"{run.outcome.label} after {run.t_end:.3g} s: {run.message or run.outcome.sentence}")
    if len(run.times) != samples:
        raise Broken(f"it says it completed, with {len(run.times)} of {samples} samples")
    return in_scene_order(scene, run)


def difference(scene: Scene, first: Trajectory, second: Trajectory) -> float:
    """Largest position difference over the scene's length, or rotation angle, between two runs."""
    return float(error_series(scene, first, second).max())


def exact_motion(specimen: Specimen, times: np.ndarray) -> Trajectory | None:
    """Exact poses at times (k,); None where there is neither formula nor reference. Velocities of a formula
    are NaN."""
    if specimen.exact is None:
        truth = truth_for(specimen.scene, specimen.reference_time)
        try:
            return None if truth is None else truth.poses(times)
        except NoSolution:
            return None
    position, orientation = specimen.exact(times)
    unknown = np.full_like(position, np.nan)
    names = tuple(body.name for body in specimen.scene.body)
    return Trajectory(specimen.scene.name, "closed form", "", "", {}, times, names, position, orientation,
                      unknown, unknown)  # fmt: skip
