"""Bench: one engine on one specimen scene; its runs, made once and only when a property asks."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from crosscheck.conformance.changes import nudged, weighed
from crosscheck.conformance.closed_forms import CLOSED_FORMS, Exact
from crosscheck.conformance.drawn import mechanism
from crosscheck.conformance.features import feature_scenes
from crosscheck.conformance.moving import dead_end, moving_probes
from crosscheck.conformance.runners import Runner
from crosscheck.engine import Cannot, Setting
from crosscheck.judge.gauss_motion import NAME as GAUSS
from crosscheck.judge.gauss_motion import gauss_motion
from crosscheck.judge.metrics import error_series, in_scene_order, violation_series
from crosscheck.judge.precision import motion_rate, not_finite
from crosscheck.judge.push_difference import pushes_apart
from crosscheck.judge.reference.reference import SECONDS
from crosscheck.judge.tolerances import (
    GRAINS,
    OWN_ACCURACY,
    PERTURBED,
    RANK,
    SAME_MOTION,
    SAME_PUSHES,
    TRUTH_DRIVEN,
)
from crosscheck.judge.truth import NoSolution, closed_form, truth_for
from crosscheck.processes.pool import Observation
from mbref.scene import Scene
from mbref.scenes import SCENES
from mbref.trajectory import Outcome, Trajectory

SAMPLES = 9
STEP = 1e-4  # spacing of neighbouring samples / duration: second differences are about 1e-8
NEIGHBOURS = 4  # samples on each side of the middle one
TURN = 1e-3  # rad: the most that a motion turns from one neighbouring sample to the next
SWEPT = 3  # settings from which order and floor are measured
FASTEST, SLOWEST = 0.1, 0.5  # contractions that are believed: adaptive steps and a floor make others
COARSER = 1e-8  # tolerance of the second integration of Gauss's principle, 100 times the first tolerance
SHARE = 0.1  # largest error of the finer one / difference of the two; measured: 0.01 to 0.03
SHORT = {  # built-in scenes with a truth, and end times (s) before their first singular position
    "four_bar": 0.01,
    "four_bar_gravity": 0.12,
    "planar_slider_crank": 0.1,
    "spatial_slider_crank": 0.02,
    "spatial_slider_crank_driven": 0.02,
}
DRAWN = {"drawn loop": 0, "drawn driven loop": 1}  # seeds of mechanisms that are part of the suite
RELATED = (  # the scenes that are changed as relations say at quick depth
    "pendulum", "torsion", "oscillator", "driven", "turntable", "four_bar_gravity", "spinning loop",
    "cylindrical driver", "force load", "tumbling body", *DRAWN,
)  # fmt: skip


class Broken(Exception):
    """A run that a property needs did not complete."""


class NoExact(Exception):
    """The exact motion that a property needs could not be had; the reason."""


@dataclass(frozen=True)
class Outside:
    """A scene is out of a card's domain, and the reason."""

    reason: str


class Finding(NamedTuple):
    """``measured`` must not exceed ``allowed``; ``remark`` says more."""

    measured: float
    allowed: float
    remark: str = ""


@dataclass(frozen=True)
class Specimen:
    """A scene of the suite; ``exact`` gives its poses where a formula does, ``related`` asks for the
    metamorphic relations too, ``reference_time`` is CPU time (s) for a scene without a closed form, and a
    ``dead_end`` has drivers that the mechanism cannot follow to the end."""

    scene: Scene
    exact: Exact | None = None
    related: bool = False
    reference_time: float = SECONDS
    dead_end: bool = False


def specimens(deep: bool = False) -> list[Specimen]:
    """Closed forms, scenes with a truth, and one probe for every feature; ``deep`` relates all of them."""
    forms = [Specimen(*make(), deep or make.__name__ in RELATED) for make in CLOSED_FORMS]
    scenes = [SCENES[name]().with_(duration=end) for name, end in SHORT.items()]
    known = {scene.name for scene in scenes}
    probes = {
        name: scene.with_(name=name) for name, scene in feature_scenes().items() if scene.name not in known
    }
    drawn = [mechanism(seed).with_(name=name) for name, seed in DRAWN.items()]
    scenes += [*(probes | moving_probes()).values(), *drawn]
    found = forms + [Specimen(scene, None, deep or scene.name in RELATED) for scene in scenes]
    return [*found, Specimen(dead_end(), dead_end=True)]


