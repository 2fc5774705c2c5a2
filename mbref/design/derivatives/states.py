"""States of a run at many times, and the residuals of the equations of motion there.

A displacement of coordinates q (7 nb,) is x (n,), see ``model.displaced``. The residuals of k states are
one array (k, 3 m + n): Φ, Φ_q v - ν, Φ_q a - γ and M a + Φ_qᵀ λ - g.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbref import rotations
from mbref.design.differences import directional_derivative
from mbref.equations.coordinates import displace_all
from mbref.equations.model import Model, Terms
from mbref.kernels.scene_layout import SPRING

if TYPE_CHECKING:
    from scipy.sparse import csr_array

FAST = 10.0  # of which residuals and outputs are polynomials of low degree, so that only rounding limits it


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
        q, h = self.q.copy(), steps[:, None]
        displace_all(q, np.ascontiguousarray(h * along.x), np.zeros(q.shape[1]))
        parts = (
            self.v + h * along.v,
            self.angles,
            self.a + h * along.a,
            self.multipliers + h * along.multipliers,
        )
        return States(self.times, q, *parts)


class Direction(NamedTuple):
    """Changes of k states: displacements x (k, n), and changes of v, a (k, n) and λ (k, m)."""

    x: np.ndarray
    v: np.ndarray
    a: np.ndarray
    multipliers: np.ndarray

    def steps(self, states: States, model: Model, step: float) -> np.ndarray:
        """Return the steps (k,) of differences along the direction: bodies move by ``step`` (lengths of the
        mechanism or of its shortest spring, or rad); velocities, accelerations and multipliers change by at
        most FAST times the largest ones of the run."""
        changes = zip(self[1:], (states.v, states.a, states.multipliers), strict=True)
        shares = [
            np.abs(change).max(axis=1, initial=0.0) / (FAST * np.abs(whole).max(initial=0.0) or 1.0)
            for change, whole in changes
        ]
        moved = np.abs(self.x / model.units).max(axis=1, initial=0.0) / (
            step * shortest_spring(model, states.q)
        )
        largest = np.max([moved, *shares], axis=0)
        return np.asarray(1.0 / np.where(largest > 0.0, largest, 1.0))


def shortest_spring(model: Model, q: np.ndarray) -> np.ndarray:
    """Return the length (k,) of the shortest spring at q (k, 7 nb) over the mechanism's; at most 1."""
    loads, count = model.data.loads, len(q)
    springs = np.flatnonzero(loads.kind == SPRING)
    frame = np.broadcast_to([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (count, 1, 7))
    poses = np.concatenate([q.reshape(count, model.nb, 7), frame], axis=1)
    ends = (
        poses[:, bodies, :3] + rotations.rotate(poses[:, bodies, 3:], points[None])
        for bodies, points in (
            (loads.first[springs], loads.point_first[springs]),
            (loads.second[springs], loads.point_second[springs]),
        )
    )
    lengths = np.linalg.norm(np.subtract(*ends), axis=2) / model.length
    return np.asarray(lengths.min(axis=1, initial=1.0))


def terms_along(model: Model, states: States) -> Terms:
    """Return the terms at states, with the angles of springs and couplings nearest to the states' angles."""
    return model.terms(states.times, states.q, states.v, states.angles)


def residuals(model: Model, states: States) -> np.ndarray:
    """Return the residuals (k, 3 m + n) of the equations at states."""
    terms = terms_along(model, states)
    blocks, count = terms.blocks, len(states.times)

    def along(vectors: np.ndarray) -> np.ndarray:
        padded = np.concatenate([vectors, np.zeros((count, 6))], axis=1)  # no velocity of the fixed frame
        return np.asarray((blocks * padded[:, model.entry_columns]).sum(axis=2))

    pulls = (blocks * states.multipliers[:, :, None]).reshape(count, -1) @ model.once(_incidence)
    force = terms.mass * states.a + pulls[:, : model.n] - terms.force
    rates = along(states.v) - terms.nu, along(states.a) - terms.gamma
    return np.concatenate([terms.phi, *rates, force], axis=1)


def _incidence(model: Model) -> csr_array:
    """Return the matrix (12 m, n + 6) that adds the entries of the blocks to their columns."""
    from scipy.sparse import csr_array

    columns = model.entry_columns.ravel()
    return csr_array((np.ones(columns.size), (np.arange(columns.size), columns)), (columns.size, model.n + 6))


def change_along(model: Model, states: States, along: Direction, step: float) -> np.ndarray:
    """Return the derivative (k, 3 m + n) of the residuals along a direction, by differences of a step."""
    steps = along.steps(states, model, step)
    if not along.x.any():  # residuals are polynomials of degree 2 in v
        ahead, behind = (residuals(model, states.moved(along, sign * steps)) for sign in (1.0, -1.0))
        return (ahead - behind) / (2.0 * steps[:, None])
    change = directional_derivative(lambda h: residuals(model, states.moved(along, h)), steps)
    return np.asarray(change / steps[:, None])
