"""The singular positions of the four-bar with equal links (rhombus): rank along the motion, the second branch
(fold), and the convergence of ALF.

All numbers follow from the judge's joint equations and the exact motion, in plain numpy.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from crosscheck.judge import constraints
from crosscheck.judge.gauss_principle import bias
from crosscheck.judge.tolerances import RANK
from crosscheck.judge.truth import truth_for
from crosscheck.paper import settings
from mbref.scene import Scene
from mbref.scenes.four_bar import LENGTH, four_bar
from mbref.scenes.links import CRANK_RATE, about_z

MOST = 10_000  # largest number of iterations


def scaled_singular_values(scene: Scene, times: np.ndarray) -> np.ndarray:
    """Return the singular values (k, n) of the scaled constraint Jacobian along the exact motion at times
    (k,), s.

    Angular columns are divided by the scene's length and rows brought to unit length.  Raises ValueError
    for a scene without a known exact motion.
    """
    truth = truth_for(scene)
    if truth is None:
        raise ValueError(f"{scene.name}: no exact motion is known")
    motion = truth.poses(times)
    scale = np.tile(np.repeat([1.0, 1 / constraints.scene_length(scene)], 3), len(scene.body))
    values = []
    for t, r, p in zip(motion.times, motion.position, motion.orientation, strict=True):
        rows = _of_unit_length(constraints.jacobian(scene, t, r, p)[0] * scale)
        values.append(np.linalg.svd(rows, compute_uv=False))
    return np.array(values)


def _of_unit_length(rows: np.ndarray) -> np.ndarray:
    scaled: np.ndarray = rows / np.linalg.norm(rows, axis=1, keepdims=True)
    return scaled


def rank(values: np.ndarray) -> int:
    """Return the number of singular values (n,) that are not zero."""
    return int(np.sum(values > RANK * values.max()))


def fold_residual(theta: float, turned: float) -> float:
    """Return the largest residual (m or rad) of the driven rhombus if it leaves θ₂ = theta (0 or π) along the
    fold.

    The crank has turned by the angle ``turned`` (rad) from this position.  At π the coupler turns with the
    crank about A and the rocker rests; at 0 crank and rocker lie on the ground and on B = D only coupler and
    rocker could turn, so that the crank rests and its driver is violated.
    """
    theta0 = math.pi if theta else math.pi / 2
    scene = four_bar(theta0)
    t = (theta0 - theta - turned) / CRANK_RATE
    if theta:
        crank, coupler, rocker = theta + turned, turned, theta
    else:
        crank, coupler, rocker = theta, turned, turned
    b, d = _along(crank), _along(0.0)
    places = [b / 2, b + _along(coupler) / 2, d + _along(rocker) / 2]
    turns = np.array([about_z(angle) for angle in (crank, coupler, rocker)])
    residuals = constraints.closure(scene, np.array(t), np.array(places), turns)
    return max(float(np.abs(r).max()) for r in residuals.values())


def _along(angle: float) -> np.ndarray:
    return LENGTH * np.array([math.cos(angle), math.sin(angle), 0.0])


def crossings(theta0: float, last: float) -> list[tuple[float, int]]:
    """Return the times (s) up to ``last`` at which θ₂ = theta0 - 124.8 t is a multiple k of π, and k."""
    multiples = itertools.count(math.floor(theta0 / math.pi), -1)
    times = (((theta0 - k * math.pi) / CRANK_RATE, k) for k in multiples)
    return list(itertools.takewhile(lambda crossing: crossing[0] <= last, times))


def crossing_distance(theta0: float, time: float) -> float:
    """Return the distance (rad) of θ₂ = theta0 - 124.8 t at ``time`` (s) from the nearest multiple of π."""
    turns = (theta0 - CRANK_RATE * time) / math.pi
    return abs(turns - round(turns)) * math.pi


def alf_iterations(distance: float, error: float) -> int:
    """Return the number of ALF's iterations at θ₂ = distance (rad), at the settings of the tables; MOST if
    more iterations are needed.

    Without masses M = I, and (I + α DᵀD) q̈ ← q̈ + α Dᵀ γ from q̈ = 0 (Eqs. 17 to 20), where D is the
    constraint Jacobian with rows of unit length and Φ = Φ' = 0.  γ is off by ``error`` of its size in the
    direction that vanishes at θ₂ = 0.
    """
    scene = four_bar(distance)
    jacobian, _ = constraints.jacobian(scene, 0.0, *constraints.initial_poses(scene))
    d, gamma = _of_unit_length(jacobian), -bias(scene) / np.linalg.norm(jacobian, axis=1)
    left, values, _ = np.linalg.svd(d)
    gamma = gamma + error * np.linalg.norm(gamma) * left[:, rank(values) - 1]
    return _iterations(d, gamma, settings.ALF["alpha"], settings.ALF["epsilon"])


def _iterations(d: np.ndarray, gamma: np.ndarray, alpha: float, epsilon: float) -> int:
    """Return the number of iterations until the change is ≤ ``epsilon`` times the larger of 1 and the
    acceleration (Eq. 20)."""
    inverse = np.linalg.inv(np.eye(d.shape[1]) + alpha * d.T @ d)
    step, acceleration = alpha * d.T @ gamma, np.zeros(d.shape[1])
    for k in range(1, MOST):
        before, acceleration = acceleration, inverse @ (acceleration + step)
        change = np.linalg.norm(acceleration - before)
        if change <= epsilon * max(1.0, float(np.linalg.norm(acceleration))):
            return k
    return MOST


def turns(k: int) -> str:
    """Return the text of k π."""
    return {0: "0", 1: "π", -1: "-π"}.get(k, f"{k}π")
