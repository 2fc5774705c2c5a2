"""Runs of a report: all settings of all engines on all scenes, or the quick selection."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from crosscheck.setting import AS_IN_FILE
from crosscheck.study.grid import Case, Unable, default_cases
from crosscheck.study.ladder import families
from mbref.scene import Scene
from mbref.scenes import SCENES

QUICK_SCENES = {  # name → end time (s)
    "planar_slider_crank": 0.2,
    "spatial_slider_crank": 0.02,
    "spatial_slider_crank_driven": 0.05,
    "four_bar": 0.05,
    "five_bar": 0.05,
}
QUICK_FAMILIES = (AS_IN_FILE, "defaults", "tuned", "forward, compiled", "newton, compiled")  # else: the first
# quick sweep: largest number of families of an engine, and of settings of a family
MOST_FAMILIES, MOST_SETTINGS = 2, 3
QUICK_SAMPLES, SAMPLES = 31, 101
QUICK_LIMIT, LIMIT = 5.0, 120.0  # CPU seconds of a run

LONG, QUICK_LONG = 0.5, 0.05  # s; longer runs are not timed again, and their single run counts
Sweep = tuple[list[Case], list[Unable]]


def whole_scenes() -> list[Scene]:
    """Return every built-in scene."""
    return [make() for make in SCENES.values()]


def quick_scenes() -> list[Scene]:
    """Return a few built-in scenes with short durations."""
    return [SCENES[name]().with_(duration=end) for name, end in QUICK_SCENES.items()]


def whole(scenes: Sequence[Scene], engines: Sequence[str]) -> Sweep:
    """Return the runs of the scenes in every engine at every setting, and the refusals."""
    return _sweep(scenes, engines, SAMPLES, LIMIT)


def quick(scenes: Sequence[Scene], engines: Sequence[str]) -> Sweep:
    """Return runs at every setting of a few families of each engine, and the refusals; `study.ladder` selects
    settings among them."""
    cases, unable = _sweep(scenes, engines, QUICK_SAMPLES, QUICK_LIMIT)
    return of_few_families(cases), unable


def _sweep(scenes: Sequence[Scene], engines: Sequence[str], samples: int, limit: float) -> Sweep:
    cases, unable = [], []
    for scene in scenes:
        able, not_able = default_cases(scene, engines, None, np.linspace(0, scene.duration, samples), limit)
        cases += able
        unable += not_able
    return cases, unable


def of_few_families(cases: Sequence[Case], named: Collection[str] = ()) -> list[Case]:
    """Keep for each scene and engine the ``named`` families, or the QUICK_FAMILIES, or the first
    MOST_FAMILIES."""
    groups: dict[tuple[str, str], list[Case]] = {}
    for case in cases:
        groups.setdefault((case.scene.name, case.engine), []).append(case)
    return [case for group in groups.values() for case in _of_few(group, named or QUICK_FAMILIES)]


def thinned(cases: Sequence[Case]) -> list[Case]:
    """Keep at most MOST_SETTINGS settings of each family, ends included."""
    return [case for family in families(cases) for case in spread(family, MOST_SETTINGS)]


def _of_few(cases: Sequence[Case], named: Collection[str]) -> list[Case]:
    """Return the cases of few families; all cases belong to one scene and engine."""
    having = list(dict.fromkeys(case.setting.family for case in cases))
    wanted = [f for f in having if f in named] or having[:MOST_FAMILIES]
    return [case for family in wanted for case in cases if case.setting.family == family]


def spread(items: Sequence[Case], most: int) -> list[Case]:
    """Return at most ``most`` of the items, equally spaced, including the first and the last."""
    places = np.linspace(0, len(items) - 1, min(most, len(items))).round().astype(int)
    return [items[i] for i in places]
