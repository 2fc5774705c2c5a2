"""Findings at a model of the user's own: known defects of engines that meet the model are tried on it.

A finding with conditions names settings that have the defect, and a remedy. A short run with the remedy and
one without it decide whether the defect is there, by Gauss's principle or by a quantity that the motion
keeps.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from crosscheck.engine import Setting, engine
from crosscheck.engines.shared.spanning_tree import spanning_tree
from crosscheck.findings.finding import SAMPLES, Finding, When, findings
from crosscheck.judge.deadline import TimeIsUp, within
from crosscheck.judge.energy import energy_gain
from crosscheck.judge.gauss_motion import gauss_motion
from crosscheck.judge.metrics import error_series, in_scene_order
from crosscheck.judge.model_identity import gate_times
from crosscheck.judge.momentum import momentum_drifts
from crosscheck.judge.start_accelerations import Starts, starts
from crosscheck.processes.pool import run_isolated
from crosscheck.study.words.speed import TITLES
from mbref import counts
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import Scene

RUN_SECONDS = 10.0  # CPU seconds for one run; settings that take longer are not tried
TRUTH_SECONDS = 20.0  # CPU seconds for the motion by Gauss's principle
BETTER = 0.5  # largest error with the remedy, relative to the error without it
Offers = Callable[[str], Sequence[Setting]]  # an engine's settings for the scene, by name


class Defect(NamedTuple):
    """A known defect that shows at a model: finding, engine, family of settings, relative difference that the
    remedy makes (None: infinite), and a sentence for the user."""

    finding: str
    engine: str
    family: str
    apart: float | None
    sentence: str


class Tried(NamedTuple):
    """A setting, the relative difference that the remedy makes there, and the errors of both in words."""

    setting: Setting
    apart: float
    words: str


def defects(
    scene: Scene, engines: Sequence[str], offers: Offers, known: Sequence[Finding] | None = None
) -> list[Defect]:
    """Return the known defects of installed engines that short runs of a scene show; ``known`` replaces the
    stored findings."""
    stored = findings() if known is None else known
    met = [(one, one.when) for one in stored if one.when is not None and one.engine in engines]
    tried = [_tried(scene, one, when, offers(one.engine)) for one, when in met if _meets(scene, one, when)]
    return [found for found in tried if found]


def _meets(scene: Scene, one: Finding, when: When) -> bool:
    """Return whether the installed version and the structure of a scene meet the conditions."""
    types = {joint.type for joint in scene.joint}
    if len(spanning_tree(scene).closures) < when.loops or (when.joints and not types & set(when.joints)):
        return False
    if when.redundant and counts(scene).redundant < when.redundant:
        return False
    if when.polynomial and all(coupling.powers == 1 for coupling in scene.coupling):
        return False
    if any(math.hypot(*body.position) < when.away for body in scene.body):
        return False
    return not when.versions or engine(one.engine).version() in when.versions


def _tried(scene: Scene, one: Finding, when: When, settings: Sequence[Setting]) -> Defect | None:
    """Return the defect at the setting where the remedy makes the largest finite difference."""
    tried = (_pair(scene, one, when, setting) for setting in _ends(when, settings))
    pairs = [pair for pair in tried if pair]
    finite = [pair for pair in pairs if math.isfinite(pair.apart)]
    found = max(finite or pairs, key=lambda pair: pair.apart, default=None)
    if found is None:
        return None
    name, version = TITLES.get(one.engine, one.engine), engine(one.engine).version()
    sentence = f"{name} {version} {when.says} and is wrong there: {when.advice}"
    apart = found.apart if finite else None
    return Defect(one.name, one.engine, found.setting.family, apart, f"{sentence} ({found.words})")


def _ends(when: When, settings: Sequence[Setting]) -> Iterator[Setting]:
    """Yield the coarsest and the finest setting of each family that a finding is about, or the finest one."""
    asked = when.settings.items()
    for family in when.families:
        found = [s for s in settings if s.family == family and asked <= s.options.items()]
        yield from found[-1:] if when.finest else [*found[:1], *found[1:][-1:]]


def _pair(scene: Scene, one: Finding, when: When, setting: Setting) -> Tried | None:
    """Return the difference that the remedy makes at a setting; None if it is no clear improvement."""
    mended = Setting(when.family or setting.family, {**setting.options, **when.options})
    times = np.linspace(0.0, when.seconds, SAMPLES) if when.seconds else gate_times(scene)
    runs = [run_isolated(one.engine, scene, times, s, RUN_SECONDS) for s in (setting, mended)]
    if when.keeps:
        return _drifting(scene, when, setting, *runs)
    if any(run.outcome is not Outcome.COMPLETED for run in runs):
        return None
    first, second = (in_scene_order(scene, run) for run in runs)
    found = starts(scene, first, second)
    if mended == setting:
        return _alone(when, setting, found)
    apart, (wrong, right) = found or _poses(scene, first, second)
    what = ("accelerations at the start", "of the largest") if found else ("poses", "rad or lengths")
    words = f"{what[0]} are off by {wrong:.2g} {what[1]}, otherwise by {right:.2g}"
    return Tried(setting, apart, words) if apart > when.above and right <= BETTER * wrong else None


def _alone(when: When, setting: Setting, found: Starts | None) -> Tried | None:
    """Return the error of accelerations at the start, where the engine has no remedy."""
    error = math.nan if found is None else found.errors[0]
    words = f"accelerations at the start are off by {error:.2g} of the largest"
    return Tried(setting, error, words) if error > when.above else None


def _drifting(
    scene: Scene, when: When, setting: Setting, first: Trajectory, second: Trajectory
) -> Tried | None:
    """Return the drift of the quantity that the motion keeps, without and with the remedy.

    The drift is infinite if the run becomes infinite. None if the motion does not keep the quantity, or the
    remedy does not halve its drift.
    """
    wrong, right = (_drift(scene, when, run) for run in (first, second))
    if wrong is None or right is None or not math.isfinite(right):
        return None
    off = f"off by {wrong:.2g} of its size after {when.seconds:g} s" if math.isfinite(wrong) else "infinite"
    words = f"the {when.keeps} is {off}, otherwise off by {right:.2g}"
    return Tried(setting, wrong, words) if wrong > when.above and right <= BETTER * wrong else None


def _drift(scene: Scene, when: When, run: Trajectory) -> float | None:
    """Return the drift of the quantity that a run should keep; None if that is not known."""
    if run.outcome is Outcome.NOT_FINITE:
        return math.inf
    if run.outcome is not Outcome.COMPLETED:
        return None
    return KEPT[when.keeps](scene, in_scene_order(scene, run))


def _turned(scene: Scene, run: Trajectory) -> float | None:
    """Return the largest drift of the angular momentum, relative to its size; None if it is not kept."""
    drifts = momentum_drifts(scene, run)
    return None if drifts is None else float(drifts[1].max())


def _fed(scene: Scene, run: Trajectory) -> float | None:
    """Return the largest gain of energy, relative to the energy; None if it is not kept."""
    gain = energy_gain(scene, run)
    return None if gain is None else max(0.0, float(gain.max()))


# quantities that a motion keeps, by name: the drift in a run
KEPT: Mapping[str, Callable[[Scene, Trajectory], float | None]] = {
    "angular momentum": _turned,
    "energy": _fed,
}


def _poses(scene: Scene, first: Trajectory, second: Trajectory) -> Starts:
    """Return the difference of two runs' poses, and their errors by Gauss's principle, or NaN."""
    apart = float(error_series(scene, first, second).max())
    try:
        with within(TRUTH_SECONDS):
            exact = gauss_motion(scene, tuple(first.times.tolist()))
    except (RuntimeError, TimeIsUp):
        return Starts(apart, (math.nan, math.nan))
    wrong, right = (float(error_series(scene, run, exact).max()) for run in (first, second))
    return Starts(apart, (wrong, right))
