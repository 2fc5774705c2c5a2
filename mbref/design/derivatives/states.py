"""States of a run at many times, and changes of the residuals of the equations of motion there.

A displacement of coordinates q (7 nb,) is x (n,), see ``model.displaced``. The residuals of k states are
one array (k, 3 m + n): Φ, Φ_q v - ν, Φ_q a - γ and M a + Φ_qᵀ λ - g.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from mbref import rotations
from mbref.design.differences import CENTRAL
from mbref.equations.coordinates import displace_all
from mbref.equations.model import Model, Terms
from mbref.kernels.scene_layout import SPRING

# change (lengths, rad, or of a rate) that is an underflow of rounding and counts as zero; a step of
# differences over a smaller one would overflow
UNDERFLOW = 1e-200
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
        return np.asarray(1.0 / np.where(largest > UNDERFLOW, largest, 1.0))


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


def arrays_of_terms(terms: Terms) -> list[np.ndarray]:
    """Return blocks, Φ, ν, γ and g of terms."""
    return [terms.blocks, terms.phi, terms.nu, terms.gamma, terms.force]


def sum_of_differences(weighted: Iterable[tuple[float, Terms, Terms]]) -> list[np.ndarray]:
    """Return Σ w (T₁ - T₂) over weights w and pairs of terms, as ``arrays_of_terms``."""
    total: list[np.ndarray] = []
    for weight, ahead, behind in weighted:
        parts = [one - other for one, other in zip(*map(arrays_of_terms, (ahead, behind)), strict=True)]
        for place, part in enumerate(parts):
            np.multiply(part, weight, out=part)
            if total:
                total[place] += part
        total = total or parts
    return total


class Residuals:
    """Changes of the residuals at k states whose accelerations and multipliers are constant."""

    def __init__(self, model: Model, states: States):
        self.model, self.states, self._spring = model, states, shortest_spring(model, states.q)
        fixed, columns = np.zeros((len(states.times), 6)), model.entry_columns  # of the fixed frame
        self._v, self._a = (np.concatenate([w, fixed], axis=1)[:, columns] for w in (states.v, states.a))
        bodies = columns[:, ::6].ravel() // 6
        self._of_body = (np.minimum(bodies, model.nb) == np.arange(model.nb)[:, None]).astype(float)

    def along(self, x: np.ndarray, step: float) -> np.ndarray:
        """Return the change (k, 3 m + n) by displacements x (k, n), by differences of a step, see
        ``Direction.steps``."""
        model, states = self.model, self.states
        sizes = np.abs(x / model.units).max(axis=1, initial=0.0)
        steps = (step * self._spring / np.where(sizes > UNDERFLOW, sizes, 1.0))[:, None]

        def at(h: np.ndarray) -> Terms:
            return terms_along(model, states._replace(q=states.displaced(h * x)))

        pairs = ((w, at(k * steps), at(-k * steps)) for k, w in enumerate(CENTRAL, 1))
        return self.of_terms(sum_of_differences(pairs)) / steps

    def by_velocity(self, v: np.ndarray) -> np.ndarray:
        """Return the change (k, 3 m + n) by changes of velocity v (k, n) in γ and g, which are polynomials of
        degree 2; the change of Φ_q v - ν is left out."""
        states, sizes = self.states, np.abs(v).max(axis=1, initial=0.0)
        speed = FAST * np.abs(states.v).max(initial=0.0) or 1.0
        h = (speed / np.where(sizes > UNDERFLOW, sizes, 1.0))[:, None]
        ahead, behind = (terms_along(self.model, states._replace(v=states.v + s * v)) for s in (h, -h))
        gamma, force = (ahead.gamma - behind.gamma) / (2 * h), (ahead.force - behind.force) / (2 * h)
        return np.concatenate([np.zeros((len(v), 2 * self.model.m)), -gamma, -force], axis=1)

    def of_terms(self, change: list[np.ndarray], mass: np.ndarray | float = 0.0) -> np.ndarray:
        """Return the change (k, 3 m + n) by a change of ``arrays_of_terms`` and of M (n,)."""
        blocks, phi, nu, gamma, force = change
        (count, m), n = phi.shape, self.model.n
        rates, pulls = np.zeros((2, count, m)), np.zeros((count, n))
        if blocks.any():
            for rate, w in zip(rates, (self._v, self._a), strict=True):
                np.einsum("kmj,kmj->km", blocks, w, out=rate)
            pulled = (blocks * self.states.multipliers[:, :, None]).reshape(count, -1, 6)
            pulls = (self._of_body @ pulled).reshape(count, n)
        own = mass * self.states.a + pulls - force
        return np.concatenate([phi, rates[0] - nu, rates[1] - gamma, own], axis=1)
