"""The runs of a report: the whole sweep, or the quick one."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from crosscheck.study.grid import Case, Unable, default_cases
from mbref.scene import Scene
from mbref.scenes import SCENES

QUICK_SCENES = {  # name → end time (s)
    "planar_slider_crank": 0.2,
    "spatial_slider_crank": 0.02,
    "spatial_slider_crank_driven": 0.05,
    "four_bar": 0.02,
    "five_bar": 0.02,
}
QUICK_FAMILIES = ("defaults", "tuned")  # of an engine that has them, else its first ones
MOST_FAMILIES, MOST_SETTINGS = 2, 3  # in the quick sweep, of an engine and of a family
QUICK_SAMPLES, SAMPLES = 31, 101
QUICK_LIMIT, LIMIT = 10.0, 120.0  # s of a run

LONG, QUICK_LONG = 0.5, 0.05  # s; runs that take longer are timed by their single run
Sweep = tuple[list[Case], list[Unable]]


def whole_scenes() -> list[Scene]:
    """Every built-in scene."""
    return [make() for make in SCENES.values()]


def quick_scenes() -> list[Scene]:
    """A few short ones."""
    return [SCENES[name]().with_(duration=end) for name, end in QUICK_SCENES.items()]


def whole(scenes: Sequence[Scene], engines: Sequence[str]) -> Sweep:
    """The scenes in every engine at every setting."""
    return _sweep(scenes, engines, SAMPLES, LIMIT)


def quick(scenes: Sequence[Scene], engines: Sequence[str]) -> Sweep:
    """The scenes at a few settings of a few families of every engine."""
    cases, unable = _sweep(scenes, engines, QUICK_SAMPLES, QUICK_LIMIT)
    return thinned(cases), unable


def _sweep(scenes: Sequence[Scene], engines: Sequence[str], samples: int, limit: float) -> Sweep:
    cases, unable = [], []
    for scene in scenes:
        able, not_able = default_cases(scene, engines, None, np.linspace(0, scene.duration, samples), limit)
        cases += able
        unable += not_able
    return cases, unable


def thinned(cases: Sequence[Case], named: Collection[str] = ()) -> list[Case]:
    """Of every scene and engine the ``named`` families, else MOST_FAMILIES, of each MOST_SETTINGS settings,
    ends included."""
    groups: dict[tuple[str, str], list[Case]] = {}
    for case in cases:
        groups.setdefault((case.scene.name, case.engine), []).append(case)
    return [case for group in groups.values() for case in _thinned_engine(group, named or QUICK_FAMILIES)]


def _thinned_engine(cases: Sequence[Case], named: Collection[str]) -> list[Case]:
    families: dict[str, list[Case]] = {}
    for case in cases:
        families.setdefault(case.setting.family, []).append(case)
    wanted = [f for f in families if f in named] or list(families)[:MOST_FAMILIES]
    return [case for family in wanted for case in spread(families[family], MOST_SETTINGS)]


def spread(items: Sequence[Case], most: int) -> list[Case]:
    """At most ``most`` of the items, equally spaced, first and last included."""
    places = np.linspace(0, len(items) - 1, min(most, len(items))).round().astype(int)
    return [items[i] for i in places]
