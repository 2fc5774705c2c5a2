"""The cheapest settings of an engine that reach an error, family by family."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from crosscheck.study.grid import Case, Record
from crosscheck.study.record_view import error, error_bound, is_completed


class Tuned(NamedTuple):
    """All records that were made, and of every family that reaches the error the coarsest that does."""

    records: list[Record]
    reached: list[Record]


def tuned(cases: Sequence[Case], level: float, run: Callable[[Sequence[Case]], list[Record]]) -> Tuned:
    """Run every family of one engine on one scene from coarse to fine until it reaches an error.

    A family is given up where it ran out of time or costs more than another that has reached it.
    """
    families: dict[str, list[Case]] = {}
    for case in cases:
        families.setdefault(case.setting.family, []).append(case)
    records: list[Record] = []
    reached: list[Record] = []
    while families:
        found = run([left[0] for left in families.values()])
        records += found
        reached += [record for record in found if _reaches(record, level)]
        limit = min((r["cost"]["seconds"] for r in reached), default=float("inf"))
        families = {
            name: left[1:]
            for (name, left), record in zip(families.items(), found, strict=True)
            if len(left) > 1 and not _reaches(record, level) and _may_be_cheaper(record, limit)
        }
    return Tuned(records, sorted(reached, key=lambda record: record["cost"]["seconds"]))


def _reaches(record: Record, level: float) -> bool:
    """Whether a run is known to be so near: an error below the bound of the truth tells no more."""
    bound = error_bound(record)
    return is_completed(record) and max(error(record), bound) <= level


def _may_be_cheaper(record: Record, limit: float) -> bool:
    """Whether a finer setting of the family could cost less than ``limit`` (s)."""
    return record["outcome"] != "TIMED_OUT" and record["cost"]["seconds"] < limit
