"""Bench: an engine and a scene on which it is checked. Runs are made at first access and shared by all
checks."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from crosscheck.conformance.changes.copies import nudged, weighed
from crosscheck.conformance.mechanisms.specimens import Specimen
from crosscheck.conformance.runners import Runner
from crosscheck.engine import Cannot, Setting
from crosscheck.judge.constraints import scene_length
from crosscheck.judge.gauss_motion import NAME as GAUSS
from crosscheck.judge.gauss_motion import gauss_motion
from crosscheck.judge.metrics import error_series, in_scene_order
from crosscheck.judge.precision import motion_rate, not_finite
from crosscheck.judge.push_difference import pushes_apart
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
from crosscheck.judge.violations import violation_series
from crosscheck.processes.pool import Observation
from mbref import rotations
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import Scene

SAMPLES = 9
STEP = 1e-4  # spacing of neighbouring samples / duration; second differences then have errors of about 1e-8
NEIGHBOURS = 4  # samples on each side of the middle one
TURN = 1e-3  # rad; largest rotation between neighbouring samples
SWEPT = 3  # number of settings from which convergence order and accuracy limit are estimated
# limits of the estimated contraction: adaptive steps and rounding give values outside the limits
FASTEST, SLOWEST = 0.1, 0.5
# tolerance of the second integration of Gauss's principle, 100 times the tolerance of the first integration
COARSER = 1e-8
# bound on (error of the finer integration) / (difference of the two integrations); measured: 0.01 to 0.03
SHARE = 0.1


class Broken(Exception):
    """A run that a check needs did not complete."""


class NoExact(Exception):
    """The exact motion that a check needs is not available; the message is the reason."""


class Finding(NamedTuple):
    """Result of a check: ``measured`` must not exceed ``allowed``; ``remark`` adds a note."""

    measured: float
    allowed: float
    remark: str = ""


@dataclass(frozen=True)
class Bench:
    """An engine and a scene on which it is checked, with the settings of the judged family, coarse to
    fine."""

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
        """Relative rounding error of the numbers that the engine declares."""
        return self.runner.rounding

    @cached_property
    def times(self) -> np.ndarray:
        """Sample times (k,), s, both ends included."""
        return np.linspace(0.0, self.scene.duration, SAMPLES)

    @cached_property
    def finest(self) -> Observation:
        """Run at the finest setting."""
        return self.observed(self.scene, self.times, self.settings[-1])

    @cached_property
    def motion(self) -> Trajectory:
        """Completed run at the finest setting; raises Broken if it did not complete."""
        return completed(self.scene, self.finest.value, len(self.times))

    @cached_property
    def close(self) -> Trajectory:
        """Completed run at equally spaced times so near that differences of samples give rates."""
        return self.near(0)

    def near(self, coarser: int) -> Trajectory:
        """Return the run `close`; at a coarser setting its samples are farther apart in proportion.

        An engine that shortens its steps to meet samples has steps of the samples' distance.
        """
        step = (1 + coarser) * min(STEP * self.scene.duration, TURN / motion_rate(self.scene, self.motion))
        times = self.scene.duration / 2 + step * np.arange(-NEIGHBOURS, NEIGHBOURS + 1)
        return self.run(self.scene, times, coarser)

    def run(self, scene: Scene, times: np.ndarray, coarser: int = 0) -> Trajectory:
        """Return a completed run of a scene at the finest setting of this bench's scene, or at a setting that
        is ``coarser`` by a number of settings; raises Broken."""
        return completed(scene, self.observed(scene, times, self.settings[-1 - coarser]).value, len(times))

    def refuses(self, scene: Scene) -> Cannot | None:
        """Return the reason why the engine, in the judged family, cannot run another scene, or None."""
        return self.runner.refuses(scene, self.settings[-1].family)

    def observed(self, scene: Scene, times: np.ndarray, setting: Setting) -> Observation:
        """Return a run in a separate process, with its printed text and the files it left."""
        return self.runner.observe(scene, times, setting)

    @property
    def shared_runs(self) -> list[Trajectory]:
        """Return completed runs at the finest setting that share a process: the first run follows a run at
        the coarsest setting, the second run follows a run of another scene with an equal name."""
        coarse, fine = (self.scene, self.settings[0]), (self.scene, self.settings[-1])
        runs = self.runner.in_turn([coarse, fine, (weighed(self.scene), self.settings[-1]), fine], self.times)
        return [completed(self.scene, run, len(self.times)) for run in (runs[1], runs[3])]

    @cached_property
    def sweep(self) -> list[Trajectory]:
        """Completed runs, finest first: at the finest setting, and at the next two that complete."""
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
        """Difference of the runs at the two finest settings; 0 if only one completes."""
        return self._apart(0) if len(self.sweep) > 1 else 0.0

    @cached_property
    def contraction(self) -> float:
        """Factor by which the difference of successive settings decreases, from the three finest settings.
        The factor measures the order of convergence in steps of the engine's own settings."""
        before = self.steps_before
        return self.steps_apart / before if before > 0 else 1.0

    @cached_property
    def steps_before(self) -> float:
        """Difference of the runs at the second and third finest settings; 0 for fewer settings."""
        return self._apart(1) if len(self.sweep) == SWEPT else 0.0

    @property
    def remaining(self) -> float:
        """Sum of all further differences between ever finer settings, over the last difference."""
        shrink = min(max(self.contraction, FASTEST), SLOWEST)
        return shrink / (1 - shrink)

    @cached_property
    def left(self) -> float:
        """Estimated error of the finest setting: the sum of all further differences between settings."""
        return self.steps_apart * self.remaining

    @cached_property
    def resolution(self) -> float:
        """Largest error of the finest run that its measured order and accuracy limit explain."""
        return max(SAME_MOTION, OWN_ACCURACY * self.left, PERTURBED * self.perturbed_apart)

    @cached_property
    def rank(self) -> float:
        """Relative rank tolerance for the Jacobian's singular values: the largest of RANK, and GRAINS times
        the engine's rounding and the run's residuals."""
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
        """Run of a scene that differs by two units in the last place of every number."""
        return self.run(nudged(self.scene, self.rounding), self.times)

    @cached_property
    def own_pushes(self) -> float:
        """Value of `own_accuracy` for accelerations and unique reactions."""
        perturbed_difference = pushes_apart(self.scene, self.motion, self.perturbed, self.rank)[0]
        coarser = self.sweep[1] if len(self.sweep) > 1 else self.motion
        steps = pushes_apart(self.scene, self.motion, coarser, self.rank)[0]
        return max(SAME_PUSHES, OWN_ACCURACY * steps, PERTURBED * perturbed_difference)

    @cached_property
    def own_accuracy(self) -> float:
        """Largest difference allowed between runs that should agree. The result is a multiple of the
        difference of the two finest settings and of the perturbed runs, at least SAME_MOTION."""
        return max(SAME_MOTION, OWN_ACCURACY * self.steps_apart, PERTURBED * self.perturbed_apart)

    @property
    def floors(self) -> str:
        """Text with the differences from which `own_accuracy` was computed."""
        steps = f"the two finest settings by {self.steps_apart:.1e}"
        return f"perturbed runs differ by {self.perturbed_apart:.1e}, {steps}"

    @cached_property
    def exact(self) -> Trajectory:
        """Exact motion at the sample times."""
        return exact_motion(self.specimen, self.times)

    @cached_property
    def exact_bound(self) -> float:
        """Bound on the error of the exact motion."""
        return exact_bound(self.specimen, self.exact)


