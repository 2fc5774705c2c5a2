"""Experiments: runs of a mechanism whose exact motion keeps a quantity, while one number is changed."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from crosscheck.closed_loops.mechanisms import DIFFICULTIES
from crosscheck.conformance.mechanisms.invariant import (
    SPIN,
    WAY,
    flying_ring,
    four_cranks,
    moved_away,
    resized,
    whirling_crank,
)
from crosscheck.engine import Setting
from crosscheck.judge.energy import energy_gain
from crosscheck.judge.metrics import error_series
from crosscheck.judge.momentum import momentum_drifts
from crosscheck.judge.truth import truth_for
from crosscheck.setting import fineness, slowed
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

SAMPLES = 41
TOLERANCE = 1e-8  # of MuJoCo's solvers by default, rad²/s⁴
LONG = 4.0  # s of runs whose momenta or energy are measured, at the spin SPIN
Values = Mapping[str, float]


class Experiment(NamedTuple):
    """Runs of one mechanism, at each setting of a family or at the finest one with several ``values``.

    ``make(x)`` is the mechanism at a value, and ``time(x)`` the factor by which its motion is slower.
    ``measure(scene, run, x, base)`` returns numbers that vanish in the exact motion by name. ``base`` is the
    run at the first value, which only serves for comparison if ``compares``, or at each value the run with
    the options ``exact``. ``changed(x, options)`` are options that depend on the value.
    """

    name: str
    over: str
    make: Callable[[float], Scene]
    measure: Callable[[Scene, Trajectory, float, Trajectory], Values]
    values: Sequence[float] = ()
    time: Callable[[float], float] = lambda x: 1.0
    compares: bool = False
    exact: Mapping[str, Any] = MappingProxyType({})
    changed: Callable[[float, Mapping[str, Any]], Mapping[str, Any]] = lambda x, options: {}

    def first(self) -> Scene:
        """Return the mechanism for which an engine chooses its settings."""
        return self.make(next((x for x in self.values if self.time(x) == 1.0), 0.0))

    def points(self, settings: Sequence[Setting]) -> list[tuple[float, Setting]]:
        """Return the value or the fineness, and the setting, of every run of a family, coarse to fine."""
        if not self.values:
            return [(fineness(setting), setting) for setting in settings]
        return [(x, self._at(x, slowed(settings[-1], self.time(x)))) for x in self.values]

    def _at(self, x: float, setting: Setting) -> Setting:
        return Setting(setting.family, {**setting.options, **self.changed(x, setting.options)})


def times_of(scene: Scene) -> np.ndarray:
    """Return the sample times (k,) of a run, s."""
    return np.linspace(0.0, scene.duration, SAMPLES)


def _flying(spin: float) -> Scene:
    return flying_ring(spin).with_(duration=LONG * SPIN / spin)


def _drifts(scene: Scene, run: Trajectory, x: float, base: Trajectory) -> Values:
    """Return the largest drifts of momentum and angular momentum / duration, 1/s."""
    drifts = momentum_drifts(scene, run)
    assert drifts is not None, scene.name
    linear, angular = (float(drift.max()) / scene.duration for drift in drifts)
    return {"momentum": linear, "angular momentum": angular}


def _trend(scene: Scene, run: Trajectory, x: float, base: Trajectory) -> Values:
    """Return the slope of the line through the energy's gains, 1/s, in which oscillations cancel."""
    gain = energy_gain(scene, run)
    assert gain is not None, scene.name
    return {"energy": float(np.polyfit(run.times, gain, 1)[0])}


@cache
def four_bar() -> Scene:
    """Return the four-bar of the page on closed loops, which swings under gravity for 1 s."""
    return DIFFICULTIES[0].make()


@cache
def cranks() -> Scene:
    """Return the chain of four slider-cranks for 0.1 s."""
    return four_cranks().with_(duration=0.1)


@cache
def _truth() -> Trajectory:
    truth = truth_for(four_bar())
    assert truth is not None
    return truth.poses(times_of(four_bar()))


def _error(scene: Scene, run: Trajectory, x: float, base: Trajectory) -> Values:
    return {"error": float(error_series(scene, run, _truth()).max())}


def _unlike(scene: Scene, size: float, shift: np.ndarray, run: Trajectory, base: Trajectory) -> float:
    """Return the difference from the base of a run of another size and place, brought back to the base's."""
    undone = replace(run, times=base.times, position=(run.position - shift) / size)
    return float(error_series(scene, undone, base).max())


EXPERIMENTS = (
    Experiment("flight", "step", lambda x: _flying(SPIN), _drifts),
    Experiment("spin", "spin", _flying, _drifts, (5.0, 10.0, 20.0, 40.0), lambda spin: SPIN / spin),
    Experiment("whirl", "step", lambda x: whirling_crank().with_(duration=LONG), _trend),
    Experiment(
        "size",
        "size",
        lambda size: resized(cranks(), size),
        lambda scene, run, x, base: {"motion": _unlike(cranks(), x, np.zeros(3), run, base)},
        (1.0, 1e-3, 1e-2, 1e-1, 10.0, 100.0),
        math.sqrt,
        True,
    ),
    Experiment(
        "distance",
        "distance",
        lambda distance: moved_away(four_bar(), distance),
        lambda scene, run, x, base: {"motion": _unlike(four_bar(), 1.0, x * WAY, run, base)},
        (0.0, 1.0, 10.0, 100.0, 1000.0),
        compares=True,
    ),
    Experiment("steps", "step", lambda x: four_bar(), _error),
)


def _apart(scene: Scene, run: Trajectory, x: float, base: Trajectory) -> Values:
    return {"motion": float(error_series(scene, run, base).max())}


NEWTON = {"solver": "Newton", "tolerance": TOLERANCE}
LARGE = 100.0  # m of the four-bar on which a solver's step is varied
SOLVERS = (
    Experiment(
        "solver by size",
        "size",
        lambda size: resized(four_bar(), size),
        _apart,
        (1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0),
        math.sqrt,
        exact=NEWTON,
    ),
    Experiment(
        "solver by size and tolerance",
        "size",
        lambda size: resized(four_bar(), size),
        _apart,
        (1.0, 0.01, 0.1, 10.0, 100.0),
        math.sqrt,
        exact=NEWTON,
        changed=lambda size, options: {"tolerance": options.get("tolerance", TOLERANCE) / size**2},
    ),
    Experiment("solver by step", "step", lambda x: resized(four_bar(), LARGE), _apart, exact=NEWTON),
)
