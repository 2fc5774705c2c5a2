"""Selection of the settings of a family that run.

At quick depth the coarsest, the middle and the finest affordable setting run. A setting is affordable if the
runs of the coarsest and the middle setting predict a short run. At any depth coarser settings are added as
long as they reach the first error level.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from crosscheck.judge.tolerances import ERROR_LEVELS
from crosscheck.study.between import STILL_CHEAPER, coarser, longest_step, work
from crosscheck.study.grid import Case, Record, key
from crosscheck.study.record_view import error, is_completed

AFFORDABLE = 3.0  # most CPU seconds of stepping that are expected of the finest run
SCALING = "step"  # name of the option for fixed steps: the cost is inversely proportional to it

Family = Sequence[Case]  # the settings of one engine and family on one scene, coarse to fine


def families(cases: Sequence[Case]) -> list[Family]:
    """Return the cases grouped by scene, engine and family."""
    found: dict[tuple[str, str, str], list[Case]] = {}
    for case in cases:
        found.setdefault((case.scene.name, case.engine, case.setting.family), []).append(case)
    return list(found.values())


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