def set_up(runner: Runner, specimen: Specimen, family: str = "") -> Bench:
    """Return a bench with the engine's refusal or settings for the scene, in its best family of settings or
    the given family. Raises ChildFailed if the engine crashes when asked. A large mechanism is judged in the
    first of the engine's alternatives that serves it, which needs no coarse run to choose its settings."""
    if specimen.large and not family and (alternatives := runner.alternatives):
        ways = [way.family for way in alternatives[0].ways.values()]
        family = next((way for way in ways if not runner.refuses(specimen.scene, way)), ways[0])
    version, cannot, settings = runner.offers(specimen.scene, family)
    return Bench(runner, specimen, version, cannot, settings, family)


def completed(scene: Scene, run: Trajectory, samples: int) -> Trajectory:
    """Return the run with its bodies in the scene's order; raises Broken unless it completed with all
    samples."""
    if run.outcome is not Outcome.COMPLETED:
        raise Broken(f"{run.outcome.label} after {run.t_end:.3g} s: {run.message or run.outcome.sentence}")
    if len(run.times) != samples:
        raise Broken(f"the run claims to have completed, with {len(run.times)} of {samples} samples")
    if lost := not_finite(run):
        raise Broken(f"the run claims to have completed, with numbers that are not finite: {lost[0]}")
    return in_scene_order(scene, run)


def difference(scene: Scene, first: Trajectory, second: Trajectory) -> float:
    """Return the largest position difference over the scene's length, or rotation angle, between two runs.
    The result is infinite if a number is not finite."""
    worst = float(error_series(scene, first, second).max())
    return worst if np.isfinite(worst) else np.inf


def worst_body(scene: Scene, first: Trajectory, second: Trajectory) -> str:
    """Return the name of the body whose poses differ most between two runs."""
    turned = rotations.angle_between(first.orientation, second.orientation)
    apart = np.linalg.norm(first.position - second.position, axis=2) / scene_length(scene)
    worst = np.maximum(apart, turned).max(axis=0)
    return scene.body[int(worst.argmax())].name


def exact_motion(specimen: Specimen, times: np.ndarray) -> Trajectory:
    """Return exact poses at times (k,) from a formula (velocities NaN), a truth, or Gauss's principle."""
    if specimen.exact is None:
        truth = truth_for(specimen.scene, specimen.reference_time)
        try:
            if truth is not None:
                return truth.poses(times)
        except NoSolution:
            pass  # accelerations at the start are still known
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
    """Return a bound on the error of `exact_motion`. The bound is known for a formula, truth or reference.
    For Gauss's principle the bound follows from two integrations at different tolerances."""
    if exact.engine == GAUSS:
        coarser = gauss_motion(specimen.scene, tuple(exact.times.tolist()), COARSER)
        return SHARE * difference(specimen.scene, exact, coarser)
    form = None if specimen.exact else closed_form(specimen.scene)
    return form.accuracy if form else float(exact.settings.get("bound", TRUTH_DRIVEN))