@dataclass(frozen=True)
class Bench:
    """``settings`` are the best family's, coarse to fine."""

    runner: Runner
    specimen: Specimen
    version: str
    cannot: Cannot | None
    settings: Sequence[Setting]
    family: str = ""  # family to judge; empty: the engine's best family

    @property
    def scene(self) -> Scene:
        return self.specimen.scene

    @property
    def rounding(self) -> float:
        """Relative rounding of numbers that the engine claims."""
        return self.runner.rounding

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

    @cached_property
    def close(self) -> Trajectory:
        """The completed run at evenly spaced times so near that differences of samples are rates."""
        rate = motion_rate(self.scene, self.motion)
        step = min(STEP * self.scene.duration, TURN / rate)
        return self.run(self.scene, self.scene.duration / 2 + step * np.arange(-NEIGHBOURS, NEIGHBOURS + 1))

    def run(self, scene: Scene, times: np.ndarray) -> Trajectory:
        """A completed run of a scene at the finest setting of the specimen; raises Broken."""
        return completed(scene, self.observed(scene, times, self.settings[-1]).value, len(times))

    def refuses(self, scene: Scene) -> Cannot | None:
        """Why the engine, or the family that is judged, cannot run another scene."""
        return self.runner.refuses(scene, self.settings[-1].family)

    def observed(self, scene: Scene, times: np.ndarray, setting: Setting) -> Observation:
        """A run in a process of its own, and what it printed and left behind."""
        return self.runner.observe(scene, times, setting)

    @property
    def shared_runs(self) -> list[Trajectory]:
        """Completed runs at the finest setting, in one process: after one at the coarsest, and after one of
        another scene of the same name."""
        coarse, fine = (self.scene, self.settings[0]), (self.scene, self.settings[-1])
        runs = self.runner.in_turn([coarse, fine, (weighed(self.scene), self.settings[-1]), fine], self.times)
        return [completed(self.scene, run, len(self.times)) for run in (runs[1], runs[3])]

    @cached_property
    def sweep(self) -> list[Trajectory]:
        """Completed runs, finest first: at the finest setting, and at the two next that complete."""
        runs = [self.motion]
        for setting in self.settings[-2::-1]:
            with suppress(Broken):
                found = self.observed(self.scene, self.times, setting).value
                runs.append(completed(self.scene, found, len(self.times)))
            if len(runs) == SWEPT:
                break
        if len(runs) == 1 < len(self.settings):
            raise Broken("only the finest setting completes")
        return runs

    @cached_property
    def steps_apart(self) -> float:
        """Difference of the runs at the two finest settings, 0 where there is but one."""
        return self._apart(0) if len(self.sweep) > 1 else 0.0

    @cached_property
    def contraction(self) -> float:
        """Factor by which the difference of successive settings shrinks, by the three finest: the order of
        convergence in steps of the engine's own settings."""
        before = self.steps_before
        return self.steps_apart / before if before > 0 else 1.0

    @cached_property
    def steps_before(self) -> float:
        """Difference of the runs at the two settings before, 0 where there is none."""
        return self._apart(1) if len(self.sweep) == SWEPT else 0.0

    @cached_property
    def left(self) -> float:
        """Error that the finest setting leaves: the sum of all differences that would follow, which shrink
        by the measured contraction."""
        shrink = min(max(self.contraction, FASTEST), SLOWEST)
        return self.steps_apart * shrink / (1 - shrink)

    @cached_property
    def resolution(self) -> float:
        """Largest error of the finest run by the engine's measured order and floor."""
        return max(SAME_MOTION, OWN_ACCURACY * self.left, PERTURBED * self.perturbed_apart)

    @cached_property
    def rank(self) -> float:
        """Part of the largest singular value of the joints' rows below which others are zero: RANK, or what
        the run leaves of residuals and the engine rounds."""
        left = float(violation_series(self.scene, self.motion).max())
        return max(RANK, GRAINS * self.rounding, GRAINS * left)

    def _apart(self, k: int) -> float:
        return difference(self.scene, self.sweep[k], self.sweep[k + 1])

    @cached_property
    def perturbed_apart(self) -> float:
        """Difference of two runs whose scenes differ by two units in the last place of every number."""
        return difference(self.scene, self.motion, self.perturbed)

    @cached_property
    def perturbed(self) -> Trajectory:
        """The run of a scene that differs by two units in the last place of every number."""
        return self.run(nudged(self.scene, self.rounding), self.times)

    @cached_property
    def own_pushes(self) -> float:
        """Return `own_accuracy` of accelerations and unique reactions."""
        perturbed_difference = pushes_apart(self.scene, self.motion, self.perturbed, self.rank)[0]
        coarser = self.sweep[1] if len(self.sweep) > 1 else self.motion
        steps = pushes_apart(self.scene, self.motion, coarser, self.rank)[0]
        return max(SAME_PUSHES, OWN_ACCURACY * steps, PERTURBED * perturbed_difference)

    @cached_property
    def own_accuracy(self) -> float:
        """Largest difference of runs which should agree: multiples of the differences of the two finest
        settings and of perturbed runs, at least SAME_MOTION."""
        return max(SAME_MOTION, OWN_ACCURACY * self.steps_apart, PERTURBED * self.perturbed_apart)

    @property
    def floors(self) -> str:
        """The differences that `own_accuracy` was measured from, in words."""
        steps = f"the two finest settings by {self.steps_apart:.1e}"
        return f"perturbed runs differ by {self.perturbed_apart:.1e}, {steps}"

    @cached_property
    def exact(self) -> Trajectory:
        """The exact motion at the sample times."""
        return exact_motion(self.specimen, self.times)

    @cached_property
    def exact_bound(self) -> float:
        """Bound on the error of the exact motion."""
        return exact_bound(self.specimen, self.exact)


