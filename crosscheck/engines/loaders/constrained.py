"""Accelerations of joint coordinates whose rates obey linear constraints."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from crosscheck.engines.loaders.machine import Rows
from crosscheck.engines.loaders.posed import Pose

STEP = 1e-3  # s, of differences along a motion with constant rates; their error is about STEP^4
FACTORS = ((-2.0, 1 / 12), (-1.0, -8 / 12), (1.0, 8 / 12), (2.0, -1 / 12))  # time / STEP, weight
DEPENDENT = 1e-8  # singular value / largest one, below which rows are dependent


def along(value: Callable[[Pose], np.ndarray], pose: Pose, rates: Pose) -> np.ndarray:
    """Return the time derivative of a function of a pose whose joints move with constant rates."""
    parts = []
    for factor, weight in FACTORS:
        at = {n: q + factor * STEP * rates.get(n, 0.0) for n, q in pose.items()}
        parts.append(weight / STEP * value(at))
    return np.asarray(sum(parts))


def accelerations(mass: np.ndarray, force: np.ndarray, rows: np.ndarray, drift: np.ndarray) -> np.ndarray:
    """Return a (n,) with M a = f + Gᵀλ and G a = -Ġ v, for mass matrix M (n, n), f (n,), rows G (m, n) and
    drift Ġ v (m,). Dependent rows are admissible."""
    if not len(rows):
        return np.asarray(np.linalg.solve(mass, force))
    _, values, across = np.linalg.svd(rows)
    free = across[int(np.sum(values > DEPENDENT * values[0])) :].T
    part = -np.linalg.lstsq(rows, drift, rcond=DEPENDENT)[0]
    return np.asarray(part + free @ np.linalg.solve(free.T @ mass @ free, free.T @ (force - mass @ part)))


def held(
    names: tuple[str, ...],
    mass: np.ndarray,
    force: np.ndarray,
    rows: Callable[[Pose], Rows],
    pose: Pose,
    rates: Pose,
) -> dict[str, float]:
    """Return accelerations of joints from mass matrix and forces at a state; the rows hold exactly."""
    v = np.array([rates.get(name, 0.0) for name in names])
    whole = {name: pose.get(name, 0.0) for name in names}
    now = rows(whole).of(names)
    drift = along(lambda at: rows(at).of(names) @ v, whole, rates)
    return dict(zip(names, accelerations(mass, force, now, drift).tolist(), strict=True))
