"""Section: constraint violation over time, from the poses and velocities of the records."""

from __future__ import annotations

from functools import partial

import numpy as np

from crosscheck.judge.violations import violation_series

from .. import time_series
from ..blocks import Block, Figure, Heading, Text
from ..runs import Run, SceneRuns, power

LABELS = ("position (rad, or of the length)", "velocity (per second)")


def render(scene_runs: SceneRuns) -> list[Block]:
    """Return plots of the violation at position and velocity level for the most accurate run of every
    family."""

    def measure(run: Run) -> list[np.ndarray]:
        levels = [violation_series(scene_runs.scene, run.trajectory, i) for i in range(len(LABELS))]
        return [level for level in levels if level is not None]  # only accelerations can be missing

    heading, values = Heading("Constraint violation over time"), time_series.series(scene_runs, measure)
    if not values:
        return [heading, Text("No run reached a second sample.")]
    (low, least), (high, most) = time_series.largest(values)
    caption = (
        "Largest violation of any joint in the most accurate run of every family; lower is better, a rising "
        "line is drift, a cross where a run ended early. At position level the least maximum is "
        f"{power(least)} "
        f"({' '.join(low)}), the greatest {power(most)} ({' '.join(high)})."
    )
    draw = partial(time_series.plot, scene_runs, values, LABELS)
    return [heading, Figure(f"{scene_runs.scene.name}-violation", caption, draw)]
