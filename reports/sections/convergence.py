"""Section: order of convergence over step or tolerance for each family, and the error that remains as h →
0."""

from __future__ import annotations

import math
from collections.abc import Sequence

from crosscheck.judge.metrics import error_series, order_of_convergence
from crosscheck.judge.richardson import limit

from ..blocks import Block, Heading, Table, Text
from ..runs import Curve, Run, SceneRuns, number, power

STEP = "step"
TELLING = 5.0  # ratio of bias to discretisation error; a smaller bias may be due to the extrapolation itself
LIMITS = (
    "Scene",
    "Engine",
    "Family",
    "Finest step (s)",
    "Order",
    "Its error",
    "Discretisation",
    "Bias",
    "Larger",
)


def render(groups: Sequence[SceneRuns]) -> list[Block]:
    """Return one table with engines and families as rows and scenes as columns."""
    text = (
        "The slope of log(error) over log(setting) where at least three completed runs of a family lie on"
        " a line. Over a fixed step it is the order of the method; over a tolerance, 1 says that the "
        "error is proportional to the tolerance. A slope near zero: the error no longer decreases; an en "
        "dash: no three runs lie on"
        " a line."
    )
    curves = sorted({curve for group in groups for curve in group.curves()})
    rows = [_row(groups, curve) for curve in curves]
    header = ("Engine", "Family", "Over", *(group.scene.name for group in groups))
    table = Table(_caption(groups, curves), header, rows, right=frozenset(range(3, len(header))))
    return [Heading("Order of convergence", 2), Text(text), table, *_limits(groups)]


def _limits(groups: Sequence[SceneRuns]) -> list[Block]:
    """Return the limits of fixed-step families as h → 0; empty if no family has three converging runs."""
    text = (
        "Three runs whose differences shrink as a power of the step have a limit at h = 0 (Richardson), "
        "found without the truth. The distance of the finest run from the limit is its discretisation error. "
        "The distance of the limit from the truth is its bias, which no smaller step removes: the compliance "
        "of a soft constraint, or a solver's tolerance. A bias of up to a few discretisation errors may be "
        "an error of the extrapolation: then the last column has an en dash."
    )
    rows = [row for group in groups for row in _limit_rows(group)]
    if not rows:
        return []
    biased = sum(row[-1] == "bias" for row in rows)
    caption = f"Limits of {len(rows)} sweeps; in {biased} of them bias outweighs discretisation."
    return [
        Heading("The limit h → 0"),
        Text(text),
        Table(caption, LIMITS, rows, right=frozenset(range(3, 8)), folded=True),
    ]


def _limit_rows(group: SceneRuns) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for curve, runs in group.curves().items():
        judged = [run for run in runs if run.completed and math.isfinite(run.error)]
        if swept_option(judged) != STEP:
            continue
        steps = [run.record["settings"][STEP] for run in judged]
        found = limit(group.scene, steps, [run.trajectory for run in judged])
        exact = None if found is None else group.exact(found.motion.times)
        if found is not None and exact is not None:
            bias = float(error_series(group.scene, found.motion, exact).max())
            finest = min(judged, key=lambda run: run.record["settings"][STEP])
            more = _heavier(bias, found.discretisation)
            rows.append(
                (
                    group.scene.name,
                    *curve,
                    f"{min(steps):.2g}",
                    number(found.order, 2),
                    power(finest.error),
                    power(found.discretisation),
                    power(bias),
                    more,
                )
            )
    return rows


def _heavier(bias: float, discretisation: float) -> str:
    if bias > TELLING * discretisation:
        return "bias"
    return "discretisation" if bias < discretisation else "–"


def _row(groups: Sequence[SceneRuns], curve: Curve) -> tuple[str, ...]:
    options = dict.fromkeys(swept_option(group.curves().get(curve, ())) for group in groups)
    return (*curve, ", ".join(filter(None, options)), *(number(slope(group, curve), 2) for group in groups))


def swept_option(runs: Sequence[Run]) -> str | None:
    """Return the first numeric option whose value differs between the runs."""
    settings = [run.record["settings"] for run in runs]
    for name in settings[0] if settings else ():
        values = [s.get(name) for s in settings]
        if all(isinstance(value, int | float) for value in values) and len(set(values)) > 1:
            return name
    return None


def slope(group: SceneRuns, curve: Curve) -> float:
    """Return the slope of log(error) over the logarithm of the varied option; NaN without three runs on a
    line."""
    runs = group.curves().get(curve, ())
    option = swept_option(runs)
    if option is None:
        return math.nan
    judged = [run for run in runs if run.completed]
    order = order_of_convergence(
        [run.record["settings"][option] for run in judged], [run.error for run in judged]
    )
    return math.nan if order is None else order


def _caption(groups: Sequence[SceneRuns], curves: Sequence[Curve]) -> str:
    slopes = {(c, g.scene.name): slope(g, c) for g in groups for c in curves}
    finite = {key: value for key, value in slopes.items() if math.isfinite(value)}
    if not finite:
        return "No family has three runs on a line."
    (low, low_scene), (high, high_scene) = (
        min(finite, key=finite.__getitem__),
        max(finite, key=finite.__getitem__),
    )
    if len(finite) == 1:
        return f"One slope: {finite[low, low_scene]:.2g} ({' '.join(low)}, {low_scene})."
    return (
        f"Slopes from {finite[low, low_scene]:.2g} ({' '.join(low)}, {low_scene}) to "
        f"{finite[high, high_scene]:.2g} ({' '.join(high)}, {high_scene})."
    )
