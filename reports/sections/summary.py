"""Section: the summary, with the least error of every engine and family, and the cost of given errors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from crosscheck.judge.metrics import cost_at_error
from crosscheck.judge.tolerances import EXCESS

from ..blocks import Block, Heading, Table, Text
from ..runs import LEVELS, WRONG, Curve, Run, SceneRuns, duration, ratio, short

HEADER = (
    "Engine",
    "Family",
    "Completed",
    "Least error",
    "Its settings",
    "Its time",
    *(f"At {short(level)}" for level in LEVELS),
    "Wrong or failed",
)

Costs = Mapping[Curve, Sequence[float]]  # seconds for each error of LEVELS; NaN if no run reaches the error


def render(groups: Sequence[SceneRuns]) -> list[Block]:
    """Return one table for each scene."""
    runs = [run for group in groups for run in group.runs]
    completed = sum(run.completed for run in runs)
    wrong = sum(run.is_false_success for run in runs)
    asked = [run for run in runs if run.completed and "rtol" in run.record["settings"]]
    short_of = sum(run.is_short_of_tolerance for run in asked)
    text = (
        f"Scenes: {len(groups)}; runs: {len(runs)}, in engines: {len({run.curve[0] for run in runs})}; "
        f"completed: {completed}. Under an error level stands the time to reach it, read off the family's "
        f"curve of time against error, as a multiple of the fastest; an en dash: not reached. "
        f"False successes: {wrong} of the completed runs have an error above {short(WRONG)}. "
        f"Completed runs with a relative tolerance: {len(asked)}; of these, with an error above {EXCESS:g} "
        f"times their tolerance: {short_of}."
    )
    return [Heading("Summary", 2), Text(text), *(block for group in groups for block in _scene(group))]


def _scene(group: SceneRuns) -> list[Block]:
    curves = group.curves()
    costs = {curve: [_cost(runs, level) for level in LEVELS] for curve, runs in curves.items()}
    fastest = [_least(costs, i) for i in range(len(LEVELS))]
    best = group.best()
    order = sorted(curves, key=lambda curve: _rank(best[curve], costs[curve]))
    rows = [_row(group, best[curve], costs[curve], fastest) for curve in order]
    caption = f"To t = {group.scene.duration:g} s. Fastest: {_winners(costs, fastest)}."
    table = Table(caption, HEADER, rows, right=frozenset({2, 3, 5, *range(6, 6 + len(LEVELS))}))
    return [Heading(group.scene.name), *_gate(group), table]


def _gate(group: SceneRuns) -> list[Block]:
    """Return a sentence on the comparison of the engines' mechanisms at the start; empty if the mechanisms
    were not compared."""
    if not group.gate:
        return []
    if reason := group.difference():
        return [
            Text(f"The engines simulate different mechanisms, so their times cannot be compared: {reason}.")
        ]
    engines = ", ".join(dict.fromkeys(record["engine"] for record in group.gate))
    return [Text(f"The same mechanism in {engines}: start, energy and first accelerations agree.")]


def _cost(runs: Sequence[Run], level: float) -> float:
    """Return the seconds at which the curve of the completed runs reaches an error; NaN if the curve does not
    reach the error."""
    usable = [run for run in runs if run.completed and math.isfinite(run.error)]
    cost = cost_at_error([run.seconds for run in usable], [run.error for run in usable], level)
    return math.nan if cost is None else cost


def _least(costs: Costs, level: int) -> float:
    return min((c[level] for c in costs.values() if math.isfinite(c[level])), default=math.nan)


def _rank(best: Run, costs: Sequence[float]) -> tuple[bool, float, float]:
    """Return the sort key of a curve: completed runs first, then the cost at the middle level, then the least
    error."""
    middle = costs[len(costs) // 2]
    return not best.completed, middle if math.isfinite(middle) else math.inf, best.error


def _row(group: SceneRuns, best: Run, costs: Sequence[float], fastest: Sequence[float]) -> tuple[str, ...]:
    runs = group.curves()[best.curve]
    ratios = [ratio(cost / least) for cost, least in zip(costs, fastest, strict=True)]
    least: tuple[str, str, str] = ("–", "–", "–")
    if best.completed:
        least = best.said, group.varied_settings(best), duration(best.seconds)
    done = f"{sum(run.completed for run in runs)} of {len(runs)}"
    return (*best.curve, done, *least, *ratios, _otherwise(runs))


def _otherwise(runs: Sequence[Run]) -> str:
    """Return the number of wrong runs that completed, and the earliest end time for each other outcome."""
    wrong = sum(run.is_false_success for run in runs)
    earliest: dict[str, float] = {}
    for run in runs:
        if not run.completed:
            earliest[run.outcome.label] = min(run.t_end, earliest.get(run.outcome.label, math.inf))
    found = [f"{wrong} with error above {short(WRONG)}"] if wrong else []
    if short_of := sum(run.is_short_of_tolerance for run in runs):
        found.append(f"{short_of} with error above {EXCESS:g} rtol")
    return ", ".join([*found, *(f"{label} from {t:.4g} s" for label, t in earliest.items())])


def _winners(costs: Costs, fastest: Sequence[float]) -> str:
    parts = []
    for i, (level, least) in enumerate(zip(LEVELS, fastest, strict=True)):
        names = [" ".join(curve) for curve, cost in costs.items() if cost[i] == least]
        parts.append(
            f"at {short(level)} {names[0]} ({duration(least)})" if names else f"at {short(level)} none"
        )
    return ", ".join(parts)
