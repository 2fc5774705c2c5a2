"""Verdicts computed from records: each engine's grade on a scene, by its best setting and by its defaults."""

from __future__ import annotations

import enum
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from crosscheck.judge.metrics import cost_at_error, error_series
from crosscheck.judge.tolerances import FALSE_SUCCESS, FLOOR
from crosscheck.study.grid import Record
from crosscheck.study.least_errors import LeastError, least_errors
from crosscheck.study.record_view import error, is_completed
from mbref.scene import Scene
from mbref.trajectory import Trajectory

DEFAULTS = "defaults"  # the family of an engine's settings as its library has them


class Grade(enum.Enum):
    """A record's grade by its error alone; an engine's own message of success does not count."""

    RIGHT = "right"
    INACCURATE = "inaccurate"
    WRONG = "wrong"
    FAILED = "failed"
    UNJUDGED = "unjudged"

    def __str__(self) -> str:
        return self.value


LIMITS = {Grade.RIGHT: FLOOR, Grade.INACCURATE: FALSE_SUCCESS}  # largest errors


def grade(record: Record) -> Grade:
    """RIGHT up to FLOOR, INACCURATE up to FALSE_SUCCESS, else WRONG; UNJUDGED where there is no truth."""
    if not is_completed(record):
        return Grade.FAILED
    if record["metrics"].get("error") is None:
        return Grade.UNJUDGED
    return next((g for g, limit in LIMITS.items() if error(record) <= limit), Grade.WRONG)


@dataclass(frozen=True)
class Judged:
    """A scene, the record of its truth (`study.truths`), and the records of its runs."""

    scene: Scene
    truth: Record
    records: Sequence[Record]

    @property
    def redundant(self) -> int:
        """Rows of the constraints that depend on others at the start."""
        return self.scene.counts().redundant

    def engines(self) -> dict[str, LeastError]:
        """The families' best records by engine, in the order of the records."""
        return {least.engine: least for least in least_errors(self.records)}

    def best(self) -> dict[str, Record]:
        """Of every engine the record of least error, else the one that got furthest."""
        return {name: least.best for name, least in self.engines().items()}

    def defaults(self) -> dict[str, Record]:
        """Of every engine that has a family of the library's defaults, the best record of it."""
        found = self.engines().items()
        return {name: least.families[DEFAULTS] for name, least in found if DEFAULTS in least.families}

    def costs(self, level: float) -> dict[str, float]:
        """CPU seconds of stepping in which an engine's best family reaches an error; only those that do."""
        found = {name: _least_cost(least, level) for name, least in self.engines().items()}
        return {name: cost for name, cost in found.items() if math.isfinite(cost)}

    def cheapest(self, level: float) -> dict[str, Record]:
        """Of every engine the fastest completed record within an error; only those that have one."""
        reached = [r for r in self.records if is_completed(r) and error(r) <= level]
        by_cost = sorted(reached, key=lambda r: r["cost"]["seconds"])
        return {r["engine"]: r for r in reversed(by_cost)}

    def agreement(self) -> dict[tuple[str, str], float]:
        """Largest differences between the finest completed runs of two engines, where there is no truth."""
        finest = {r["engine"]: r for r in self.records if is_completed(r)}
        motions = {n: Trajectory.from_record(self.scene.name, r) for n, r in finest.items()}
        names = list(motions)
        return {
            (a, b): float(error_series(self.scene, motions[a], motions[b]).max(initial=0.0))
            for i, a in enumerate(names)
            for b in names[i + 1 :]
            if np.array_equal(motions[a].times, motions[b].times)
        }


def _least_cost(least: LeastError, level: float) -> float:
    costs = []
    for family in least.families:
        usable = [
            r for r in least.records if r["family"] == family and is_completed(r) and math.isfinite(error(r))
        ]
        cost = cost_at_error([r["cost"]["seconds"] for r in usable], [error(r) for r in usable], level)
        costs.append(math.inf if cost is None else cost)
    return min(costs, default=math.inf)


def judged(scenes: Sequence[Scene], truths: Sequence[Record], records: Sequence[Record]) -> list[Judged]:
    """The scenes that have records, each with its truth and its records."""
    truth_of: dict[str, Any] = {truth["scene"]: truth for truth in truths}
    groups = [Judged(s, truth_of[s.name], [r for r in records if r["scene"] == s.name]) for s in scenes]
    return [group for group in groups if group.records]
