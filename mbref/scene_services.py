"""Functions behind methods of scenes and motions that need other modules: constraint rows, drawing, error
estimates.

Scene and Motion are plain data and do not import these modules. ``mbref/__init__`` stores the functions here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from mbref.error_estimate import ErrorEstimate


@dataclass(frozen=True)
class Counts:
    """Coordinates, constraint rows and their rank at t = 0.

    Attributes
    ----------
    coordinates : int
        Six for each body; the ground counts if it is modelled as a body.
    rows : int
        Number of constraint rows.
    rows_by_joint : dict of str to int
        Rows by joint. Rows of a driver count under its joint, rows of a modelled ground under ``"ground"``.
    rank : int
        Rank of the constraint Jacobian.
    redundant : int
        Rows minus rank.
    degrees_of_freedom : int
        Coordinates minus rank.
    """

    coordinates: int  # six for each body
    rows: int
    # rows of drivers count under their joint, rows of a modelled ground under "ground"
    rows_by_joint: dict[str, int]
    rank: int
    redundant: int
    degrees_of_freedom: int


class Violation(NamedTuple):
    """Largest violation of a constraint row at k sample times, at three levels.

    Attributes
    ----------
    position : ndarray, shape (k,)
        m or rad.
    velocity : ndarray, shape (k,)
        m/s or rad/s.
    acceleration : ndarray, shape (k,), or None
        m/s² or rad/s². None if the engine gives no accelerations.
    """

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray | None


class Services:
    """Functions of a scene or a motion, stored here when ``mbref`` is imported.

    Attributes
    ----------
    counts : callable
        Returns the Counts of a scene.
    picture : callable
        Returns a scene at t = 0 as SVG.
    violations : callable
        Returns the Violation of a scene's constraint rows along a trajectory.
    determined_reactions : callable
        Returns by joint which components (k, 6) of its reaction equilibrium determines along a trajectory.
    error_estimate : callable
        Returns the ErrorEstimate of a motion, by a second run with a time limit, s; see
        ``Motion.with_error_estimate``.
    """

    counts: Callable[[Any], Counts]
    picture: Callable[[Any], str]
    violations: Callable[[Any, Any], Violation]
    determined_reactions: Callable[[Any, Any], dict[str, np.ndarray]]
    error_estimate: Callable[..., ErrorEstimate]


SERVICES = Services()
