"""The start of a mechanism that is diagnosed, also of one whose drivers' rates contradict each other."""

from __future__ import annotations

import numpy as np

from mbref.equations.driver_conflicts import conflict_of_drivers
from mbref.equations.initial_state import Start, consistent_start, solve_positions
from mbref.equations.model import Model
from mbref.scene import SceneError


def diagnosed_start(model: Model) -> Start:
    """Return the consistent start; at rest if the rates of drivers contradict each other.

    Raises SceneError for the joint that is grossly violated.
    """
    try:
        return consistent_start(model)
    except SceneError:
        conflict = conflict_of_drivers(model.scene)
        if conflict is None or not conflict.of_rates or conflict.time > 0.0:
            raise
    q, _ = solve_positions(model, 0.0, model.start())
    at_rest = np.zeros(model.n)
    return Start(q, at_rest, 0.0, 0.0, at_rest)
