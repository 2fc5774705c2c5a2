"""Control of the stepping loop: limits that follow from the options, the method and the scene."""

from __future__ import annotations

from typing import Any

import numpy as np

from mbref.equations.model import Model
from mbref.kernels.layout import Control
from mbref.method import Method
from mbref.stepping.limits import Limits

STEPS_PER_CALL = 500  # steps between returns to Python, which handles interrupts, progress, time limits
# rad; largest rotation of a body in a step if torsion springs need unwrapped angles: two bodies turn by less
# than π
UNWRAPPED = 1.0
# Φ' / sum of the sizes of its terms, above which rows contradict a rolling wheel, and part of the largest
# such sum that counts for smaller ones: of states that satisfy all rows, where consistent rows leave less
# than 1e-12, and of states that drift
CONTRADICTING, DRIFTING = (1e-8, 0.1), (1e-4, 1.0)
RESTING = 1e-10  # lengths of the mechanism, or rad, over the end time: slower motions are rounding of rest


def control_of(model: Model, method: Method, times: np.ndarray, limits: Limits) -> Control:
    """Return the limits of a run that ends at the last of the times (k,), s."""
    integrator, span = method.integrator, float(times[-1]) or 1.0
    options, largest_step = method.options_of(integrator), limits.largest_step or span
    turn = min(method.stabilisation.largest_turn, UNWRAPPED if model.has_angles else np.inf)
    exact = method.stabilisation.projects or method.stabilisation.chooses_coordinates
    return Control(
        order=integrator.highest_order(options),
        fixed_step=0.0 if integrator.adaptive else min(options["step"], largest_step),
        smallest_step=limits.smallest_step or 1e-12 * span,
        largest_step=largest_step,
        largest_turn=limits.largest_turn or turn,
        violation=largest_violation(limits, model.length),
        rate=CONTRADICTING[0] if exact else max(DRIFTING[0], limits.rtol),
        rate_share=CONTRADICTING[1] if exact else DRIFTING[1],
        rest=RESTING * min(1.0, model.length) / span,
        most_steps=limits.most_steps,
        steps_per_call=STEPS_PER_CALL,
        forced_step=limits.forced_step,
        first_step=limits.first_step,
        rtol=limits.rtol,
        atol=limits.rtol if limits.atol is None else limits.atol,
        closed_loops=model.closed_loops,
    )


def largest_violation(limits: Limits, length: Any) -> Any:
    """Return the largest allowed |Φ| (m or rad) of scenes of a length (m); for a number or an array."""
    return limits.violation * np.maximum(1.0, length)
