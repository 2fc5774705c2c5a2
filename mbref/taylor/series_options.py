"""Options of the series of a run: kind of the steps, tolerances and orders."""

from __future__ import annotations

import math

from mbref.equations.driver_conflicts import fastest_rate
from mbref.input_error import InputError
from mbref.scene import Scene
from mbref.stepping.limits import GENERATED, GENERIC
from mbref.stepping.run import Run
from mbref.taylor.crossing.thresholds import MIN_CHANGE, START_ERROR, START_REST
from mbref.taylor.layout import SeriesOptions

EXACT, EXACT_ORDER = 1e-13, 22  # tolerance and least order of high-accuracy steps
LAST_TERMS = 0.05  # tolerance of the last terms / (rtol + atol), far from singular positions
PREDICTOR_TOLERANCE = 3e-7  # tolerance of the last terms of predictor steps, away from singular positions
ACCURATE_TOLERANCE = 1e-13  # tolerance of high-accuracy steps between predictor steps
# default order of predictor steps; least order that crosses a singular position
PREDICTOR_ORDER, LEAST_PREDICTOR_ORDER = 16, 12
LEAST_ORDER, MOST_ORDER = 4, 30  # order of a series; rounding dominates higher terms
# order of least cost at a tolerance of 1, and its increase for each digit
CHEAPEST = {GENERIC: (6.0, 1.2), GENERATED: (7.0, 1.6)}


def series_options(run: Run) -> SeriesOptions:
    """Return the options of the series of a run. Steps are predictor steps (``mbref.taylor.driven``) if
    drivers prescribe all degrees of freedom."""
    wanted = run.method.options_of(run.method.integrator)["order"]
    freedoms = run.memory.active.velocities.size - run.ranks.rank
    is_driven = freedoms == 0 and not run.model.has_angles
    if is_driven and not run.limits.branches and (wanted == 0 or wanted >= LEAST_PREDICTOR_ORDER):
        follows_drivers, tolerance, accurate_tolerance = True, PREDICTOR_TOLERANCE, ACCURATE_TOLERANCE
        order = order_of(tolerance, wanted or PREDICTOR_ORDER, GENERIC)
    else:
        follows_drivers, accurate_tolerance = False, LAST_TERMS * (EXACT + EXACT)
        tolerance = LAST_TERMS * (run.memory.control.rtol + run.memory.control.atol)
        order = order_of(tolerance, wanted, GENERATED if run.limits.code == GENERATED else GENERIC)
    return SeriesOptions(
        regular_tolerance=tolerance,
        regular_order=order,
        accurate_tolerance=accurate_tolerance,
        accurate_order=max(order, EXACT_ORDER) if run.model.closed_loops else order,
        velocity_change=max(run.memory.control.rtol, MIN_CHANGE),
        start_distance=START_ERROR * max(1.0, run.model.length),
        rest_speed=rest_speed(run.scene, run.model.length, run.times[-1]) if freedoms == 0 else 0.0,
        start_freedoms=freedoms,
        follows_drivers=follows_drivers,
    )


def rest_speed(scene: Scene, length: float, until: float) -> float:
    """Return the speed (m/s or rad/s) up to which a motion that drivers prescribe starts from rest."""
    return START_REST * max(1.0, length) * fastest_rate(scene, length, until)


def order_of(tolerance: float, wanted: float, code: str) -> int:
    """Return the order of the series: the requested order, or for 0 the cheapest order; raises InputError
    outside 4 to 30."""
    if wanted == 0:
        first, per_digit = CHEAPEST[code]
        best = 2 * round((first - per_digit * math.log10(tolerance)) / 2)
        return int(min(max(best, LEAST_ORDER), MOST_ORDER))
    if wanted not in range(LEAST_ORDER, MOST_ORDER + 1):
        raise InputError(f"taylor: order must be {LEAST_ORDER} to {MOST_ORDER}, got {wanted:g}")
    return int(wanted)
