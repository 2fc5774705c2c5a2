"""Interpolation errors of tables, estimated by their splines through every second row."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mbref.scene.functions import FEWEST_ROWS, TimeFunction
from mbref.scene.scene import Scene

# By halving the intervals the error of a spline's value falls to 1/16, of its second derivative to 1/4
OF_VALUE, OF_SECOND = 1 / 15, 1 / 3  # error / difference of both splines
LEAST_SHOWN = 1e-9  # error / largest value, below which it is rounding
BETWEEN_ROWS = 8  # points between two rows


def interpolation_notes(scene: Scene) -> Iterator[str]:
    """Yield a sentence on each table whose interpolation leaves its values, or accelerations, uncertain."""
    for driver in scene.driver:
        unit = "m/s²" if scene.joint_named(driver.joint).facts.driven == "displacement" else "rad/s²"
        for function in driver.functions:
            if function.table is not None:
                yield from _note(f"driver({driver.joint})", function, 2, f" {unit}", "acceleration")
    for k, load in enumerate(scene.load):
        if load.over_time is not None and load.over_time.table is not None:
            yield from _note(f"load({k})", load.over_time, 0, "", "factor")


def _note(name: str, function: TimeFunction, derivative: int, unit: str, what: str) -> Iterator[str]:
    assert function.table is not None
    rows, remedy = len(function.table), "" if function.periodic else ", or periodic = true if it repeats,"
    error, largest = interpolation_error(function, derivative)
    if np.isnan(error):
        yield f"{name}: {rows} rows are too few to estimate the error of interpolation"
    elif error > LEAST_SHOWN * largest:
        yield (
            f"{name}: interpolation between {rows} rows leaves {what} uncertain by about {error:.2g}{unit}, "
            f"{100 * error / largest:.2g} % of the largest; more rows{remedy} reduce it"
        )


def interpolation_error(function: TimeFunction, derivative: int = 0) -> tuple[float, float]:
    """Return the estimated error of a table's spline, or of its second derivative, and the largest value.

    NaN if the table has too few rows for a spline through every second one.
    """
    from scipy.interpolate import CubicSpline  # only scenes with tables need it

    assert function.table is not None
    times, values = np.array(function.table).T
    kept = np.r_[np.arange(0, len(times) - 1, 2), len(times) - 1]
    if len(kept) < FEWEST_ROWS:
        return np.nan, np.nan
    ends = "periodic" if function.periodic else "not-a-knot"
    fine, coarse = (CubicSpline(times[rows], values[rows], bc_type=ends) for rows in (slice(None), kept))
    t = np.unique(np.linspace(times[:-1], times[1:], BETWEEN_ROWS))
    found = fine(t, derivative)
    share = OF_SECOND if derivative else OF_VALUE
    return share * float(np.abs(found - coarse(t, derivative)).max()), float(np.abs(found).max())
