"""The variables of natural coordinates: coordinates of points and directions that move with bodies.

The pose of a body is its position over the scene's length and its rotation matrix by rows, 12 numbers.  A
variable is a linear function of one body's pose, or of two directions of a body that a driver turns:
cos ψ along - sin ψ across.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mbref import rotations
from mbref.kernels.scene_layout import Drivers

NO_DRIVER = -1


class Images:
    """All variables and where they come from."""

    def __init__(self, drivers: Drivers, length: float):
        self.drivers, self.length = drivers, length
        self._bodies: list[int] = []
        self._turned_by: list[int] = []
        self._along: list[np.ndarray] = []
        self._across: list[np.ndarray] = []

    def __len__(self) -> int:
        return len(self._bodies)

    def add(
        self, body: int, along: np.ndarray, across: np.ndarray | None = None, driver: int = NO_DRIVER
    ) -> tuple[int, ...]:
        """New variables of a body (nb for the ground), from forms (k, 12); their numbers."""
        first, count = len(self), len(along)
        self._bodies += [body] * count
        self._turned_by += [driver] * count
        self._along += list(along)
        self._across += list(np.zeros((count, 12)) if across is None else across)
        return tuple(range(first, first + count))

    def of(self, wanted: Sequence[int]) -> Readings:
        """The forms of the variables wanted, to read their values from states."""
        chosen = list(wanted)
        body, turned_by = np.array(self._bodies, int)[chosen], np.array(self._turned_by, int)[chosen]
        along, across = (np.array(forms).reshape(-1, 12)[chosen] for forms in (self._along, self._across))
        turned = np.flatnonzero(turned_by != NO_DRIVER)
        return Readings(self.drivers, self.length, body, turned_by[turned], turned, along, across[turned])


class Readings(NamedTuple):
    """Variables (k,): the forms (k, 12) of their bodies' poses, and of those that drivers turn the others."""

    drivers: Drivers
    length: float
    body: np.ndarray
    driver: np.ndarray  # of the variables ``turned``
    turned: np.ndarray
    along: np.ndarray
    across: np.ndarray

    def at(self, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Values and rates (2, k) at time t (s), from q (7 nb,) and v (6 nb,)."""
        pose, pose_rate = poses(q, v, self.length)
        found = np.array([np.einsum("kf,kf->k", self.along, p[self.body]) for p in (pose, pose_rate)])
        for k, driver, across in zip(self.turned, self.driver, self.across, strict=True):
            angle, speed = driver_at(self.drivers, driver, t)
            c, s, (x, x_rate) = np.cos(angle), np.sin(angle), found[:, k]
            y, y_rate = across @ pose[self.body[k]], across @ pose_rate[self.body[k]]
            found[:, k] = c * x - s * y, c * x_rate - s * y_rate - speed * (s * x + c * y)
        return found


def image_forms(axes: np.ndarray, local: np.ndarray) -> np.ndarray:
    """Forms (k, 12) of the components along axes at rest (k, 3) of a direction (3,) in a body's own frame."""
    return np.array([np.concatenate([np.zeros(3), np.outer(axis, local).ravel()]) for axis in axes])


def poses(q: np.ndarray, v: np.ndarray, length: float) -> tuple[np.ndarray, np.ndarray]:
    """Poses of all bodies and of the ground, and their rates (nb + 1, 12)."""
    coordinates, twists = q.reshape(-1, 7), v.reshape(-1, 6)
    nb = len(coordinates)
    pose, rate = np.zeros((nb + 1, 12)), np.zeros((nb + 1, 12))
    axes = rotations.to_matrix(coordinates[:, 3:])
    turning = rotations.cross(twists[:, None, 3:], axes)  # of rows a of R: (R [ω'])ᵀ = -ω' × a
    pose[:nb, :3], pose[:nb, 3:] = coordinates[:, :3] / length, axes.reshape(nb, 9)
    rate[:nb, :3], rate[:nb, 3:] = twists[:, :3] / length, -turning.reshape(nb, 9)
    pose[nb, 3:] = np.eye(3).ravel()
    return pose, rate


def driver_at(drivers: Drivers, d: int, t: float) -> tuple[float, float]:
    """Value and rate of driver d at time t, in rad or m and s."""
    polynomial = np.polynomial.Polynomial(drivers.polynomial[d])
    argument = drivers.frequency[d] * t + drivers.phase[d]
    value = float(polynomial(t)) + drivers.amplitude[d] * np.sin(argument)
    rate = float(polynomial.deriv()(t)) + drivers.amplitude[d] * drivers.frequency[d] * np.cos(argument)
    return value, rate
