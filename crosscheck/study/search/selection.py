"""Selection of the runs of a study: its scenes, the families of each engine, and the settings of each family.

At quick depth the coarsest, the middle and the finest affordable setting run. A setting is affordable if the
runs of the coarsest and the middle setting predict a short run. At any depth coarser settings are added as
long as they reach the first error level.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence

import numpy as np

from crosscheck.judge.tolerances import ERROR_LEVELS
from crosscheck.setting import AS_IN_FILE
from crosscheck.study.grid import Case, Record, key
from crosscheck.study.record_view import error, is_completed
from crosscheck.study.search.neighbours import STILL_CHEAPER, coarser, longest_step, work
from crosscheck.study.search.offers import Unable, default_cases
from mbref.scene import Scene
from mbref.scenes import SCENES

AFFORDABLE = 3.0  # most CPU seconds of stepping that are expected of the finest run
SCALING = "step"  # name of the option for fixed steps: the cost is inversely proportional to it
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
FINEST = 3  # number of the finest settings of a family among which its least error is searched
LEAST_ERROR_LIMIT = 240.0  # CPU seconds of a run of least error

Family = Sequence[Case]  # the settings of one engine and family on one scene, coarse to fine
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
    """Return runs at every setting of a few families of each engine, and the refusals; `first`,
    `finest` and `beyond` select settings among them."""
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
    kept: list[Case] = []
    for group in _grouped(cases, lambda case: (case.scene.name, case.engine)):
        having = list(dict.fromkeys(case.setting.family for case in group))
        wanted = [f for f in having if f in (named or QUICK_FAMILIES)] or having[:MOST_FAMILIES]
        kept += [case for family in wanted for case in group if case.setting.family == family]
    return kept


def families(cases: Sequence[Case]) -> list[Family]:
    """Return the cases grouped by scene, engine and family."""
    return _grouped(cases, lambda case: (case.scene.name, case.engine, case.setting.family))


def thinned(cases: Sequence[Case]) -> list[Case]:
    """Keep at most MOST_SETTINGS settings of each family, equally spaced, ends included."""
    kept: list[Case] = []
    for family in families(cases):
        places = np.linspace(0, len(family) - 1, min(MOST_SETTINGS, len(family))).round().astype(int)
        kept += [family[i] for i in places]
    return kept


def candidates(scene: Scene, engines: Sequence[str]) -> list[Case]:
    """Return the finest settings of every family of each engine that can run the scene."""
    cases, _ = default_cases(scene, engines, time_limit=LEAST_ERROR_LIMIT)
    return [case for family in families(cases) for case in family[-FINEST:]]


def first(family: Family) -> list[Case]:
    """Return the coarsest and the middle setting of a family."""
    return [family[i] for i in dict.fromkeys((0, _middle(family)))]


def finest(family: Family, records: Mapping[str, Record]) -> list[Case]:
    """Return a list with the finest affordable setting beyond the middle one, by the records of ``first``;
    empty if no such setting exists."""
    costs = [_cost(records[key(case)]) for case in (family[0], family[_middle(family)])]
    beyond = range(len(family) - 1, _middle(family), -1)
    return [family[i] for i in beyond if _expected(family, costs, i) <= AFFORDABLE][:1]


def beyond(family: Family, records: Mapping[str, Record]) -> list[Case]:
    """Return a list with the setting next coarser than the coarsest setting that ran. The list is empty if
    the coarsest run failed, misses the first of ERROR_LEVELS or costs no less than the next finer run, or if
    no coarser setting exists.
    """
    run = [case for case in family if key(case) in records][:2]
    if len(run) < 2 or run[0] is not family[0]:
        return []
    first, second = (records[key(case)] for case in run)
    if not (is_completed(first) and error(first) <= ERROR_LEVELS[0]):
        return []
    if is_completed(second) and work(first) > STILL_CHEAPER * work(second):
        return []
    setting = coarser(family[0].setting, family[1].setting, longest_step(family[0].times))
    return [] if setting is None else [family[0]._replace(setting=setting)]


def _grouped(cases: Sequence[Case], name: Callable[[Case], tuple[str, ...]]) -> list[Family]:
    """Return the cases grouped by a name, in the order of the first case of each group."""
    found: dict[tuple[str, ...], list[Case]] = {}
    for case in cases:
        found.setdefault(name(case), []).append(case)
    return list(found.values())


def _middle(family: Family) -> int:
    return (len(family) - 1) // 2


def _cost(record: Record) -> float | None:
    """Return the CPU seconds of stepping of a completed run; infinite if it ran out of time."""
    if record["outcome"] == "TIMED_OUT":
        return float("inf")
    return float(record["cost"]["seconds"]) if is_completed(record) else None


def _expected(family: Family, costs: Sequence[float | None], i: int) -> float:
    """Return the expected CPU seconds of setting i.

    With fixed steps the middle run is scaled by the step. Otherwise the growth between the two runs is
    continued for each further setting. The result is 0 if neither run has a cost, so that the setting runs.
    """
    coarse, middle = costs
    known = middle if middle is not None else coarse
    if known is None:
        return 0.0
    start = _middle(family) if middle is not None else 0
    if SCALING in family[i].setting.options:
        was, will_be = (float(family[j].setting.options[SCALING]) for j in (start, i))
        return known * was / will_be
    if coarse is None or middle is None or not coarse or start == 0:
        return known
    return float(middle * max(middle / coarse, 1.0) ** ((i - start) / start))
