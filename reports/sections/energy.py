"""Section: energy balance over time, the energy minus the work of loads and drivers."""

from __future__ import annotations

from functools import partial

import numpy as np

from crosscheck.judge.energy import energy_series

from .. import time_series
from ..blocks import Block, Figure, Heading, Text
from ..runs import Run, SceneRuns, power

NO_BALANCE = (
    "No run has an energy balance: a driver or a damper does work, the bodies have no mass, the "
    "samples are too far apart to count the turns, or no run reached a second sample."
)


def render(scene_runs: SceneRuns) -> list[Block]:
    """Return the plot of the energy balance for the most accurate run of every family."""

    def measure(run: Run) -> list[np.ndarray] | None:
        drift = energy_series(scene_runs.scene, run.trajectory)
        return None if drift is None else [drift]

    heading, values = Heading("Energy balance over time"), time_series.series(scene_runs, measure)
    if not values:
        return [heading, Text(NO_BALANCE)]
    (low, least), (high, most) = time_series.largest(values)
    caption = (
        "Energy gained less the work of loads and drivers, as a fraction of the largest energy seen, in the "
        f"most accurate run of every family; zero is exact. The least maximum is {power(least)} "
        f"({' '.join(low)}), the greatest {power(most)} ({' '.join(high)})."
    )
    draw = partial(time_series.plot, scene_runs, values, ("energy error",))
    return [heading, Figure(f"{scene_runs.scene.name}-energy", caption, draw)]
