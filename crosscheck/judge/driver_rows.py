"""Residuals of drivers: of an angle, a displacement, or the orientation of a ball joint, and of their rates.

The driver of an orientation turns the second body by R(t) = R₁ R₂ R₃ relative to the first, about axes that
the first body carries. In the axes of the joint's first frame, R has the angular velocity

    Ω = q₁' a₁ + q₂' R₁ a₂ + q₃' R₁ R₂ a₃

Arrays have any leading shape (…).
"""

from __future__ import annotations

import numpy as np

from crosscheck.judge.time_functions import value
from mbref import rotations
from mbref.rotations import cross
from mbref.scene import Driver


def residual(
    driver: Driver, slides: bool, t: np.ndarray, local: np.ndarray, relative: np.ndarray
) -> np.ndarray:
    """Return by how much a joint's displacement (…, 3) or relative orientation (…, 4) exceeds the driver's at
    times t (…): (…, 1) m or rad, or a rotation vector (…, 3) in the axes of the second frame."""
    if not driver.turn:
        wanted = value(driver, t)
        return np.asarray(local[..., 2] - wanted if slides else wrapped(twist(relative) - wanted))[..., None]
    expected = _no_turn(t)
    for turn in driver.turn:
        about = value(turn, t)[..., None] * rotations.unit(turn.axis)
        expected = rotations.multiply(expected, rotations.from_vector(about))
    off = rotations.multiply(rotations.conjugate(expected), relative)
    return rotations.to_vector(np.where(off[..., :1] < 0, -off, off))


def rate(
    driver: Driver, slides: bool, t: np.ndarray, derivative: int, moved: tuple[np.ndarray, np.ndarray]
) -> np.ndarray:
    """Return by how much relative velocity and angular velocity (…, 3) of a joint's frames, or their rates
    for ``derivative`` 2, exceed the driver's: (…, 1), or (…, 3) in the axes of the first frame."""
    linear, angular = moved
    if not driver.turn:
        return (linear if slides else angular)[..., 2:] - value(driver, t, derivative)[..., None]
    turned, omega, second = _no_turn(t), np.zeros((*t.shape, 3)), np.zeros((*t.shape, 3))
    for turn in driver.turn:
        axis = rotations.unit(turn.axis)
        angle, speed, bend = (value(turn, t, n)[..., None] for n in range(3))
        carried = rotations.rotate(turned, np.broadcast_to(axis, omega.shape))
        second = second + bend * carried + speed * cross(omega, carried)
        omega = omega + speed * carried
        turned = rotations.multiply(turned, rotations.from_vector(angle * axis))
    return angular - (omega if derivative == 1 else second)


def _no_turn(t: np.ndarray) -> np.ndarray:
    """Return quaternions (…, 4) of no rotation for times (…)."""
    return np.broadcast_to([1.0, 0.0, 0.0, 0.0], (*t.shape, 4))


def wrapped(angle: np.ndarray) -> np.ndarray:
    """Return angles (…) shifted by full turns into [-π, π]."""
    return angle - 2 * np.pi * np.round(angle / (2 * np.pi))


def twist(q: np.ndarray) -> np.ndarray:
    """Return the angle about the third axis, up to full turns."""
    return 2 * np.arctan2(q[..., 3], q[..., 0])
