"""Limit h → 0 of fixed-step runs by Richardson's extrapolation, which separates bias from discretisation
error.

Three runs x(h) = x₀ + c hᵖ give order, limit and the finest run's distance from the limit without any truth.
The error of the limit against a truth is the bias: an error that remains at any step, such as the error of a
soft constraint.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from crosscheck.judge.metrics import error_series
from crosscheck.judge.tolerances import LEAST_ORDER
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

HIGHEST_ORDER = 12.0


@dataclass(frozen=True)
class Limit:
    """Extrapolated ``motion`` (only its poses are meaningful), distance ``discretisation`` of the finest run
    from it, and ``order`` of the runs' differences."""

    motion: Trajectory
    order: float
    discretisation: float


def limit(scene: Scene, steps: Sequence[float], runs: Sequence[Trajectory]) -> Limit | None:
    """Return the limit of completed runs with equal samples; the three runs with the smallest steps are used.

    None for fewer than three runs, and if their differences do not decrease as a power of the step between
    LEAST_ORDER and HIGHEST_ORDER. The runs are then outside the asymptotic range.
    """
    finest = sorted(zip(steps, runs, strict=True), key=lambda pair: pair[0])[2::-1]
    if len(finest) < 3:
        return None
    (h1, h2, h3), (first, second, third) = zip(*finest, strict=True)
    apart = [float(error_series(scene, a, b).max()) for a, b in ((first, second), (second, third))]
    order = _order((h1, h2, h3), apart)
    if order is None:
        return None
    weight = 1 / ((h2 / h3) ** order - 1)
    motion = replace(
        third,
        acceleration=None,
        angular_acceleration=None,
        position=third.position + weight * (third.position - second.position),
        orientation=_beyond(third.orientation, second.orientation, weight),
    )
    return Limit(motion, order, float(error_series(scene, third, motion).max()))


def _order(steps: tuple[float, float, float], apart: Sequence[float]) -> float | None:
    """Return p such that (h₁ᵖ - h₂ᵖ) / (h₂ᵖ - h₃ᵖ) equals the ratio of the differences."""
    if not (np.isfinite(apart).all() and min(apart) > 0):
        return None
    a, b = steps[0] / steps[1], steps[2] / steps[1]

    def off(p: float) -> float:
        return np.log((a**p - 1) / (1 - b**p)) - np.log(apart[0] / apart[1])

    if off(LEAST_ORDER) > 0 or off(HIGHEST_ORDER) < 0:
        return None
    return float(brentq(off, LEAST_ORDER, HIGHEST_ORDER))


def _beyond(last: np.ndarray, before: np.ndarray, weight: float) -> np.ndarray:
    """Return unit quaternions last + weight (last - before), after their signs are made equal."""
    same = np.where(np.sum(last * before, axis=-1, keepdims=True) < 0, -before, before)
    found = last + weight * (last - same)
    return found / np.linalg.norm(found, axis=-1, keepdims=True)
