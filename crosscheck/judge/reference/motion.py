"""The motion of a scene as a formulation of the reference gives it, in the formulation's own arithmetic.

Both formulations are functions ``(scene, times, arithmetic, *, seconds) -> Motion``: ``times`` (k,) ascend
from t ≥ 0, and after so many CPU seconds of the calling thread the motion ends where it has got.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from crosscheck.judge.deadline import TimeIsUp

Times = Sequence[float] | np.ndarray

Progress = Callable[[float], None]
"""Takes the time (s) that a motion has reached, step by step."""

OVER = str(TimeIsUp())


def no_progress(_: float) -> None:
    """Tell nobody the time that a motion has reached."""


@dataclass(frozen=True)
class Motion:
    """Samples at the times reached: k of those asked for, of nb bodies, world frame, SI units.

    ``position`` (k, nb, 3) of the centres of mass and ``orientation`` (k, nb, 4), unit quaternions
    (w, x, y, z) body to world of either sign, with ``velocity``, ``angular_velocity``, ``acceleration`` and
    ``angular_acceleration`` (k, nb, 3); elements are the arithmetic's.  ``reached`` (s) is the last time
    asked for, or where the motion ended before, with the ``reason`` as a clause ("" when complete).
    ``crossings`` (s) are the singular positions passed, ``seconds`` CPU time; ``contradiction`` is the
    largest residual of redundant rows, relative to the largest coordinate, where that was looked at.
    ``formulation`` is A or B.
    """

    times: np.ndarray
    position: np.ndarray
    orientation: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    acceleration: np.ndarray
    angular_acceleration: np.ndarray
    reached: float
    reason: str
    steps: int
    crossings: tuple[float, ...]
    seconds: float
    contradiction: float = 0.0
    formulation: str = "A"
