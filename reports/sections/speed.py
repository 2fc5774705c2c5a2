"""Section: computing time against error, one curve for each engine and family; failed runs are marks."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from matplotlib.gridspec import GridSpec

from crosscheck.study.record_view import UNTIMED

from .. import figures
from ..blocks import Block, Figure, Heading, Plot, Table, Text
from ..runs import WRONG, Curve, Run, SceneRuns, duration, short
from ..speed_figure import speed_svg, toggles

Failures = Mapping[tuple[Curve, str], Sequence[Run]]


def render(scene_runs: SceneRuns) -> list[Block]:
    """Return the plot, and the table that explains the marks of failed runs."""
    heading = Heading("Speed against error")
    drawable = [run for run in scene_runs.completed() if math.isfinite(run.error)]
    failures = failed(scene_runs.runs)
    if not drawable and not failures:
        return [heading, Text("No run has an error to plot: this scene has no truth to compare with.")]
    draw = partial(plot, scene_runs, failures)
    caption = _caption(scene_runs, drawable)
    picture = Figure(f"{scene_runs.scene.name}-speed", caption + _strip(scene_runs), draw)
    asked = Plot(caption, speed_svg(scene_runs, caption), toggles(scene_runs), picture)
    return [heading, asked if asked.svg else picture, *([_key(failures)] if failures else [])]


def failed(runs: Sequence[Run]) -> Failures:
    """Return the failed runs by curve and outcome; runs of a group have one number in the plot."""
    groups: dict[tuple[Curve, str], list[Run]] = {}
    for run in runs:
        if not run.completed:
            groups.setdefault((run.curve, run.outcome.label), []).append(run)
    return groups


def _caption(scene_runs: SceneRuns, drawable: Sequence[Run]) -> str:
    text = (
        "Seconds of stepping against the largest error of any body at any sample; further left is more "
        "accurate, lower is faster; families with “compiled” in their names call an engine without Python. "
        f"{len(scene_runs.completed())} of {len(scene_runs.runs)} runs completed."
    )
    if drawable:
        best = min(drawable, key=lambda run: run.error)
        quick = min(drawable, key=lambda run: run.seconds)
        text += (
            f" The least error is {best.said} ({best.label}, {duration(best.seconds)}); "
            f"the least time {duration(quick.seconds)} ({quick.label}, error {quick.said})."
        )
    if any(run.error < run.drawn[0] for run in drawable):
        text += " An error below the bound on the truth's own error is drawn at that bound."
    if wrong := sum(run.is_false_success for run in drawable):
        text += (
            f" {wrong} completed with an error above {short(WRONG)}: wrong, although reported as a success."
        )
    return text


def _strip(scene_runs: SceneRuns) -> str:
    """Draw failed runs into the picture that is not interactive."""
    if len(scene_runs.completed()) == len(scene_runs.runs):
        return ""
    return (
        " Failed runs are in the strip on the right at the time they took, or at its lower end if that is "
        "less than the time of any completed run; the key lists the reasons."
    )


def _key(failures: Failures) -> Table:
    rows = []
    for number, ((curve, _), runs) in enumerate(failures.items(), 1):
        first = min(runs, key=lambda run: run.t_end)
        ends = sorted({f"{run.t_end:.4g}" for run in runs}, key=float)
        span = ends[0] if len(ends) == 1 else f"{ends[0]} … {ends[-1]}"
        rows.append((str(number), *curve, str(len(runs)), first.outcome.label, span, first.reason))
    header = ("Mark", "Engine", "Family", "Runs", "Outcome", "End time (s)", "Reason of the earliest")
    return Table("The runs that did not complete.", header, rows, right=frozenset({0, 3, 5}))


def plot(scene_runs: SceneRuns, failures: Failures) -> Drawing:
    """Return a plot of time over error on logarithmic axes, with failed runs numbered in a strip at the
    right."""
    figure, (main,) = figures.canvas(7.6, 4.8)
    looks = figures.looks(scene_runs.curves())
    for curve, runs in scene_runs.curves().items():
        _draw_curve(main, curve, [r for r in runs if r.completed and math.isfinite(r.error)], looks[curve])
    main.set(
        xscale="log",
        yscale="log",
        xlabel="largest error (fraction of the mechanism's length, or rad)",
        ylabel="time of stepping (s)",
    )
    if failures:
        times = [run.seconds for run in scene_runs.completed()]
        _draw_strip(_beside(figure, main), failures, looks, foot=max(min(times, default=UNTIMED), UNTIMED))
    main.margins(0.06, 0.09)
    figures.legend_below(figure, main)
    return figure


def _draw_curve(axes: Axes, curve: Curve, runs: Sequence[Run], look: figures.Look) -> None:
    points = np.array([r.drawn for r in runs])
    if len(points):
        axes.plot(*points.T, label=" ".join(curve), markersize=5, alpha=0.9, **look)


def _beside(figure: Drawing, main: Axes) -> Axes:
    """Return a narrow strip at the right of ``main`` with a common time axis."""
    grid = GridSpec(1, 2, figure=figure, width_ratios=(5, 1))
    main.set_subplotspec(grid[0])
    with matplotlib.rc_context(figures.STYLE):
        strip = figure.add_subplot(grid[1], sharey=main)
    strip.set_facecolor("#f6f0ee")
    strip.spines["left"].set_visible(False)
    strip.tick_params(labelleft=False, which="both", left=False)
    strip.set(xticks=[], xlim=(0, 1), title="did not\ncomplete")
    strip.title.set_fontsize(8)
    return strip


def _draw_strip(strip: Axes, failures: Failures, looks: Mapping[Curve, figures.Look], foot: float) -> None:
    for number, ((curve, _), runs) in enumerate(failures.items(), 1):
        x = (number - 0.5) / len(failures)
        seconds = [max(run.seconds, foot) for run in runs]
        strip.plot([x] * len(runs), seconds, figures.FAILED, color=looks[curve]["color"], markersize=6)
        strip.annotate(
            str(number), (x, max(seconds)), (0, 6), textcoords="offset points", ha="center", fontsize=8
        )
