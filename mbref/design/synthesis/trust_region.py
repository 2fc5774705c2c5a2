"""Least residuals within bounds, as least squares or as least peak, by steps in a trust region.

A step d minimises the size of the linear residuals r + J d in a box |d| ≤ Δ within the bounds: SciPy's
``lsq_linear`` for a sum of squares (Gauss–Newton), ``linprog`` for the largest residual (Madsen 1975). The
box shrinks where the linear residuals do not predict the true ones, and where the residuals do not exist.
Where it vanishes because they do not exist, a step in another direction may lower them: no minimum is found.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog, lsq_linear

FIRST_BOX = 0.1  # first Δ, sizes of the numbers
BY_BOX = 0.5  # length of a step / Δ, from which the box limits it
SMALLEST_BOX = 1e-11  # Δ or step at which the search has converged
ROUNDING = 1e-14  # change of the residuals' size / size, or size, that is rounding
ACCEPTED, GOOD = 1e-4, 0.75  # true / predicted decrease from which a step counts, and the box grows
MOST_SEARCH_STEPS = 100
LP_TOLERANCE = 1e-10  # the least that HiGHS takes, of a problem in units of the residuals
LEAST_SQUARES_TOLERANCE = 1e-15  # relative decrease at which a step is found


class SearchEnd(NamedTuple):
    """Numbers z (p,) at the end of a search, the residuals (r,), and whether it converged."""

    z: np.ndarray
    residuals: np.ndarray
    converged: bool


def residual_size(residuals: np.ndarray, peak: bool) -> float:
    """Return the largest absolute residual, or the root of the sum of squares."""
    return float(np.abs(residuals).max() if peak else np.linalg.norm(residuals))


def least_residuals(
    residuals: Callable[[np.ndarray], np.ndarray],
    jacobian: Callable[[np.ndarray], np.ndarray],
    z: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
    peak: bool = False,
    progress: Callable[[float], None] | None = None,
) -> SearchEnd:
    """Return the local minimum from z (p,), whose residuals (r,) exist; NaN marks numbers without residuals.
    ``progress`` is called with the share of the steps done."""
    r, jac, box, refused = residuals(z), jacobian(z), FIRST_BOX, False
    for k in range(MOST_SEARCH_STEPS):
        lower, upper = np.maximum(bounds[0] - z, -box), np.minimum(bounds[1] - z, box)
        size = residual_size(r, peak)
        if size == 0.0:
            return SearchEnd(z, r, True)
        step = (_peak_step if peak else _squares_step)(r, jac, lower, upper)
        if step is None:
            return SearchEnd(z, r, False)
        length = np.abs(step).max()
        predicted = size - residual_size(r + jac @ step, peak)
        if length <= SMALLEST_BOX or predicted <= ROUNDING * max(size, 1.0):
            return SearchEnd(z, r, not (refused and length > BY_BOX * box))
        trial = residuals(z + step)
        gain = (size - residual_size(trial, peak)) / predicted
        if gain > ACCEPTED:
            z, r = z + step, trial
            jac = jacobian(z)
        if not gain > ACCEPTED:
            box = length / 4
        elif gain > GOOD:
            box = max(box, 2 * length)
        refused = np.isnan(gain) or (refused and box < FIRST_BOX)
        if progress:
            progress(k / MOST_SEARCH_STEPS)
    return SearchEnd(z, r, False)


def _squares_step(r: np.ndarray, jac: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    open_ones = lower < upper
    step = np.where(open_ones, 0.0, lower)
    found = lsq_linear(
        jac[:, open_ones], -r, (lower[open_ones], upper[open_ones]), "bvls", LEAST_SQUARES_TOLERANCE
    )
    step[open_ones] = found.x
    return np.clip(step, lower, upper)


def _peak_step(r: np.ndarray, jac: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray | None:
    """Solve for step and s: least s with |r + J step| ≤ s, in units of the largest residual and the box;
    None if SciPy finds no solution."""
    size, box = np.abs(r).max(), max(np.abs(lower).max(), np.abs(upper).max())
    rows, ones = jac * box / size, np.ones((len(r), 1))
    found = linprog(
        np.append(np.zeros(len(lower)), 1.0),
        np.block([[rows, -ones], [-rows, -ones]]),
        np.concatenate([-r, r]) / size,
        bounds=[*zip(lower / box, upper / box, strict=True), (0.0, None)],
        options={"primal_feasibility_tolerance": LP_TOLERANCE, "dual_feasibility_tolerance": LP_TOLERANCE},
    )
    return None if found.x is None else np.clip(found.x[:-1] * box, lower, upper)
