"""Starts at rest on a singular position, which the motion leaves along one of the branches that meet there.

Φ_q leaves more freedoms there than any branch has, and accelerations that it allows leave the constraints.
Of the accelerations along the branches, Gauss's principle of least constraint takes the one nearest to that
of free bodies, in the metric of M.
"""

from __future__ import annotations

import numpy as np

from mbref.equations.branches import MOST_ROWS, tangents
from mbref.simulation.run import Run

STILL = 1e-12  # of a force along a branch over the largest: a body that nothing moves stays at rest


def begins_at_rest(run: Run) -> bool:
    """Whether a run that projects begins closed loops without drivers at rest, with more than one freedom of
    first order."""
    if run.scene.driver or np.any(run.start.v) or not run.model.closed_loops or run.model.m > MOST_ROWS:
        return False
    if not run.method.stabilisation.projects:
        return False
    return run.part.active.velocities.size - int(run.memory.watch.generic_rank) > 1


def leaving_acceleration(run: Run) -> np.ndarray | None:
    """The acceleration (n,) of a run from rest along a branch; None unless several branches meet there.

    It is u (uᵀ g) / (uᵀ M u) of the direction u for which (uᵀ g)² / (uᵀ M u) is largest.
    """
    if not begins_at_rest(run):
        return None
    found = tangents(run.model, run.start.q)
    if len(found) < 2:
        return None
    terms = run.model.terms(0.0, run.start.q, run.start.v)
    push, inertia = found @ terms.force, np.einsum("bi,i,bi->b", found, run.model.mass, found)
    best = int(np.argmax(push**2 / inertia))
    if not abs(push[best]) > STILL * np.abs(terms.force).max(initial=0.0) * np.abs(found[best]).max():
        return None
    return found[best] * (push[best] / inertia[best])
