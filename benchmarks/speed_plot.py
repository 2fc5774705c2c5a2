"""Figure of `benchmarks/speed.py`: CPU time for a simulated second at each error level, scene by scene."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reports import figures
from reports.runs import short

LIMIT, NARROW = "limit", 0.06  # distance of the engines' marks, in data units


def draw(data: Mapping[str, Any]) -> Figure:
    """Return one panel for each error level; ``data`` is the benchmark's JSON document.

    An error level that an engine does not reach has no mark.
    """
    scenes = data["scenes"]
    levels = next(iter(scenes.values()))["levels"]
    costs = {name: _best(scene["curves"]) for name, scene in scenes.items()}
    engines = list(dict.fromkeys(engine for best in costs.values() for engine in best))
    figure, panels = figures.canvas(7.6, 2.5 * len(levels) + 0.8, len(levels))
    for i, (level, axes) in enumerate(zip(levels, panels, strict=True)):
        for place, engine in enumerate(engines):
            shift = NARROW * (place - (len(engines) - 1) / 2)
            points = [(x + shift, best[engine][i]) for x, best in enumerate(costs.values()) if engine in best]
            _mark(axes, engine, place, [(x, 1e3 * c) for x, c in points if math.isfinite(c)])
        axes.set(yscale="log", ylabel=f"ms at {short(level)}")
    panels[-1].set_xticks(
        range(len(costs)), [name.replace("_", " ") for name in costs], rotation=30, ha="right"
    )
    panels[0].set_title("CPU milliseconds per simulated second, each engine's best setting", fontsize=9)
    with matplotlib.rc_context(figures.STYLE):
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower left", ncols=len(engines))
    return figure


def _best(curves: Sequence[Mapping[str, Any]]) -> dict[str, list[float]]:
    """Return each engine's least cost at every error level, over its families."""
    found: dict[str, list[list[float]]] = {}
    for curve in curves:
        found.setdefault(curve["engine"], []).append([math.inf if c is None else c for c in curve["cost"]])
    return {engine: [min(costs) for costs in zip(*rows, strict=True)] for engine, rows in found.items()}


def _mark(axes: Axes, engine: str, place: int, points: Sequence[tuple[float, float]]) -> None:
    if points:
        colour = figures.GREY if engine == LIMIT else figures.colour(engine)
        marker = "_" if engine == LIMIT else figures.MARKERS[place % len(figures.MARKERS)]
        size = 12 if engine == LIMIT else 6
        axes.plot(*zip(*points, strict=True), marker, color=colour, label=engine, markersize=size)
