"""Interpolation errors of tables, estimated by their splines through every second row."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from mbref.scene.functions import FEWEST_ROWS, TimeFunction
from mbref.scene.scene import Scene

# By halving the intervals the error of a smooth function's spline falls to 1/16, of its second derivative
# to 1/4; the error of a spline over kinks and jumps falls to 1/2 at best
SMOOTH_FALL, SECOND_FALL, LEAST_FALL = 16.0, 4.0, 2.0
LEAST_SHOWN = 1e-9  # error / largest value, below which it is rounding
BETWEEN_ROWS = 8  # points between two rows
COMPARED_SPLINES = 3  # splines that are compared: through all rows, every second and every fourth one


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

    The error is d / (f - 1), with the difference d to the spline through every second row. Of values, f is
    the difference between the splines through every second and every fourth row over d, from 2 to 16. NaN if
    the table has too few rows for a spline through every second one.
    """
    assert function.table is not None
    table = np.array(function.table)
    levels = [table]
    while (
        len(levels) < COMPARED_SPLINES and len(coarse := np.r_[levels[-1][:-1:2], table[-1:]]) >= FEWEST_ROWS
    ):
        levels.append(coarse)
    if len(levels) == 1:
        return np.nan, np.nan
    t = np.unique(np.linspace(table[:-1, 0], table[1:, 0], BETWEEN_ROWS))
    found = [_spline(rows, function.periodic, derivative, t) for rows in levels]
    largest = float(np.abs(found[0]).max())
    differences = [float(np.abs(a - b).max()) for a, b in itertools.pairwise(found)]
    if derivative or not differences[0]:
        return differences[0] / (SECOND_FALL - 1.0), largest
    fall = (differences[1:] or [largest])[0] / differences[0]  # with few rows, from no table to half the rows
    return differences[0] / (min(max(fall, LEAST_FALL), SMOOTH_FALL) - 1.0), largest


def _spline(rows: np.ndarray, periodic: bool, derivative: int, t: np.ndarray) -> np.ndarray:
    """Return the spline through rows (k, 2) of a table, or a derivative of it, at times t (s)."""
    from scipy.interpolate import CubicSpline  # only scenes with tables need it

    ends = "periodic" if periodic else "not-a-knot"
    return np.asarray(CubicSpline(*rows.T, bc_type=ends)(t, derivative))
