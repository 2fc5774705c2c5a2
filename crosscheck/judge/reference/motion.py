"""Result of a formulation of the reference: the motion of a scene in the formulation's arithmetic.

Both formulations are functions ``(scene, times, arithmetic, *, seconds) -> Motion``: ``times`` (k,) increase
from t ≥ 0. After ``seconds`` of CPU time of the calling thread the motion ends early.
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
    """Ignore the time that a motion has reached."""


class Ended(ArithmeticError):
    """The motion cannot be followed further; the message is the reason, as a clause."""


@dataclass(frozen=True)
class Motion:
    """Samples at the k requested times that were reached, of nb bodies, world frame, SI units.

    ``position`` (k, nb, 3) of the centres of mass and ``orientation`` (k, nb, 4), unit quaternions
    (w, x, y, z) body to world of either sign, with ``velocity``, ``angular_velocity``, ``acceleration`` and
    ``angular_acceleration`` (k, nb, 3); elements belong to the arithmetic. ``reached`` (s) is the last
    requested time, or the time of an early end, with the ``reason`` as a clause ("" if complete).
    ``crossings`` (s) are times of singular positions that were passed, at most one a step, and ``seconds`` is
    CPU time.
    ``contradiction`` is the largest residual of redundant rows, relative to the largest coordinate, if it was
    computed. ``formulation`` is A or B. ``events`` (s) are times at which constraints come or go or stops are
    met.
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
    events: tuple[float, ...] = ()
