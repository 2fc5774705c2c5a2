"""The limit h → 0 of fixed-step runs by Richardson's extrapolation: bias apart from discretisation.

Three runs x(h) = x₀ + c hᵖ give order, limit and the finest run's distance from it without any truth; the
limit's own error against a truth remains at any step, such as the error of a soft constraint.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from crosscheck.judge.metrics import error_series
from crosscheck.judge.tolerances import LEAST_ORDER
from mbref.scene import Scene
from mbref.trajectory import Trajectory

HIGHEST_ORDER = 12.0


@dataclass(frozen=True)
class Limit:
    """``motion`` is the extrapolated one (poses alone are meaningful), ``discretisation`` how far the finest
    run is from it, ``order`` the order of the runs' differences."""

    motion: Trajectory
    order: float
    discretisation: float


def limit(scene: Scene, steps: Sequence[float], runs: Sequence[Trajectory]) -> Limit | None:
    """The limit of completed runs with the same samples, of which the three of least step are used.

    None with fewer than three, and where their differences do not shrink as a power of the step between
    LEAST_ORDER and HIGHEST_ORDER: then they are not in an asymptotic range.
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
    """p with (h₁ᵖ - h₂ᵖ) / (h₂ᵖ - h₃ᵖ) the ratio of the differences."""
    if not (np.isfinite(apart).all() and min(apart) > 0):
        return None
    a, b = steps[0] / steps[1], steps[2] / steps[1]

    def off(p: float) -> float:
        return np.log((a**p - 1) / (1 - b**p)) - np.log(apart[0] / apart[1])

    if off(LEAST_ORDER) > 0 or off(HIGHEST_ORDER) < 0:
        return None
    return float(brentq(off, LEAST_ORDER, HIGHEST_ORDER))


def _beyond(last: np.ndarray, before: np.ndarray, weight: float) -> np.ndarray:
    """Unit quaternions last + weight (last - before), the signs made equal first."""
    same = np.where(np.sum(last * before, axis=-1, keepdims=True) < 0, -before, before)
    found = last + weight * (last - same)
    return found / np.linalg.norm(found, axis=-1, keepdims=True)
