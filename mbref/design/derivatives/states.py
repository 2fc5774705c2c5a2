"""States of a run at many times, with displacements x (n,) of coordinates q, see ``model.displaced``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from mbref.design.meeting_ends import MEETING, refuse_meeting_ends, spring_gaps
from mbref.equations.coordinates import displace_all
from mbref.equations.model import Model, Terms

# change (lengths, rad, or of a rate) that is an underflow of rounding and counts as zero; a step of
# differences over a smaller one would overflow
UNDERFLOW = 1e-200
FAST = 10.0  # of which residuals and outputs are polynomials of low degree, so that only rounding limits it


StateArrays = TypeVar("StateArrays", bound=tuple[np.ndarray, ...])


class States(NamedTuple):
    """States at k times (k,), s: q (k, 7 nb), v (k, n), angles of turning joints (k, angles), accelerations
    (k, n) and multipliers (k, m)."""

    times: np.ndarray
    q: np.ndarray
    v: np.ndarray
    angles: np.ndarray
    a: np.ndarray
    multipliers: np.ndarray

    def at(self, places: np.ndarray | list[int] | slice) -> States:
        """Return the states at some times."""
        return States(*(each[places] for each in self))

    def moved(self, along: Direction, steps: np.ndarray) -> States:
        """Return the states displaced along a direction by steps (k,)."""
        h = steps[:, None]
        parts = (
            self.v + h * along.v,
            self.angles,
            self.a + h * along.a,
            self.multipliers + h * along.multipliers,
        )
        return States(self.times, self.displaced(h * along.x), *parts)

    def displaced(self, x: np.ndarray) -> np.ndarray:
        """Return the coordinates displaced by x (k, n)."""
        q = self.q.copy()
        displace_all(q, np.ascontiguousarray(x), np.zeros(q.shape[1]))
        return q


def state_at_rest(model: Model, q: np.ndarray, angles: np.ndarray | None = None) -> States:
    """Return the state (1,) at rest at coordinates q (7 nb,) and angles (a,), by default within half a turn,
    without accelerations."""
    none, near = np.zeros((1, model.n)), np.zeros((1, len(model.structure.places.turning)))
    near = near if angles is None else angles[None]
    return States(np.zeros(1), q[None], none, near, none, np.zeros((1, model.m)))


def joined(parts: Sequence[StateArrays]) -> StateArrays:
    """Return all states of a sequence, or all changes, in their order."""
    return type(parts[0])(*map(np.concatenate, zip(*parts, strict=True)))


class Direction(NamedTuple):
    """Changes of k states: displacements x (k, n), and changes of v, a (k, n) and λ (k, m)."""

    x: np.ndarray
    v: np.ndarray
    a: np.ndarray
    multipliers: np.ndarray

    def steps(self, states: States, model: Model, step: float | np.ndarray) -> np.ndarray:
        """Return the steps (k,) of differences along the direction. Bodies move by ``step``, a number or
        (k,), in lengths of the mechanism or of its shortest spring, or rad; velocities, accelerations and
        multipliers change by at most FAST times the largest ones of the run."""
        changes = zip(self[1:], (states.v, states.a, states.multipliers), strict=True)
        shares = [
            np.abs(change).max(axis=1, initial=0.0) / (FAST * np.abs(whole).max(initial=0.0) or 1.0)
            for change, whole in changes
        ]
        moved = np.abs(self.x / model.units).max(axis=1, initial=0.0) / (
            step * shortest_spring(model, states.q)
        )
        largest = np.max([moved, *shares], axis=0)
        return np.asarray(1.0 / np.where(largest > UNDERFLOW, largest, 1.0))


def shortest_spring(model: Model, q: np.ndarray) -> np.ndarray:
    """Return the length (k,) of the shortest spring at q (k, 7 nb) over the mechanism's; at most 1. Springs
    whose ends meet do not count: only forces that are linear there have derivatives."""
    lengths = np.linalg.norm(spring_gaps(model, q), axis=2) / model.length
    return np.asarray(np.where(lengths > MEETING, lengths, 1.0).min(axis=1, initial=1.0))


def refuse_abrupt_springs(model: Model, at: States, basis: np.ndarray, by_points: bool) -> None:
    """Raise SceneError if the force of a spring changes abruptly at a state (1,), along the freedoms (n, f)
    or with the points of the scene."""
    moving = at.v[0] / model.units
    columns = np.column_stack([basis, moving] + [np.eye(model.n)] * (by_points and bool(moving.any())))
    refuse_meeting_ends(model, at.q[0], columns, "derivatives do not exist")


def terms_along(model: Model, states: States) -> Terms:
    """Return the terms at states, with the angles of springs and couplings nearest to the states' angles."""
    return model.terms(states.times, states.q, states.v, states.angles)
