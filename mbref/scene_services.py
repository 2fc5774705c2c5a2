"""Functions behind methods of scenes and motions that need other modules: constraint rows, drawing, error
estimates.

Scene and Motion are plain data and do not import these modules. ``mbref/__init__`` puts the functions into
SERVICES.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np


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


SERVICES: dict[str, Callable[..., Any]] = {}  # by name; each imports its module at its first call
