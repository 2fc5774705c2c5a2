"""Laws of mechanics that an engine keeps in each family of its own steps, and in each of its alternatives.

The families are judged at their two finest settings, and ways of the alternatives at their step and at
twice that step. A quantity that vanishes in the exact motion may decrease with the step, but not stay.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from crosscheck.conformance.agreeing import FORCE, Apart, Way, differences, quantities_of
from crosscheck.conformance.changes.copies import Outside
from crosscheck.conformance.mechanisms.invariant import moved_away, resized
from crosscheck.conformance.trial import Bench, Broken, Finding, completed
from crosscheck.engine import Setting
from crosscheck.judge.energy import energy_gain
from crosscheck.judge.momentum import momentum_drifts
from crosscheck.judge.tolerances import LEAST_ORDER, LIKE_TRUTH
from crosscheck.setting import fineness, slowed
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

SIZE, FAR = 0.01, 1000.0  # m
SAMPLES = 41
# part of the duration over which accelerations of copies are compared; no whole number of an engine's steps,
# which rounding would change by one in a copy
BRIEF = 0.0997
MOMENTA = ("momentum", "angular momentum")


class Steps(NamedTuple):
    """A fine and a coarser setting of a family or way; ``coarser`` is None if there is one setting only."""

    name: str
    fine: Setting
    coarser: Setting | None


def momenta_kept(bench: Bench) -> Finding | Outside:
    """Momenta of a ring in flight stay in each way and family of own steps, or drift less at finer steps."""
    return _worst(lambda steps: _vanishing(bench, steps), [*_families(bench), *_ways(bench)])


def energy_not_fed(bench: Bench) -> Finding | Outside:
    """No family of own steps feeds energy into a mechanism without losses at its finest setting."""

    def gain(steps: Steps) -> Finding:
        measured = _trend(bench.scene, _run(bench, bench.scene, steps.fine))
        return Finding(max(measured, 0.0), LIKE_TRUTH, f"{steps.name!r} at {steps.fine}")

    return _worst(gain, _families(bench))


def similar(bench: Bench) -> Finding | Outside:
    """A copy of 1 cm for 1 m, with masses and times in proportion, has the same accelerations in each way."""
    small, time = resized(_brief(bench), SIZE), math.sqrt(SIZE)
    each = [*_families(bench), *_ways(bench)]
    return _worst(lambda steps: _unchanged(bench, steps, small, time, SIZE**3), each)


def distant(bench: Bench) -> Finding | Outside:
    """A copy 1 km from the origin has the same accelerations in each way and family of own steps."""
    far = moved_away(_brief(bench), FAR)
    return _worst(lambda steps: _unchanged(bench, steps, far, 1.0, 1.0), [*_families(bench), *_ways(bench)])


def _worst(check: Callable[[Steps], Finding], ways: Iterable[Steps]) -> Finding | Outside:
    """Return the worst finding of the ways whose runs complete."""
    found, failures = [], []
    for steps in ways:
        try:
            found.append(check(steps))
        except Broken as failure:
            failures.append(f"{steps.name}: {failure}")
    if not found:
        return Outside(f"no way completes: {'; '.join(failures)}")
    return max(found, key=lambda one: one.measured / one.allowed)


def _families(bench: Bench) -> Iterator[Steps]:
    """Yield the judged family, and the other families of own steps that are no ways of the alternatives."""
    yield _finest(bench.settings)
    ways = (way for each in bench.runner.alternatives for way in each.ways.values())
    known = {bench.settings[-1].family, *(way.family for way in ways)}
    for family in bench.runner.own_families:
        _, cannot, settings = bench.runner.offers(bench.scene, family)
        if settings and not cannot and family not in known:
            yield _finest(settings)


def _ways(bench: Bench) -> Iterator[Steps]:
    """Yield the ways of the alternatives that can run the scene."""
    for alternatives in bench.runner.alternatives:
        for name, setting in alternatives.ways.items():
            if not bench.runner.refuses(bench.scene, setting.family):
                yield Steps(name, setting, _coarser(setting))


def _coarser(setting: Setting) -> Setting | None:
    """Return a setting with twice the step; None if it has no step."""
    step = setting.options.get("step")
    return None if step is None else Setting(setting.family, {**setting.options, "step": 2 * step})


def _finest(settings: Sequence[Setting]) -> Steps:
    return Steps(settings[-1].family, settings[-1], settings[-2] if len(settings) > 1 else None)


def _run(bench: Bench, scene: Scene, setting: Setting, samples: int = SAMPLES) -> Trajectory:
    times = np.linspace(0.0, scene.duration, samples)
    return completed(scene, bench.runner.in_turn([(scene, setting)], times)[0], samples)


def _vanishing(bench: Bench, steps: Steps) -> Finding:
    """Return the worse drift of momentum and angular momentum.

    Its limit is LIKE_TRUTH, or what a decrease of LEAST_ORDER from the coarser setting leaves.
    """
    measured = _drifts(bench.scene, _run(bench, bench.scene, steps.fine))
    allowed, remark = np.full(2, LIKE_TRUTH), f"{steps.name!r} at {steps.fine}"
    if (measured > allowed).any() and steps.coarser:
        before = _drifts(bench.scene, _run(bench, bench.scene, steps.coarser))
        shorter = fineness(steps.fine) / fineness(steps.coarser)
        allowed = np.maximum(allowed, before * shorter**LEAST_ORDER)
        remark = f"{remark}, as at {steps.coarser}"
    worse = int(np.argmax(measured / allowed))
    return Finding(float(measured[worse]), float(allowed[worse]), f"{MOMENTA[worse]} by {remark}")


def _drifts(scene: Scene, run: Trajectory) -> np.ndarray:
    """Return the largest drifts (2,) of momentum and angular momentum."""
    drifts = momentum_drifts(scene, run)
    return np.full(2, np.inf) if drifts is None else np.max(drifts, axis=1)


def _trend(scene: Scene, run: Trajectory) -> float:
    """Return the slope of the line through the energy's gains times the duration, relative to the energy."""
    gain = energy_gain(scene, run)
    return math.inf if gain is None else float(np.polyfit(run.times, gain, 1)[0] * scene.duration)


def _brief(bench: Bench) -> Scene:
    return bench.scene.with_(duration=BRIEF * bench.scene.duration)


def _unchanged(bench: Bench, steps: Steps, changed: Scene, time: float, force: float) -> Finding:
    """Return the largest difference of a changed copy's accelerations and forces, for forces times a factor.

    Sizes and times change as under gravity, so that accelerations stay.
    """
    base = _run(bench, _brief(bench), steps.fine, 2)
    other = _run(bench, changed, slowed(steps.fine, time), 2)
    found = quantities_of(changed, other)
    if FORCE in found:
        found[FORCE] = found[FORCE] / force
    ways = {"as it is": Way(base, quantities_of(bench.scene, base)), "changed": Way(other, found)}
    worst: Apart = max(differences(bench.scene, ways, [("as it is", "changed")]))
    remark = f"{steps.name!r} at {steps.fine}, in {worst.quantity} of {worst.body!r}"
    return Finding(worst.size, LIKE_TRUTH, remark)


LAWS = {  # check of specimens that keep a quantity
    "momenta": (momenta_kept, "momenta"),
    "passive": (energy_not_fed, "energy"),
    "similar": (similar, "energy"),
    "distant": (distant, "energy"),
}
