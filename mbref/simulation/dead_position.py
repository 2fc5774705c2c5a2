"""Dead positions: poses beyond which the mechanism cannot follow its drivers.

Near a dead position the velocities, over the rates of the drivers, grow with the inverse root of the
remaining time: Φ_q v = ν has no solution there. If branches of a motion cross, Φ_q also loses rank, but ν is
in the range of Φ_q, and the velocities are bounded. Near a dead position a state that violates the
constraints has large velocities, too; but then `taylor` can follow the motion further.
"""

from __future__ import annotations

import numpy as np

from mbref.simulation.trial import trial_of
from mbref.stepping.run import Run

TRANSMISSION = 1e2  # largest velocity / driver rate above which the position is dead
ROUNDED = 1e-13  # relative singular value below which rows are redundant
BEYOND = 1.01  # a run that gets beyond this multiple of the failure's time has met no dead position
MOST_DRIVEN_ROWS = 400  # constraint rows; larger least-squares problems take seconds


def is_at_dead_position(run: Run) -> bool:
    """Return whether a run that failed is at a dead position of its drivers."""
    state, model = run.memory.state, run.model
    if not run.scene.driver or model.m > MOST_DRIVEN_ROWS or not np.isfinite(state.coordinates).all():
        return False
    now, length = float(run.memory.loop.clock.time), model.length
    terms = model.terms(now, state.coordinates)
    jacobian = terms.jacobian * np.tile(np.repeat([length, 1.0], 3), model.nb)
    velocities = np.linalg.lstsq(jacobian, terms.nu, rcond=ROUNDED)[0]
    rate = np.abs(terms.nu).max() * max(1.0, 1.0 / length)
    if not np.abs(velocities).max() > TRANSMISSION * rate > 0.0:
        return False
    trial = trial_of(run)
    return trial is None or not (trial.completed or trial.reached > BEYOND * now)
