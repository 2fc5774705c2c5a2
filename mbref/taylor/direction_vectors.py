"""The variables of natural coordinates: coordinates of points and directions that move with bodies.

The pose of a body is its position over the scene's length and its rotation matrix by rows, 12 numbers.  A
variable is a linear function of one body's pose, or of two directions of a body that a driver turns:
cos ψ along - sin ψ across.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mbref.taylor.polynomial_layout import PoseMaps

NO_DRIVER = -1


class DirectionVectors:
    """All variables, each with the body and the linear form from which it is computed."""

    def __init__(self, length: float):
        self.length = length
        self._bodies: list[int] = []
        self._turned_by: list[int] = []
        self._along: list[np.ndarray] = []
        self._across: list[np.ndarray] = []

    def __len__(self) -> int:
        return len(self._bodies)

    def add(
        self, body: int, along: np.ndarray, across: np.ndarray | None = None, driver: int = NO_DRIVER
    ) -> tuple[int, ...]:
        """Add variables of a body (nb for the ground) by forms (k, 12); return their numbers."""
        first, count = len(self), len(along)
        self._bodies += [body] * count
        self._turned_by += [driver] * count
        self._along += list(along)
        self._across += list(np.zeros((count, 12)) if across is None else across)
        return tuple(range(first, first + count))

    def pose_maps(self, wanted: Sequence[int]) -> PoseMaps:
        """Return the forms of some variables, by which kernels evaluate them from states."""
        chosen = list(wanted)
        body, driver = (np.array(each, np.int64)[chosen] for each in (self._bodies, self._turned_by))
        forms = (np.array(each).reshape(-1, 12)[chosen] for each in (self._along, self._across))
        unit = np.repeat([1.0 / self.length, 1.0], [3, 9])
        return PoseMaps(body, driver, *(each * unit for each in forms))


def direction_forms(axes: np.ndarray, local: np.ndarray) -> np.ndarray:
    """Return forms (k, 12) of the components along axes at rest (k, 3) of a direction (3,) in a body's own
    frame."""
    return np.array([np.concatenate([np.zeros(3), np.outer(axis, local).ravel()]) for axis in axes])
