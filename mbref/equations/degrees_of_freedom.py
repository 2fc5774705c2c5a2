"""Freedoms that the drivers of a scene leave, told apart from those of a singular start."""

from __future__ import annotations

import numpy as np

from mbref.equations.diagnosis import rank_of, scaled_jacobian
from mbref.equations.initial_state import consistent_start
from mbref.equations.model import Model, displaced
from mbref.scene import Scene

A_LITTLE = 1e-2  # rad, to look beside a singular start
TOLERANCE, MOST_ITERATIONS = 1e-13, 20
RANK_TOLERANCE = 1e-10  # relative, of least-squares solutions: redundant rows are consistent


def undriven_freedoms(scene: Scene) -> int:
    """Degrees of freedom that no driver prescribes; looked at beside the start where that is singular."""
    freedoms = scene.counts().degrees_of_freedom
    if freedoms == 0 or not scene.driver:
        return freedoms
    model = Model(scene)
    return model.n - rank_of(scaled_jacobian(model, *_a_little_later(model)))


def _a_little_later(model: Model) -> tuple[float, np.ndarray]:
    """Time and coordinates (7 nb,) when the fastest body has turned by A_LITTLE, as near as Newton gets."""
    start = consistent_start(model)
    q, v = start.q, start.v
    terms = model.terms(0.0, q, v)
    acceleration = _least(terms.jacobian, terms.gamma)
    fastest = np.max(np.abs(v.reshape(-1, 6)[:, 3:]), initial=0.0)
    t = min(1.0, A_LITTLE / fastest) if fastest > 0 else 1.0
    q = displaced(q, t * v + 0.5 * t * t * acceleration)
    for _ in range(MOST_ITERATIONS):
        terms = model.terms(t, q, v)
        if np.max(np.abs(terms.phi)) <= TOLERANCE:
            break
        q = displaced(q, _least(terms.jacobian, -terms.phi))
    return t, q


def _least(jacobian: np.ndarray, rhs: np.ndarray) -> np.ndarray:
    """The least-squares solution of least norm."""
    return np.linalg.lstsq(jacobian, rhs, rcond=RANK_TOLERANCE)[0]
