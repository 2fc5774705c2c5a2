"""Search for the cheapest settings of an engine that reach an error.

In every family the error is bracketed by two settings, starting from the coarsest, and the interval is
bisected.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from typing import NamedTuple

from crosscheck.engine import Setting
from crosscheck.judge.metrics import in_scene_order
from crosscheck.judge.openings import Opening, opening
from crosscheck.study.grid import Case, Record
from crosscheck.study.record_view import error, error_bound, error_text, is_completed
from crosscheck.study.search.neighbours import (
    MOST_COARSER,
    STILL_CHEAPER,
    between,
    coarser,
    longest_step,
    within,
    work,
)
from crosscheck.study.search.selection import Family, families
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

NEAR = 1.12  # ratio of the work of two settings below which no setting between them is tried
HALVINGS = 6  # largest number of bisections in a family
# CPU seconds of a run that misses the error / of the cheapest success, from which a family is given up: the
# seconds of two short runs differ by up to this factor on a busy machine
TOO_MUCH = 2.0

Run = Callable[[Sequence[Case]], list[Record]]


class Criterion(NamedTuple):
    """A criterion for runs: a number of the record must not exceed a level. The criterion has a name for
    sentences, a text for values, and a sentence on a number that is not known."""

    name: str
    level: float
    measure: Callable[[Record], float]
    text: Callable[[Record], str]
    unknown: Callable[[Record], str]


def by_error(level: float) -> Criterion:
    """Return the criterion that the error of a run is at most ``level``, the bound on the truth included."""
    unknown = "No error is known, because no truth of this motion is known."
    return Criterion(f"an error of {level:g}", level, known_error, error_text, lambda record: unknown)


def by_closure(gap: float, scene: Scene) -> Criterion:
    """Return the criterion that no joint's points are apart, and no coupling is off, by more than a gap
    (m)."""

    def measure(record: Record) -> float:
        return opened(record, scene).gap

    def unknown(record: Record) -> str:
        said = ", ".join(f"coupling {name!r}" for name in opened(record, scene).uncounted)
        return f"No closure gap is known: turns of {said} between samples cannot be counted (--duration)."

    def text(record: Record) -> str:
        found = measure(record)
        return f"{found * 1e3:.2g} mm" if math.isfinite(found) else "–"

    return Criterion(f"a closure gap of {gap * 1e3:g} mm", gap, measure, text, unknown)


def opened(record: Record, scene: Scene) -> Opening:
    """Return by how much the joints of a recorded run open (m and rad)."""
    return opening(scene, in_scene_order(scene, Trajectory.from_record(scene.name, record)))


def known_error(record: Record) -> float:
    """Return the error of a record or the bound on the truth's error, whichever is larger.

    An error below the bound does not prove a more accurate run.
    """
    return max(error(record), error_bound(record))


class Tuned(NamedTuple):
    """Result of a search: all records, and the cases and records of the cheapest run of each family that
    reaches the error, cheapest first."""

    records: list[Record]
    cases: list[Case]
    reached: list[Record]


def tuned(
    cases: Sequence[Case],
    level: float,
    run: Run,
    integrated_here: Collection[str] = (),
    advance: Callable[[str], None] = lambda family: None,
    measure: Callable[[Record], float] = known_error,
) -> Tuned:
    """Find the cheapest setting of every family of one engine on one scene that reaches an error, or
    the level of another ``measure``.

    The families with the cheapest coarsest run come first. The search in a family ends if a run is out of
    time, or misses the error and costs TOO_MUCH times the cheapest success so far. A success of a family
    ``integrated_here`` (by crosscheck) does not end the search in families of the engine's own integrators.
    ``advance`` receives the name of each finished family.
    """
    groups = [_distinct(family) for family in families(cases)]
    firsts = run([group[0] for group in groups])
    searches = [
        _Search(group, first, level, run, measure) for group, first in zip(groups, firsts, strict=True)
    ]
    for search in sorted(searches, key=lambda s: (s.is_any_of(integrated_here), s.cost())):
        rivals = [
            s for s in searches if search.is_any_of(integrated_here) or not s.is_any_of(integrated_here)
        ]
        search.carry_out(min((s.least() for s in rivals), default=math.inf))
        advance(search.family)
    found = sorted((pair for s in searches for pair in s.cheapest()), key=lambda pair: _seconds(pair[1]))
    records = [record for s in searches for _, record in s.made]
    return Tuned(records, [case for case, _ in found], [record for _, record in found])


def _distinct(family: Family) -> list[Case]:
    """Return the family without settings whose steps are longer than the interval between samples."""
    settings = within([case.setting for case in family], longest_step(family[0].times))
    return [family[0]._replace(setting=setting) for setting in settings]


Pair = tuple[Case, Record]


class _Search:
    """Search for the cheapest setting in one family, in which the coarsest setting has run."""

    def __init__(
        self,
        settings: Sequence[Case],
        first: Record,
        level: float,
        run: Run,
        measure: Callable[[Record], float],
    ) -> None:
        self._settings, self._level, self._run, self._measure = settings, level, run, measure
        self.family = settings[0].setting.family
        self.made = [(settings[0], first)]

    def is_any_of(self, names: Collection[str]) -> bool:
        """Return whether ``names`` contain the family's name."""
        return self.family in names

    def cost(self) -> float:
        """Return the CPU seconds of the coarsest run; infinite if it did not complete."""
        _, first = self.made[0]
        return _seconds(first) if is_completed(first) else math.inf

    def cheapest(self) -> list[Pair]:
        """Return a list with the run of least work that reaches the error; empty if no run reaches the
        error."""
        return sorted((p for p in self.made if self._reaches(p[1])), key=lambda pair: work(pair[1]))[:1]

    def least(self) -> float:
        """Return the CPU seconds of the cheapest run that reaches the error; infinite if no run reaches the
        error."""
        return min((_seconds(record) for _, record in self.cheapest()), default=math.inf)

    def carry_out(self, limit: float) -> None:
        """Bracket the error and bisect, as long as runs that miss the error cost less than TOO_MUCH times
        ``limit`` (s)."""
        [first] = self.made
        bracket = self._coarsened(first) if self._reaches(first[1]) else self._refined(first, limit)
        if bracket is not None:
            self._bisect(*bracket)

    def _coarsened(self, reached: Pair) -> tuple[Pair, Pair] | None:
        """Return the finest run that misses the error and the coarsest run that reaches the error, found
        among coarser settings. None if every coarser setting that saves work still reaches the error.
        """
        finer = self._settings[1].setting if len(self._settings) > 1 else self._settings[0].setting
        longest = longest_step(self._settings[0].times)
        for _ in range(MOST_COARSER):
            setting = coarser(reached[0].setting, finer, longest)
            if setting is None:
                return None
            tried = self._tried(setting)
            if not self._reaches(tried[1]):
                return tried, reached
            if work(tried[1]) > STILL_CHEAPER * work(reached[1]):
                return None
            finer, reached = reached[0].setting, tried
        return None

    def _refined(self, missed: Pair, limit: float) -> tuple[Pair, Pair] | None:
        """Return the last run that misses the error and the first run that reaches the error, found among
        finer settings. None if no setting reaches the error or the search ends at its limit.
        """
        for case in self._settings[1:]:
            if missed[1]["outcome"] == "TIMED_OUT" or _seconds(missed[1]) >= TOO_MUCH * limit:
                return None
            tried = self._tried(case.setting)
            if self._reaches(tried[1]):
                return missed, tried
            missed = tried
        return None

    def _bisect(self, missed: Pair, reached: Pair) -> None:
        for _ in range(HALVINGS):
            if is_completed(missed[1]) and work(reached[1]) <= NEAR * work(missed[1]):
                return
            setting = between(missed[0].setting, reached[0].setting)
            if setting is None:
                return
            tried = self._tried(setting)
            missed, reached = (missed, tried) if self._reaches(tried[1]) else (tried, reached)

    def _tried(self, setting: Setting) -> Pair:
        case = self._settings[0]._replace(setting=setting)
        [record] = self._run([case])
        self.made.append((case, record))
        return case, record

    def _reaches(self, record: Record) -> bool:
        """Return whether the run completed and its measured number is at most the level."""
        return is_completed(record) and self._measure(record) <= self._level


def _seconds(record: Record) -> float:
    return float(record["cost"]["seconds"])
