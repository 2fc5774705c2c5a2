"""Forces, torques and powers of motors that cause a motion in place of drivers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class MotorMotion:
    """Force or torque, and power, of a motor that takes part in causing a motion, at k sample times.

    Signs are as for a driver. ``mbref.inverse_dynamics`` computes it.

    Attributes
    ----------
    joint : str
        Name of the joint with the motor.
    force : ndarray, shape (k,), or None
        Force along the axis, N, of a joint whose displacement a driver could prescribe.
    torque : ndarray, shape (k,), or None
        Torque about the axis, N m, of other joints.
    power : ndarray, shape (k,)
        Power into the mechanism, W.
    open : ndarray, shape (k,)
        1 where other motors can replace this one, and all forces and torques have the least norm; else 0.

    Near singular positions force, torque and power are NaN.
    """

    joint: str
    force: np.ndarray | None
    torque: np.ndarray | None
    power: np.ndarray
    open: np.ndarray

    @property
    def amount(self) -> np.ndarray:
        """The force or torque (k,), whichever it is."""
        return np.asarray(self.force if self.torque is None else self.torque)
