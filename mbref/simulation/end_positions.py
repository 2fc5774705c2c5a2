"""Positions at which runs end: singular positions, and dead positions of drivers.

The joints of a singular position are those whose rows depend on each other at that pose.

At a dead position the mechanism cannot follow its drivers further. Near a dead position the velocities, over
the rates of the drivers, grow with the inverse root of the remaining time: Φ_q v = ν has no solution there.
If branches of a motion cross, Φ_q also loses rank, but ν is in the range of Φ_q, and the velocities are
bounded. Near a dead position a state that violates the constraints has large velocities, too; but then
`taylor` can follow the motion further.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mbref.equations.branches import MOST_BRANCHED_ROWS
from mbref.equations.units import unit_rows
from mbref.simulation.runs import trial_of
from mbref.stepping.run import Run

TAKES_PART = 0.05  # entry of a left null vector / largest entry: rows with smaller entries are ignored
NEAR_PIVOT = 0.03  # relative pivot below which failing steps are near a singular position
TRANSMISSION = 1e2  # largest velocity / driver rate above which the position is dead
REDUNDANT_ROWS = 1e-13  # relative singular value below which rows are redundant
BEYOND = 1.01  # a run that gets beyond this multiple of the failure's time has met no dead position
MOST_DRIVEN_ROWS = 400  # constraint rows; larger least-squares problems take seconds


class Met(NamedTuple):
    """A singular position: time (s), coordinates (7 nb,), velocities (n,), and joints whose rows lose
    rank."""

    time: float
    coordinates: np.ndarray
    velocities: np.ndarray
    joints: tuple[str, ...]


def is_near(run: Run) -> bool:
    """Return whether the last step of a run that monitors pivots ended near a singular position."""
    watch = run.memory.watch
    watched = run.model.closed_loops > 0 and watch.reference_pivot > 0.0
    return bool(watched and watch.smallest_pivot < NEAR_PIVOT * watch.reference_pivot)


def met_by(run: Run, inside: bool) -> Met:
    """Return the singular position at the last accepted state, or the one that was detected ``inside`` the
    step from there to the state in memory."""
    memory, (q, v) = run.memory, _accepted(run)
    time, part = float(memory.loop.clock.time), float(memory.watch.singular_part) if inside else 0.0
    rank = _rank(run, time, q) if run.model.m <= MOST_BRANCHED_ROWS else 0
    if part > 0.0:
        time += part * (float(memory.loop.clock.attempt_end) - time)
        q, v = memory.loop.ends.pose.copy(), v + part * (memory.state.velocities - v)
    return Met(time, q, v, _joints(run, time, q, rank) if rank else ())


def _accepted(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Return coordinates and velocities of the last accepted state."""
    if run.memory.loop.clock.time == 0.0:
        return run.start.q, run.start.v
    return run.memory.previous.coordinates.copy(), run.memory.previous.velocities.copy()


def _rank(run: Run, t: float, q: np.ndarray) -> int:
    """Return the rank of Φ_q at the start, or the regular rank that the run found."""
    found = int((_singular_values(run, t, q)[0] > run.limits.rank_tolerance).sum())
    return max(found, int(run.memory.watch.generic_rank) - run.links, 1)


def _singular_values(run: Run, t: float, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return singular values and left singular vectors (m, m) of Φ_q with unit rows and columns scaled to
    unit length."""
    terms, model = run.model.terms(t, q, angles=run.memory.equations.angles), run.model
    left, values, _ = np.linalg.svd(unit_rows(terms.jacobian * model.data.metric_root))
    return np.concatenate([values, np.zeros(model.m)]), left


def _joints(run: Run, t: float, q: np.ndarray, rank: int) -> tuple[str, ...]:
    """Return the joints whose rows take part in dependences of Φ_q that exist at this pose only."""
    values, left = _singular_values(run, t, q)
    lost = [k for k in range(min(rank, left.shape[1])) if values[k] < max(NEAR_PIVOT, 2.0 * values[rank - 1])]
    part = np.linalg.norm(left[:, lost], axis=1)
    rows = np.flatnonzero(part > TAKES_PART * part.max(initial=0.0))
    return tuple(dict.fromkeys(run.model.row_joint[row] for row in rows))


def is_at_dead_position(run: Run) -> bool:
    """Return whether a run that failed is at a dead position of its drivers."""
    state, model = run.memory.state, run.model
    angles = run.memory.equations.angles
    is_finite = np.isfinite(state.coordinates).all() and np.isfinite(angles).all()
    if not run.scene.driver or model.m > MOST_DRIVEN_ROWS or not is_finite:
        return False
    now, length = float(run.memory.loop.clock.time), model.length
    terms = model.terms(now, state.coordinates, angles=angles)
    jacobian = terms.jacobian * np.tile(np.repeat([length, 1.0], 3), model.nb)
    velocities = np.linalg.lstsq(jacobian, terms.nu, rcond=REDUNDANT_ROWS)[0]
    rate = np.abs(terms.nu).max() * max(1.0, 1.0 / length)
    if not np.abs(velocities).max() > TRANSMISSION * rate > 0.0:
        return False
    trial = trial_of(run)
    return trial is None or not (trial.completed or trial.reached > BEYOND * now)
