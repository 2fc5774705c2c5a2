"""Plots of measured quantities over time, one line for the most accurate run of every engine and family."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from . import figures
from .runs import Curve, Run, SceneRuns

SMALLEST = 1e-17  # smaller magnitudes are plotted at this value, since a logarithmic axis has no zero

Panels = Sequence[np.ndarray]
Series = Mapping[Curve, Panels]  # for each curve one (k,) array per panel


def series(scene_runs: SceneRuns, measure: Callable[[Run], Panels | None]) -> dict[Curve, Panels]:
    """Return ``measure`` of the best run of every curve that has at least two samples; curves without values
    are left out."""
    best = {curve: run for curve, run in scene_runs.best().items() if len(run.trajectory.times) > 1}
    measured = {curve: measure(run) for curve, run in best.items()}
    return {curve: panels for curve, panels in measured.items() if panels is not None}


def plot(scene_runs: SceneRuns, values: Series, labels: Sequence[str]) -> Figure:
    """Return a plot of magnitudes over time on a logarithmic axis, one panel for each label; a cross marks an
    early end."""
    figure, panels = figures.canvas(7.2, 1.1 + 2.3 * len(labels), len(labels))
    looks, best = figures.looks(scene_runs.curves()), scene_runs.best()
    for i, (axes, label) in enumerate(zip(panels, labels, strict=True)):
        for curve, parts in values.items():
            run, look = best[curve], dict(looks[curve])
            times, sizes = run.trajectory.times, _drawable(parts[i])
            axes.plot(
                times, sizes, label=" ".join(curve), markevery=max(len(times) // 8, 1), markersize=3.5, **look
            )
            if not run.completed:
                axes.plot(times[-1], sizes[-1], figures.FAILED, color=look["color"], markersize=8)
        axes.set(yscale="log", ylabel=label)
    panels[-1].set_xlabel("t (s)")
    figures.legend_below(figure, panels[0])
    return figure


def _drawable(values: np.ndarray) -> np.ndarray:
    """Return magnitudes for a logarithmic axis; values that are not finite are removed."""
    sizes = np.abs(values)
    return np.where(np.isfinite(sizes), np.maximum(sizes, SMALLEST), np.nan)


def largest(values: Series, panel: int = 0) -> tuple[tuple[Curve, float], tuple[Curve, float]]:
    """Return the curves whose largest magnitude is least and greatest, with these magnitudes."""
    peaks = {curve: float(np.abs(parts[panel]).max()) for curve, parts in values.items()}
    return min(peaks.items(), key=lambda p: p[1]), max(peaks.items(), key=lambda p: p[1])
