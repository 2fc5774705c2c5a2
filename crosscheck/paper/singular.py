"""Singular positions of the rhombus: its Jacobian along the motion, and the branches that meet there."""

from __future__ import annotations

import math

import numpy as np

from crosscheck.judge import constraints
from crosscheck.judge.tolerances import RANK
from crosscheck.judge.truth import truth_for
from crosscheck.paper import settings
from mbref.equations.initial_state import consistent_start
from mbref.equations.model import Model
from mbref.formulations.alf import ALF
from mbref.kernels.layout import OK
from mbref.scene import Scene
from mbref.scenes.four_bar import LENGTH, four_bar
from mbref.scenes.links import CRANK_RATE, about_z

MOST = 10_000  # iterations counted


def scaled_singular_values(scene: Scene, times: np.ndarray) -> np.ndarray:
    """Singular values (k, n) of the scaled Jacobian along the true motion at times (k,).

    Angular columns are divided by the scene's length and rows brought to unit length.
    """
    truth = truth_for(scene)
    assert truth is not None, f"{scene.name}: no truth"
    motion = truth.poses(times)
    scale = np.tile(np.repeat([1.0, 1 / constraints.scene_length(scene)], 3), len(scene.body))
    values = []
    for t, r, p in zip(motion.times, motion.position, motion.orientation, strict=True):
        j = constraints.jacobian(scene, t, r, p)[0] * scale
        values.append(np.linalg.svd(j / np.linalg.norm(j, axis=1, keepdims=True), compute_uv=False))
    return np.array(values)


def rank(values: np.ndarray) -> int:
    """Number of singular values (n,) that are not zero."""
    return int(np.sum(values > RANK * values.max()))


def fold_residual(theta: float, turned: float) -> float:
    """Largest residual (m or rad) of the driven rhombus that leaves θ₂ = theta (0 or π) on its fold.

    The crank has been driven by ``turned`` (rad) further.  At π the coupler turns with the crank about A and
    the rocker rests; at 0 crank and rocker lie on the ground and on B = D only coupler and rocker could
    turn, so that the crank rests and its driver is violated.
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
    """Times (s) up to ``last`` at which θ₂ = theta0 - 124.8 t is a multiple k of π, and k."""
    first = math.floor(theta0 / math.pi + 1e-9)
    out = [((theta0 - k * math.pi) / CRANK_RATE, k) for k in range(first, first - 1000, -1)]
    return [(t, k) for t, k in out if t <= last]


def alf_iterations(distance: float, error: float) -> int:
    """Iterations that ALF, as set for the tables, takes at θ₂ = distance (rad); MOST if more are needed.

    γ is off by ``error`` of its size in the direction that vanishes at θ₂ = 0.
    """
    model = Model(settings.kinematic(four_bar(distance)))
    terms = model.terms(0.0, model.start(), consistent_start(model).v)
    left, values, _ = np.linalg.svd(terms.jacobian)
    vanishing = left[:, rank(values) - 1]
    gamma = terms.gamma + error * np.linalg.norm(terms.gamma) * vanishing
    few, enough = 0, MOST
    while enough - few > 1:
        middle = (few + enough) // 2
        options = {**settings.ALF, "iterations": float(middle)}
        status = ALF.solve(terms.mass, terms.jacobian, terms.force, gamma, **options)[0]
        few, enough = (few, middle) if status == OK else (middle, enough)
    return enough


def turns(k: int) -> str:
    """k π as written."""
    return {0: "0", 1: "π", -1: "-π"}.get(k, f"{k}π")
