"""Projection of MuJoCo's states onto its equality constraints, by the least kinetic energy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from crosscheck.engines.mujoco.context import NOTHING
from crosscheck.engines.shared.driver_motion import motion
from crosscheck.engines.shared.least_change import least_change, root_of_mass
from crosscheck.engines.shared.sampling import Failed
from mbref.motions.trajectory import Outcome
from mbref.scene import Driver

ITERATIONS = 10  # largest number of Newton iterations; usually two suffice
CLOSED = 1e-13  # m and rad; residual at which Newton's method ends
CLOSED_ENOUGH = 1e-8  # m and rad; largest residual of a result

# function that returns the driven constraint rows of the present data
Rows = Callable[[], Sequence[tuple[int, Driver]]]


def projected(
    mujoco: Any,
    model: Any,
    data: Any,
    drivers: Rows,
    t: float,
    load: Callable[[float, np.ndarray], None],
    y: np.ndarray,
) -> np.ndarray:
    """Return the state (nq + nv,) nearest to ``y``, measured by kinetic energy, whose positions and
    velocities satisfy the equality constraints at time t (s).

    ``load`` puts a state into the data. Raises Failed.
    """
    load(t, y)
    mujoco.mj_forward(model, data)
    q, v, root = data.qpos.copy(), data.qvel.copy(), root_of_mass(_mass(mujoco, model, data), t)
    for _ in range(ITERATIONS):
        load(t, np.concatenate((q, v)))
        mujoco.mj_forward(model, data)
        jacobian = _unrounded(data.efc_J[: data.ne * model.nv].reshape(data.ne, model.nv), model.stat.extent)
        values, rates = data.efc_pos[: data.ne].copy(), np.zeros(data.ne)
        for row, driver in drivers():
            value, rate, _ = motion(driver, t)
            values[row] -= value
            rates[row] = rate
        if not abs(values).max(initial=0.0) > CLOSED:
            break
        mujoco.mj_integratePos(model, q, least_change(root, jacobian, -values, t), 1.0)
    if not abs(values).max(initial=0.0) < CLOSED_ENOUGH:
        raise Failed(Outcome.NOT_CONVERGED, t, f"the closures could not be met at {t:.6g} s")
    return np.concatenate((q, v + least_change(root, jacobian, rates - jacobian @ v, t)))


def _unrounded(jacobian: np.ndarray, extent: float) -> np.ndarray:
    """Return the rows with zeros in place of rows of rounding, such as the rows of a duplicate joint."""
    largest = np.abs(jacobian).max(axis=1, keepdims=True, initial=0.0)
    return np.where(largest > NOTHING * max(1.0, extent), jacobian, 0.0)


def _mass(mujoco: Any, model: Any, data: Any) -> np.ndarray:
    """Return the mass matrix (nv, nv)."""
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    return mass
