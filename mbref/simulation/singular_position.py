"""The singular position at which a run that watches the rank has ended: time, pose and joints.

The pose lies on the way of the last step, where the least singular value of Φ_q is least; the joints have
rows that depend on each other there.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mbref.equations.branches import MOST_ROWS
from mbref.equations.model import displaced, displacement
from mbref.equations.units import row_lengths
from mbref.simulation.run import Run

PLACES, SECTIONS, GOLDEN = 16, 40, 0.6180339887498949  # of the search along the step
TAKES_PART = 0.05  # of the largest part of a row in a dependence: less is of rows beside it
NEAR = 0.03  # relative pivot below which steps that fail are near a singular position


class Met(NamedTuple):
    """A singular position at a time (s): coordinates (7 nb,), velocities (n,), and joints that lose rank."""

    time: float
    coordinates: np.ndarray
    velocities: np.ndarray
    joints: tuple[str, ...]


def is_near(run: Run) -> bool:
    """Whether the last step of a run that watches pivots ended near a singular position."""
    watch = run.memory.watch
    watched = run.model.closed_loops > 0 and watch.reference_pivot > 0.0
    return bool(watched and watch.smallest_pivot < NEAR * watch.reference_pivot)


def met_by(run: Run, inside: bool) -> Met:
    """Return the singular position at the last accepted state, or ``inside`` the step from there to the state
    in memory."""
    memory = run.memory
    start = float(memory.loop.clock.time)
    q, v = _accepted(run)
    if run.model.m > MOST_ROWS:
        return Met(start, q, v, ())
    width = max(float(memory.loop.clock.attempt_end) - start, 0.0) if inside else 0.0
    after, speeds = (memory.state.coordinates.copy(), memory.state.velocities.copy()) if width else (q, v)
    way, rank = displacement(q, after), max(_rank(run, start, q), _rank(run, start + width, after))

    def pose(part: float) -> np.ndarray:
        """The pose at a part of the step, by Hermite's cubic polynomial."""
        rest = 1.0 - part
        bent = rest * (width * v - way) - part * (width * speeds - way)
        return displaced(q, part * (way + rest * bent))

    def least(part: float) -> float:
        return float(_singular_values(run, start + part * width, pose(part))[0][rank - 1])

    part = _place_of_least(least) if width else 0.0
    time, coordinates = start + part * width, pose(part)
    return Met(time, coordinates, v + part * (speeds - v), _joints(run, time, coordinates, rank))


def _accepted(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates and velocities of the last accepted state."""
    if run.memory.loop.clock.time == 0.0:
        return run.start.q, run.start.v
    return run.memory.previous.coordinates.copy(), run.memory.previous.velocities.copy()


def _rank(run: Run, t: float, q: np.ndarray) -> int:
    """The rank of Φ_q, or that which the run has known."""
    found = int((_singular_values(run, t, q)[0] > run.limits.rank_tolerance).sum())
    return max(found, int(run.memory.watch.generic_rank), 1)


def _singular_values(run: Run, t: float, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Singular values, and left singular vectors (m, m), of unit rows of Φ_q in columns of unit length."""
    terms, model = run.model.terms(t, q, np.zeros(run.model.n)), run.model
    jacobian = terms.jacobian * model.data.metric_root
    left, values, _ = np.linalg.svd(jacobian / row_lengths(jacobian)[:, None])
    return np.concatenate([values, np.zeros(model.m)]), left


def _place_of_least(function: Callable[[float], float]) -> float:
    """The part of a step, 0 to 1, at which a function is least, by golden section about the least of some."""
    places = np.linspace(0.0, 1.0, PLACES + 1)
    k = int(np.argmin([function(p) for p in places]))
    low, high = places[max(k - 1, 0)], places[min(k + 1, PLACES)]
    for _ in range(SECTIONS):
        one, other = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        if function(one) < function(other):
            high = other
        else:
            low = one
    return float(0.5 * (low + high))


def _joints(run: Run, t: float, q: np.ndarray, rank: int) -> tuple[str, ...]:
    """The joints whose rows have a part in the dependence that Φ_q has there beyond its regular one."""
    _, left = _singular_values(run, t, q)
    part = np.abs(left[:, rank - 1]) if rank <= left.shape[1] else np.zeros(0)
    rows = np.flatnonzero(part > TAKES_PART * part.max(initial=0.0))
    return tuple(dict.fromkeys(run.model.row_joint[row] for row in rows))
