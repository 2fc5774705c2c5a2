"""Grades of engines computed from records: on each scene, at the best setting and at the defaults."""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

import numpy as np

from crosscheck.judge.metrics import cost_at_error, error_series
from crosscheck.judge.mobility import mobility
from crosscheck.judge.tolerances import FALSE_SUCCESS, FLOOR
from crosscheck.study.grid import Record
from crosscheck.study.record_view import error, error_bound, is_completed
from crosscheck.study.search.least_errors import LeastError, least_errors
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

Fastest = tuple[float, Record]  # CPU seconds, and the record of a run of the fastest family
DEFAULTS = "defaults"  # family of the settings that a library has by default


class Grade(enum.Enum):
    """Grade of a record by its error alone; an engine's own message of success does not count."""

    RIGHT = "right"
    INACCURATE = "inaccurate"
    WRONG = "wrong"
    FAILED = "failed"
    UNJUDGED = "unjudged"

    def __str__(self) -> str:
        return self.value


def grade(record: Record) -> Grade:
    """Return RIGHT for errors up to FLOOR or up to the bound on the truth's own error, INACCURATE up to
    FALSE_SUCCESS, otherwise WRONG; UNJUDGED without a truth."""
    if not is_completed(record):
        return Grade.FAILED
    if record["metrics"].get("error") is None:
        return Grade.UNJUDGED
    if error(record) <= max(FLOOR, error_bound(record)):
        return Grade.RIGHT
    return Grade.INACCURATE if error(record) <= FALSE_SUCCESS else Grade.WRONG


@dataclass(frozen=True)
class Judged:
    """A scene, the record of its truth (`study.truths`), and the records of its runs.

    ``differences`` has for each engine that simulates another mechanism a sentence on how it differs; such an
    engine is not judged.
    """

    scene: Scene
    truth: Record
    records: Sequence[Record]
    differences: Mapping[str, str] = field(default_factory=dict)

    @property
    def redundant(self) -> int:
        """Return the number of constraint rows at the start that depend on other rows."""
        return mobility(self.scene).redundant

    @property
    def comparable(self) -> Sequence[Record]:
        """Return the records of the engines that simulate this mechanism."""
        return [record for record in self.records if record["engine"] not in self.differences]

    @property
    def is_judged(self) -> bool:
        """True if the motion is known, and a run of a judged engine has an error or no engine completes the
        motion.

        Of an unknown motion the start alone is known, and a run that ends there has an error of 0.
        """
        runs = self.comparable
        if not (self.truth.get("kind") and runs):
            return False
        has_error = any(record["metrics"].get("error") is not None for record in runs)
        return has_error or not any(map(is_completed, runs))

    def grade(self, record: Record) -> Grade:
        """Return the grade of a record; UNJUDGED if its engine simulates another mechanism."""
        return Grade.UNJUDGED if record["engine"] in self.differences else grade(record)

    def engines(self) -> dict[str, LeastError]:
        """Return for each judged engine the best record of each family, in the order of the records."""
        return {least.engine: least for least in least_errors(self.comparable)}

    def best(self) -> dict[str, Record]:
        """Return for each engine the record of least error; without a truth the record of a finest run,
        otherwise the record that ended last."""
        return {name: least.best for name, least in self.engines().items()}

    def defaults(self) -> dict[str, Record]:
        """Return the best record by library defaults of each engine that has this family."""
        found = self.engines().items()
        return {name: least.families[DEFAULTS] for name, least in found if DEFAULTS in least.families}

    def costs(self, level: float) -> dict[str, float]:
        """Return for each engine the CPU seconds in which its best family reaches an error; engines that miss
        the error are left out."""
        return {name: cost for name, (cost, _) in self.fastest(level).items()}

    def fastest(self, level: float, without: Callable[[Record], bool] | None = None) -> dict[str, Fastest]:
        """Return for each engine the least seconds and a record of that family; ``without`` selects records
        whose families are left out."""
        found = {}
        for name, least in self.engines().items():
            costs = _family_costs(least, level)
            if without:
                costs = [pair for pair in costs if not without(pair[1])]
            if costs:
                found[name] = min(costs, key=lambda pair: pair[0])
        return found

    def cheapest(self, level: float) -> dict[str, Record]:
        """Return the fastest completed record within an error of each engine that has one."""
        reached = [r for r in self.comparable if is_completed(r) and error(r) <= level]
        by_cost = sorted(reached, key=lambda r: r["cost"]["seconds"])
        return {r["engine"]: r for r in reversed(by_cost)}

    def within(self, level: float, use: Callable[[Record], bool]) -> dict[str, Record]:
        """Return for each engine one record among the records that ``use`` accepts: the fastest completed one
        within an error, otherwise the most accurate."""
        usable = [r for r in self.comparable if is_completed(r) and math.isfinite(error(r)) and use(r)]
        order = sorted(usable, key=lambda r: (max(error(r), level), r["cost"]["seconds"]))
        return {r["engine"]: r for r in reversed(order)}

    def agreement(self) -> dict[tuple[str, str], float]:
        """Return for each pair of engines the largest difference between two completed runs, the finest ones
        of the families that agree best; used if there is no truth."""
        finest = {(r["engine"], r["family"]): r for r in self.comparable if is_completed(r)}
        motions: dict[str, list[Trajectory]] = {}
        for (name, _), record in finest.items():
            motions.setdefault(name, []).append(Trajectory.from_record(self.scene.name, record))
        found = {pair: self._apart(*(motions[name] for name in pair)) for pair in combinations(motions, 2)}
        return {pair: apart for pair, apart in found.items() if apart is not None}

    def _apart(self, first: Sequence[Trajectory], second: Sequence[Trajectory]) -> float | None:
        """Return the least of the largest differences between runs of two engines at equal times."""
        pairs = ((a, b) for a in first for b in second if np.array_equal(a.times, b.times))
        return min((float(error_series(self.scene, a, b).max(initial=0.0)) for a, b in pairs), default=None)


def _family_costs(least: LeastError, level: float) -> list[Fastest]:
    """Return for each family that reaches an error its CPU seconds and its record of least error."""
    costs = []
    for family, best in least.families.items():
        usable = [
            r for r in least.records if r["family"] == family and is_completed(r) and math.isfinite(error(r))
        ]
        cost = cost_at_error([r["cost"]["seconds"] for r in usable], [error(r) for r in usable], level)
        if cost is not None:
            costs.append((cost, best))
    return costs


def judged(
    scenes: Sequence[Scene],
    truths: Sequence[Record],
    records: Sequence[Record],
    differences: Mapping[str, Mapping[str, str]] | None = None,
) -> list[Judged]:
    """Return each scene with its truth, its records and the ``differences`` of its engines, which are keyed
    by scene name."""
    given = differences or {}
    truth_of: dict[str, Any] = {truth["scene"]: truth for truth in truths}
    groups = [
        Judged(s, truth_of[s.name], [r for r in records if r["scene"] == s.name], given.get(s.name, {}))
        for s in scenes
    ]
    return [group for group in groups if group.records]
