"""Degrees of freedom that the drivers of a scene leave, without the additional degrees of freedom of a
singular start."""

from __future__ import annotations

import numpy as np

from mbref.equations.diagnosis import rank_at_start, rank_of, scaled_jacobian
from mbref.equations.initial_state import Start, consistent_start, solve_positions
from mbref.equations.model import Model, displaced
from mbref.scene import Scene

PERTURBATION = 1e-2  # rad; rotation of the fastest body away from a singular start
RANK_TOLERANCE = 1e-10  # relative residual of least squares below which rows are consistent


def undriven_freedoms(scene: Scene) -> int:
    """Return the degrees of freedom that no driver prescribes, counted near the start if the start is
    singular."""
    model = Model(scene)
    return freedoms_left(model, consistent_start(model))


def freedoms_left(model: Model, start: Start) -> int:
    """Return ``undriven_freedoms`` of a model with its start."""
    freedoms = model.n - rank_at_start(model, start)
    if freedoms == 0 or not model.scene.driver:
        return freedoms
    return model.n - rank_of(scaled_jacobian(model, *perturbed_state(model, start)))


def perturbed_state(model: Model, start: Start) -> tuple[float, np.ndarray]:
    """Return time and coordinates (7 nb,) at which the fastest body has turned by PERTURBATION."""
    q, v = start.q, start.v
    terms = model.terms(0.0, q, v)
    acceleration = _least(terms.jacobian, terms.gamma)
    fastest = np.max(np.abs(v.reshape(-1, 6)[:, 3:]), initial=0.0)
    t = min(1.0, PERTURBATION / fastest) if fastest > 0 else 1.0
    q, _ = solve_positions(model, t, displaced(q, t * v + 0.5 * t * t * acceleration))
    return t, q


def _least(jacobian: np.ndarray, rhs: np.ndarray) -> np.ndarray:
    """Return the least-squares solution of least norm."""
    return np.linalg.lstsq(jacobian, rhs, rcond=RANK_TOLERANCE)[0]
