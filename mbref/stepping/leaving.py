"""Starts on a singular position, which the motion leaves along one of the branches that meet there.

At a singular position Φ_q allows more velocities than any branch has, and accelerations that Φ_q allows may
violate the constraints. A motion continues along the branch of its velocities. The branch is unique if the
rates of the second-order forms along these velocities are independent.  From rest, Gauss's principle of least
constraint selects, among accelerations along the branches, the acceleration nearest to free bodies, in the
metric of M.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mbref.equations.branches import MOST_BRANCHED_ROWS, fit_to_branches, tangents
from mbref.equations.initial_state import MET, rate_violation
from mbref.stepping.run import Run

NEAR_SINGULAR = 1e-6  # smallest singular value of unit rows below which a start is near a singular position
NO_FORCE = 1e-12  # force along a branch / largest force, below which the body stays at rest


class Leaving(NamedTuple):
    """Departure from a singular position at t = 0: velocities (n,), and the acceleration (n,) along them, or
    from rest."""

    coordinates: np.ndarray
    velocities: np.ndarray
    acceleration: np.ndarray


def leaving(run: Run) -> Leaving | None:
    """Return how a run leaves a start that is a singular position with branches that second order separates,
    or None."""
    if begins_at_rest(run):
        acceleration = leaving_acceleration(run)
        return None if acceleration is None else Leaving(run.start.q, run.start.v, acceleration)
    if not (begins_in_motion(run) or begins_near_singular(run)):
        return None
    fit = fit_to_branches(run.model, 0.0, run.start.q, run.start.v)
    if fit is None or not (fit.fits and fit.is_simple):
        return None
    return Leaving(run.start.q, run.start.v, acceleration_along(run))


def acceleration_along(run: Run) -> np.ndarray:
    """Return the acceleration (n,) by which the forces increase the speed along the velocities of the start,
    without drivers.

    The acceleration is zero if the forces reduce the speed: a slow motion may return to the start.
    """
    q, v = run.start.q, run.start.v
    push = float(v @ run.model.terms(0.0, q, v).force)
    if run.scene.driver or push <= 0.0:
        return np.zeros_like(v)
    return v * (push / float(v @ (run.model.mass * v)))


def fits_no_branch(run: Run) -> bool:
    """Return whether a run starts at a singular position with velocities that agree with no branch."""
    fit = fit_to_branches(run.model, 0.0, run.start.q, run.start.v) if begins_in_motion(run) else None
    return fit is not None and not fit.fits


def begins_on_singular_position(run: Run) -> bool:
    """Return whether a run with projection starts at a singular position at which several branches meet."""
    if begins_at_rest(run):
        return len(tangents(run.model, run.start.q)) > 1
    if not (begins_in_motion(run) or begins_near_singular(run)):
        return False
    return fit_to_branches(run.model, 0.0, run.start.q, run.start.v) is not None


def freedoms_of_first_order(run: Run) -> int:
    """Return the number of velocities that Φ_q allows at the start of a run with projection; 0 if ranks are
    not computed."""
    if not run.method.stabilisation.projects or run.model.m > MOST_BRANCHED_ROWS:
        return 0
    return int(run.memory.active.velocities.size - run.memory.watch.generic_rank + run.links)


def begins_at_rest(run: Run) -> bool:
    """Return whether a run starts at rest, with closed loops without drivers, and Φ_q allows two velocities
    or more."""
    if run.scene.driver or run.start.v.any() or not run.model.closed_loops:
        return False
    return freedoms_of_first_order(run) > 1


def begins_in_motion(run: Run) -> bool:
    """Return whether a run starts in motion, with closed loops and dependent rows, and two velocities or more
    are allowed.

    Time counts as one velocity if drivers prescribe the motion.
    """
    if run.memory.equations.system.settings.independent or not run.start.v.any():
        return False
    return freedoms_of_first_order(run) > (0 if run.scene.driver else 1) and run.model.closed_loops > 0


def begins_near_singular(run: Run) -> bool:
    """Return whether a run starts so near to a singular position that rounding errors of the start change the
    direction of its velocities.

    The velocities must satisfy Φ_q v = ν to rounding; velocities near a gap, which belong to no branch, do
    not.
    """
    if not run.ranks.least < NEAR_SINGULAR or not run.start.v.any():
        return False
    return rate_violation(run.model, run.start.q, run.start.v) <= MET


def leaving_acceleration(run: Run) -> np.ndarray | None:
    """Return the acceleration (n,) of a run from rest along a branch; None unless several branches meet
    there.

    The acceleration is u (uᵀ g) / (uᵀ M u) for the direction u with the largest (uᵀ g)² / (uᵀ M u).
    """
    found = tangents(run.model, run.start.q)
    if len(found) < 2:
        return None
    terms = run.model.terms(0.0, run.start.q, run.start.v)
    push, inertia = found @ terms.force, np.einsum("bi,i,bi->b", found, run.model.mass, found)
    best = int(np.argmax(push**2 / inertia))
    if not abs(push[best]) > NO_FORCE * np.abs(terms.force).max(initial=0.0) * np.abs(found[best]).max():
        return None
    return found[best] * (push[best] / inertia[best])
