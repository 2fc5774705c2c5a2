"""Given values of columns that a pose determines up to a sign, or up to full turns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mbref.input_error import InputError
from mbref.motions.outputs import quantity_of

FULL_TURN = 2.0 * np.pi
WRAPPED_RANGE = FULL_TURN * (1.0 + 1e-9)  # rad, range of angles from -π to π, or from 0 to 2 π, with rounding
# difference of a change between samples from the change of the scene's motion, a full turn added, up to which
# the column is taken for a wrapped one; the motion of the scene's own numbers is less accurate than others
NEAR_MOTION = 0.25 * FULL_TURN


def nearest_signs(columns: Sequence[str], given: np.ndarray, found: np.ndarray) -> np.ndarray:
    """Return the signs (k, c) of given values (k, c) with which they are nearest to the values found: -1 for
    the components of a body's quaternion where the opposite one is nearer, as both are one orientation.
    NaN is no value."""
    signs, quaternions = np.ones(given.shape), dict[str, list[int]]()
    for place, name in enumerate(columns):
        if quantity_of(name) == "orientation":
            quaternions.setdefault(name.rpartition(".")[0], []).append(place)
    for places in quaternions.values():
        opposite = np.nansum(given[:, places] * found[:, places], axis=1) < 0.0
        signs[np.ix_(opposite, places)] = -1.0
    return signs


def refuse_wrapped(
    columns: Sequence[str], given: np.ndarray, found: np.ndarray, times: np.ndarray, what: str
) -> None:
    """Raise InputError for a column of angles (k,) of given values (k, c) that loses full turns: it stays in
    one turn, and between two samples it jumps by a full turn more than the values found (k, c)."""
    changes, near = np.diff(given, axis=0), np.diff(found, axis=0)
    turns = np.where(np.abs(changes) > FULL_TURN / 2, np.round((near - changes) / FULL_TURN), 0.0)
    wrapped = (turns != 0.0) & (np.abs(changes + FULL_TURN * turns - near) < NEAR_MOTION)
    for place, name in enumerate(columns):
        if quantity_of(name) != "angle" or np.ptp(given[:, place]) > WRAPPED_RANGE:
            continue
        for k in np.flatnonzero(wrapped[:, place]):
            raise InputError(
                f"{what}: {name} changes by {changes[k, place]:.4g} rad from t = {times[k]:.6g} to "
                f"{times[k + 1]:.6g} s, where the scene turns by {near[k, place]:.4g} rad; angles count full "
                "turns, which numpy.unwrap adds"
            )
