"""Measured order of convergence: how the error falls with the mean step, family by family."""

from __future__ import annotations

import math
from collections.abc import Sequence

from crosscheck.metrics import order_of_convergence
from reports.blocks import Block, Heading, Table, Text
from reports.runs import Curve, Run, SceneRuns, number

APART = 1.05  # runs whose mean steps are nearer than this ratio count as one
HEADER_START = ("Engine", "Family")


def render(groups: Sequence[SceneRuns]) -> list[Block]:
    """One table: engines and families down, scenes across."""
    text = (
        "The slope of log(error) over log(mean step), which is end time / steps, where at least three "
        "completed runs of a family lie on a line: a method of order p shows p, a slope near zero is a "
        "floor, and an en dash says that no three do."
    )
    curves = list(dict.fromkeys(curve for group in groups for curve in group.curves()))
    rows = [(*curve, *(number(slope(group, curve), 2) for group in groups)) for curve in sorted(curves)]
    header = (*HEADER_START, *(group.scene.name for group in groups))
    table = Table(_caption(groups, curves), header, rows, right=frozenset(range(2, len(header))))
    return [Heading("Order of convergence", 2), Text(text), table]


def slope(group: SceneRuns, curve: Curve) -> float:
    """The measured order of one family in one scene; NaN where they do not tell."""
    points = sorted((_step(run), run.error) for run in group.curves().get(curve, ()) if _tells(run))
    apart = [p for i, p in enumerate(points) if i == 0 or p[0] > APART * points[i - 1][0]]
    order = order_of_convergence([step for step, _ in apart], [error for _, error in apart])
    return math.nan if order is None else order


def _step(run: Run) -> float:
    """The mean step, s."""
    return run.t_end / run.record["cost"]["steps"]


def _tells(run: Run) -> bool:
    return run.completed and run.record["cost"]["steps"] > 0 and math.isfinite(run.error) and run.error > 0


def _caption(groups: Sequence[SceneRuns], curves: Sequence[Curve]) -> str:
    slopes = {(c, g.scene.name): slope(g, c) for g in groups for c in curves}
    finite = {key: value for key, value in slopes.items() if math.isfinite(value)}
    if not finite:
        return "No family has three runs on a line."
    (low, low_scene), (high, high_scene) = min(finite, key=finite.get), max(finite, key=finite.get)
    return (
        f"Orders from {finite[low, low_scene]:.2g} ({' '.join(low)}, {low_scene}) to "
        f"{finite[high, high_scene]:.2g} ({' '.join(high)}, {high_scene})."
    )
