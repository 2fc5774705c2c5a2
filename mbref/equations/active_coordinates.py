"""Active coordinates: the coordinates of a scene that can move; all others need no equation.

Rows and columns of Φ_q that are connected by nonzero entries form a block. A block without force, γ, Φ, ν and
initial velocity stays at rest with zero multipliers. An example is the motion of a planar mechanism out of
its plane. Entries are tested for zero at random states of the active coordinates, since an expression that is
not identically zero does not vanish at a random state.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from mbref.equations.model import Model, Terms, all_displaced

STATES = 2  # number of random states; an entry may vanish at one state by chance
STILL = 1e-12  # relative to the length, 1 rad, or the largest velocity: smaller numbers are rounding


class RandomStates(NamedTuple):
    """Random states: k times as fractions of the duration, displacements (k, n) of the coordinates, and
    velocities (k, n)."""

    part: np.ndarray
    displacement: np.ndarray
    velocity: np.ndarray

    def of(self, moving: np.ndarray) -> RandomStates:
        """Return states in which only these entries (n,) are displaced and have a velocity."""
        return RandomStates(self.part, moving * self.displacement, moving * self.velocity)

    def about(self, q: np.ndarray, duration: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return times (k,) in s, coordinates (k, 7 nb) displaced from q (7 nb,), and velocities (k, n)."""
        return self.part * duration, all_displaced(q, self.displacement), self.velocity


@lru_cache(maxsize=64)
def random_states(count: int, n: int) -> RandomStates:
    """Return ``count`` random states, which depend on the arguments only."""
    rng = np.random.default_rng(1)
    drawn = [(rng.uniform(0.1, 1.0), rng.normal(size=n), rng.normal(size=n)) for _ in range(count)]
    part, displacement, velocity = map(np.array, zip(*drawn, strict=True))
    return RandomStates(part, displacement, velocity)


def active_entries(
    model: Model, q: np.ndarray, v: np.ndarray, read: list[RandomStates] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return which velocities (n,) can be nonzero, and which of their Jacobian entries (m, 12) can be
    nonzero.

    q (7 nb,) and v (6 nb,) are the start. Entries have the columns of ``layout.System.blocks``. The states at
    which equations are evaluated are appended to ``read``.
    """
    states, steady = random_states(STATES, model.n), _steady(model)
    moving = np.zeros(model.n, dtype=bool)
    entries, start_rows, start_columns = patterns(model, model.terms(np.zeros(1), q, v))
    start_columns |= v != 0
    while True:
        sample = states.of(moving)
        if read is not None:
            read.append(sample)
        about = sample.about(q, model.scene.duration)
        others, rows, columns = patterns(model, model.terms(*about))
        if steady is not None:
            columns |= patterns(steady, steady.terms(*about))[2]
        entries |= others
        found, driven = reached(model, entries, rows | start_rows, columns | start_columns)
        if np.array_equal(found, moving):
            return moving, entries & driven[:, None]
        moving = found


def _steady(model: Model) -> Model | None:
    """Return the model with all time-dependent loads at their full value; None if no load depends on time.

    With the actual values, a load that is zero at all random states would be overlooked.
    """
    if not any(load.over_time for load in model.scene.load):
        return None
    loads = [
        load.model_copy(update={"factor": None}) if load.over_time else load for load in model.scene.load
    ]
    return Model(model.scene.with_(load=loads))


def patterns(model: Model, terms: Terms) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return which entries (m, 12) of the Jacobian are nonzero at any of k states.

    Also return which rows (m,) prescribe a motion, and on which columns (n,) a force acts.
    """
    entries, rows, columns = (np.any(found, axis=0) for found in nonzero(model, terms))
    return np.asarray(entries), np.asarray(rows), np.asarray(columns)


def nonzero(model: Model, terms: Terms) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return ``patterns`` of each state: entries (…, m, 12), rows (…, m) and columns (…, n)."""
    entries: np.ndarray = (terms.blocks != 0) & model.structure.of_bodies
    rows: np.ndarray = (terms.gamma != 0) | (terms.phi != 0) | (terms.nu != 0)
    return entries, rows, np.not_equal(terms.force, 0)


def reached(
    model: Model, entries: np.ndarray, rows: np.ndarray, columns: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return columns (n,) and rows (m,) of the blocks that contain one of the given rows or columns."""
    row, entry = np.nonzero(entries)
    column = model.entry_columns[row, entry]
    of_rows, of_columns = _blocks(row, column, model.m, model.n)
    found = np.zeros(model.n + 1, dtype=bool)
    found[of_rows[rows]] = found[of_columns[columns]] = True
    found[model.n] = False
    return found[of_columns], rows | found[of_rows]


def _blocks(row: np.ndarray, column: np.ndarray, m: int, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the block of each of m rows and n columns, which entries at rows (e,) and columns (e,) connect.

    A block is numbered by its first column; n stands for a row without entries. Each pass joins a block to
    the first one with which it shares a row, so that chains of blocks need few passes.
    """
    first = np.arange(n)
    while True:
        of_rows = np.full(m, n)
        np.minimum.at(of_rows, row, first[column])
        joined = first.copy()
        np.minimum.at(joined, first[column], of_rows[row])
        joined = joined[joined]
        if np.array_equal(joined, first):
            return of_rows, first
        first = joined


def without_rounding(
    q: np.ndarray, v: np.ndarray, given: np.ndarray, length: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return coordinates (s, 7 nb) and velocities (s, 6 nb) of starts with entries of round-off size set to
    zero.

    Velocities that the scenes give (``given``, (s, 6 nb)) are unchanged. The s scenes have lengths (s,) in m.
    """
    small = np.full((len(q), q.shape[1] // 7, 7), STILL)
    small[..., :3] *= length[:, None, None]
    largest = np.abs(v).max(axis=1, keepdims=True, initial=0.0)
    still = (np.abs(v) < STILL * largest) & (given == 0)
    return np.where(np.abs(q) < small.reshape(q.shape), 0.0, q), np.where(still, 0.0, v)


def active_coordinates(q: np.ndarray, velocities: np.ndarray) -> np.ndarray:
    """Return which coordinates can change from q (7 nb,) if these entries of v can be nonzero, as indices
    into q.

    A rotation about axis k of a body's own frame mixes the Euler parameters e0 and ek, and the two other
    Euler parameters.
    """
    moves = [7 * (c // 6) + c % 6 for c in velocities.tolist() if c % 6 < 3]
    turns: dict[int, list[int]] = {}
    for column in velocities.tolist():
        if column % 6 >= 3:
            turns.setdefault(column // 6, []).append(column % 6 - 3)
    for body, axes in turns.items():
        first = 7 * body + 3
        reached = _mixed({k for k in range(4) if q[first + k] != 0.0}, axes)
        moves += [first + k for k in reached]
    return np.array(sorted(moves), dtype=np.int64)


def _mixed(reached: set[int], axes: Sequence[int]) -> set[int]:
    """Return the Euler parameters that rotations about these axes make nonzero, in addition to the Euler
    parameters that are reached already."""
    pairs = [pair for k in axes for pair in ({0, 1 + k}, {1 + (k + 1) % 3, 1 + (k + 2) % 3})]
    while True:
        found = reached.union(*(pair for pair in pairs if pair & reached))
        if found == reached:
            return found
        reached = found


def primitives_with(model: Model, rows: np.ndarray) -> np.ndarray:
    """Return the numbers of the primitive constraints that contain one of the given constraint rows."""
    last = np.searchsorted(model.structure.row, rows, side="right") - 1
    return np.flatnonzero(np.isin(model.structure.row, model.structure.row[last]))
