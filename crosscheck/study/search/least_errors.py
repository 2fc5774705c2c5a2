"""Least error of every engine on every scene, with its setting and its cost."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from crosscheck.judge.tolerances import FLOOR
from crosscheck.study.grid import Record
from crosscheck.study.record_view import by_scene, ended, error, error_text, is_completed, varied_settings

HEADER = ("scene", "engine", "family", "settings", "least error", "time (s)", f"within {FLOOR:.0e}", "others")


@dataclass(frozen=True)
class LeastError:
    """Best runs of an engine on a scene, one for each family; ``records`` are all its runs.

    The best run is the completed run of least error, without a truth the last completed one, otherwise the
    run that ended last.
    """

    scene: str
    engine: str
    families: Mapping[str, Record]
    records: Sequence[Record]

    @property
    def best(self) -> Record:
        """Return the best run of all families."""
        return _best(list(self.families.values()))

    @property
    def is_reached(self) -> bool:
        """Return whether a completed run has an error of at most FLOOR."""
        return _reaches(self.best)

    def share(self) -> str:
        """Return the number of families of settings whose error is at most FLOOR, and the number of all
        families."""
        return f"{sum(map(_reaches, self.families.values()))} of {len(self.families)}"

    def row(self) -> tuple[str, ...]:
        """Return the cells of a table row under HEADER."""
        best = self.best
        within = [name for name, record in self.families.items() if _reaches(record)]
        others = [f"{name} {_said(r)}" for name, r in self.families.items() if not _reaches(r)]
        return (
            self.scene,
            self.engine,
            best["family"],
            varied_settings(best, self.records),
            _said(best),
            f"{best['cost']['seconds']:.2g}",
            "; ".join(within),
            "; ".join(others),
        )


def least_errors(records: Sequence[Record]) -> list[LeastError]:
    """Return one LeastError for each scene and engine, in the order of the records."""
    found = []
    for scene, group in by_scene(records).items():
        for engine in dict.fromkeys(record["engine"] for record in group):
            own = [record for record in group if record["engine"] == engine]
            families = dict.fromkeys(record["family"] for record in own)
            best = {name: _best([r for r in own if r["family"] == name]) for name in families}
            found.append(LeastError(scene, engine, best, own))
    return found


def _best(records: Sequence[Record]) -> Record:
    """Return the first record by ``rank``; the last completed one, which is finest, if no error is known."""
    found = min(records, key=rank)
    if not is_completed(found) or math.isfinite(error(found)):
        return found
    return [record for record in records if is_completed(record)][-1]


def rank(record: Record) -> tuple[bool, float, float]:
    """Return the order of a run: completed runs by their error, before others by their end time."""
    done = is_completed(record)
    return not done, 0.0 if done else -record["t_end"], error(record)


def _reaches(record: Record) -> bool:
    return is_completed(record) and error(record) <= FLOOR


def _said(record: Record) -> str:
    """Return the error as text, or how and when the run ended."""
    return error_text(record) if is_completed(record) else ended(record)
