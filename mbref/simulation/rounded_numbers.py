"""Rounded numbers of a scene: loops that are redundant at the start, and that a small motion opens."""

from __future__ import annotations

import numpy as np

from mbref.equations.counts import RANK_TOLERANCE, scaled_jacobian
from mbref.equations.model import displaced
from mbref.linear_algebra.least_norm import null_space
from mbref.stepping.run import Run

POSE_STEP = 0.1  # m and rad; largest change of a coordinate on the way to a nearby pose
POSE_ITERATIONS = 12  # of Newton's method, which converges from a pose within POSE_STEP of a closed one
LEAST_GAP = 100  # gap / rounding of the largest coordinate; smaller gaps are of Newton's method
MOST_GAP = 1e-5  # gap, m or rad, of numbers with five digits; a larger gap is of a singular start
MOST_ADVISED_ROWS = 300  # larger matrices take seconds
ADVICE = (
    "a small motion opens redundant loops by {:.1g} m or rad, so that the file's numbers seem to be rounded: "
    "give the axes and points of the joints with 12 digits"
)


def advice(run: Run) -> str:
    """Return the advice to give more digits; empty if redundant rows stay consistent along a small motion."""
    if run.model.m > MOST_ADVISED_ROWS:
        return ""
    gap, size = gap_of(run), max(1.0, np.abs(run.start.q).max(initial=0.0))
    return ADVICE.format(gap) if LEAST_GAP * np.finfo(float).eps * size < gap < MOST_GAP else ""


def gap_of(run: Run) -> float:
    """Return the largest |Φ| (m or rad) that Newton's method leaves near the start, at the rank of the
    start."""
    model, q = run.model, run.start.q
    jacobian = scaled_jacobian(model, 0.0, q)
    space = null_space(jacobian, RANK_TOLERANCE)
    rank, free = model.n - space.shape[1], space.sum(axis=1)
    if not free.any() or rank == model.m:
        return 0.0
    q = displaced(q, POSE_STEP * free / np.abs(free).max())
    for _ in range(POSE_ITERATIONS):
        found = model.terms(0.0, q, np.zeros(model.n))
        u, sizes, vt = np.linalg.svd(found.jacobian, full_matrices=False)
        q = displaced(q, -vt[:rank].T @ (u[:, :rank].T @ found.phi / sizes[:rank]))
    return float(np.abs(model.terms(0.0, q, np.zeros(model.n)).phi).max())