def set_up(runner: Runner, specimen: Specimen, family: str = "") -> Bench:
    """A bench with the engine's answer to the specimen, in its best family or the one named; raises
    ChildFailed when the engine cannot even say."""
    version, cannot, settings = runner.offers(specimen.scene, family)
    return Bench(runner, specimen, version, cannot, settings, family)


def completed(scene: Scene, run: Trajectory, samples: int) -> Trajectory:
    """The run with its bodies in the scene's order; raises Broken unless it completed with its samples."""
    if run.outcome is not Outcome.COMPLETED:
        raise Broken(f"{run.outcome.label} after {run.t_end:.3g} s: {run.message or run.outcome.sentence}")
    if len(run.times) != samples:
        raise Broken(f"the run claims to have completed, with {len(run.times)} of {samples} samples")
    if lost := not_finite(run):
        raise Broken(f"it says it completed, with numbers that are not finite: {lost[0]}")
    return in_scene_order(scene, run)


def difference(scene: Scene, first: Trajectory, second: Trajectory) -> float:
    """Largest position difference over the scene's length, or rotation angle, between two runs; infinite
    where one is not finite."""
    worst = float(error_series(scene, first, second).max())
    return worst if np.isfinite(worst) else np.inf


def exact_motion(specimen: Specimen, times: np.ndarray) -> Trajectory:
    """Exact poses at times (k,): of a formula (its velocities are NaN), a truth, or Gauss's principle; raises
    NoExact."""
    if specimen.exact is None:
        truth = truth_for(specimen.scene, specimen.reference_time)
        try:
            if truth is not None:
                return truth.poses(times)
        except NoSolution:
            pass  # without a reference, accelerations at the start are still known
        return _of_gauss(specimen.scene, times)
    position, orientation = specimen.exact(times)
    unknown = np.full_like(position, np.nan)
    names = tuple(body.name for body in specimen.scene.body)
    return Trajectory(specimen.scene.name, "closed form", "", "", {}, times, names, position, orientation,
                      unknown, unknown)  # fmt: skip


def _of_gauss(scene: Scene, times: np.ndarray) -> Trajectory:
    try:
        return gauss_motion(scene, tuple(times.tolist()))
    except RuntimeError as error:
        raise NoExact(str(error)) from None


def exact_bound(specimen: Specimen, exact: Trajectory) -> float:
    """Bound on the error of `exact_motion`: of the formula, the truth, the reference, or what integrations of
    Gauss's principle at two tolerances differ by."""
    if exact.engine == GAUSS:
        coarser = gauss_motion(specimen.scene, tuple(exact.times.tolist()), COARSER)
        return SHARE * difference(specimen.scene, exact, coarser)
    form = None if specimen.exact else closed_form(specimen.scene)
    return form.accuracy if form else float(exact.settings.get("bound", TRUTH_DRIVEN))
