"""Plot of a synthesis: the goal's columns before and after, and the wanted points."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from mbref.design.synthesis.result import SynthesisResult
from mbref.motions.drawing.plot import Tabulated, plot
from mbref.motions.outputs import UNIT_OF, quantity_of
from mbref.scene import Scene
from mbref.simulation.simulate import simulate

CURVE_SAMPLES = 201
WANTED = "wanted"


class _Points(NamedTuple):
    """Wanted values of columns over time, by name."""

    table: dict[str, np.ndarray]

    def columns(self) -> dict[str, np.ndarray]:
        """Return the columns (k,) by name."""
        return self.table


def before_and_after(scene: Scene, found: SynthesisResult, points: bool) -> Any:
    """Return a matplotlib figure of the columns of a result and of the scene before, with the wanted
    ``points``; two components of one position are drawn as a path. Raises ImportError without matplotlib."""
    times = np.linspace(0.0, max(scene.duration, found.times[-1]), CURVE_SAMPLES)
    motions: dict[str, Tabulated] = {
        label: simulate(each, times=times) for label, each in (("before", scene), ("after", found.scene))
    }
    if points:
        wanted = dict(zip(found.columns, found.wanted.T, strict=True))
        motions[WANTED] = _Points({"time": found.times, **wanted})
    is_path = points and len(found.columns) == 2 and {UNIT_OF[quantity_of(c)] for c in found.columns} == {"m"}
    shown = found.columns[1:] if is_path else found.columns
    figure = plot(motions, *shown, over=found.columns[0] if is_path else "time")
    if is_path:
        figure.axes[0].set_aspect("equal", adjustable="datalim")
    for axes in figure.axes:
        for line, key in zip(axes.get_lines(), axes.get_legend().legend_handles, strict=True):
            if str(line.get_gid()).endswith(WANTED):
                for each in (line, key):
                    each.set(marker="o", linestyle="")
    return figure
