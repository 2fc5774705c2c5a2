"""What constraint rows hold at rest although forces act on it: a slider's sides, a crank's other axes.

A group of rows, perpendicular to each other, of constant length and as many as the columns they bear on, that
prescribes no motion is a square system Φ_q v = 0, nowhere singular: its only solution is v = 0, from the
start on.  These rows and columns are left out of the factorisation, after which other rows may bear on as
few; their multipliers follow from the forces on the columns.  How rows are is asked at random states of
everything else: what is held need not be moved, because it rests.

Columns on which a redundant row bears stay, because how reactions are shared depends on all of them; so do
columns without mass, which formulations refuse.  Where a driver works against what is held, nothing is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from mbref.equations.initial_state import Start
from mbref.equations.model import Model, displaced
from mbref.kernels.compilation import inlined
from mbref.kernels.layout import COLUMNS, FORCE, JACOBIAN, MULTIPLIERS, ROWS
from mbref.linear_algebra.minimum_norm import LeastChange, sparse_jacobian
from mbref.linear_algebra.redundancy import null_shares
from mbref.linear_algebra.sparse_cholesky import part
from mbref.linear_algebra.symbolic_factorisation import (
    HELD_COLUMN,
    HELD_ENTRY,
    HELD_OTHER,
    HELD_ROW,
    HELD_START,
    OTHER_START,
    Held,
    columns_held,
    lies_in,
)

STATES = 3  # random states asked
MOST = 3  # columns that rows together hold
SMALL = 1e-9  # length of a row (1 or m) that may be rounding
ROUNDING = 1e-12  # relative, of what is constant or perpendicular
REDUNDANT = 1e-10  # share of a row in the left null space; with singular values over 1e-2 others have 1e-12


def held_by_rows(
    model: Model, start: Start, moving: np.ndarray, entries: np.ndarray
) -> tuple[list[Held], np.ndarray]:
    """What rows hold of the velocities that move (n,) from the start, in the order found.

    And which of the Jacobian's ``entries`` (m, 12) can be other than zero while it rests.
    """
    can_rest = moving & (model.mass > 0)
    held, left = _found(model, start.q, moving, entries, can_rest)
    shared = _shared(model, start, entries, held)
    if shared.any():
        held, left = _found(model, start.q, moving, entries, can_rest & ~shared)
    return held, left


def at_rest(start: Start, held: Sequence[Held]) -> Start:
    """The start with zero for the roundings of zero in the velocities held."""
    v = start.v.copy()
    v[columns_held(held)] = 0.0
    return replace(start, v=v)


def _found(
    model: Model, q: np.ndarray, moving: np.ndarray, entries: np.ndarray, can_rest: np.ndarray
) -> tuple[list[Held], np.ndarray]:
    """As ``held_by_rows``, of the columns that can rest (n,)."""
    resting = can_rest
    while resting.any():
        samples, driven = _samples(model, q, moving & ~resting)
        left = entries & (samples != 0).any(axis=0)
        held = list(_holding(model, samples, left, driven, moving, can_rest))
        found = np.isin(np.arange(model.n), columns_held(held))
        if not (resting & ~found).any():
            works_against = driven & left.any(axis=1) & ~_bears_on(model, left, moving & ~found)
            return ([], entries) if works_against.any() else (held, left)
        resting = resting & found
    return [], entries


def _samples(model: Model, q: np.ndarray, displacing: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Jacobian blocks (STATES, m, 12) at random states, and which rows (m,) prescribe a motion."""
    rng, samples, driven = np.random.default_rng(2), [], np.zeros(model.m, dtype=bool)
    for _ in range(STATES):
        t, x = rng.uniform(0.0, 1.0) * model.scene.duration, displacing * rng.normal(size=model.n)
        terms = model.blocks(t, displaced(q, x), np.zeros(model.n))
        samples.append(terms.jacobian)
        driven |= terms.nu != 0
    return np.array(samples), driven


def _bears_on(model: Model, entries: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Which rows (m,) have an entry (m, 12) in one of these columns (n,)."""
    return (entries & lies_in(model.entry_columns(), columns)).any(axis=1)


def _shared(model: Model, start: Start, entries: np.ndarray, held: Sequence[Held]) -> np.ndarray:
    """Columns (n,) among those held in which a row has an entry that is redundant at the start."""
    columns, of_held = np.zeros(model.n + 6, dtype=bool), np.isin(np.arange(model.n), columns_held(held))
    rows = np.flatnonzero(_bears_on(model, entries, of_held))
    if rows.size:
        blocks = model.blocks(0.0, start.q, start.v).jacobian
        change = LeastChange(sparse_jacobian(model, blocks), np.ones(model.n))
        redundant = rows[null_shares(change, rows) > REDUNDANT]
        columns[model.entry_columns()[redundant][entries[redundant]]] = True
    return columns[: model.n] & of_held


def _holding(
    model: Model,
    samples: np.ndarray,
    left: np.ndarray,
    driven: np.ndarray,
    moving: np.ndarray,
    can_rest: np.ndarray,
) -> Iterator[Held]:
    """Groups of rows that hold columns, each after those that let it bear on so few.

    From Jacobian blocks (STATES, m, 12), which entries (m, 12) are other than zero, which rows (m,) prescribe
    a motion, and which columns (n,) move and can rest.
    """
    column_of, free, found = model.entry_columns(), moving.copy(), True
    cannot_rest = lies_in(column_of, moving & ~can_rest)
    while found:
        bears = left & lies_in(column_of, free)
        few = ~driven & bears.any(axis=1) & (bears.sum(axis=1) <= MOST)
        groups: dict[tuple[int, ...], list[int]] = {}
        for row in np.flatnonzero(few & ~(bears & cannot_rest).any(axis=1)):
            groups.setdefault(tuple(np.sort(column_of[row, bears[row]]).tolist()), []).append(int(row))
        found = False
        for columns, rows in groups.items():
            if not free[list(columns)].all():
                continue  # another group has taken one of them in this round
            chosen = _perpendicular(
                np.array([samples[:, r][:, _places(column_of[r], columns)] for r in rows])
            )
            if len(chosen) == len(columns):
                found = True
                free[list(columns)] = False
                yield Held(tuple(rows[k] for k in chosen), columns)


def _places(column_of: np.ndarray, columns: Sequence[int]) -> list[int]:
    """Where in a row's block (12,) these columns are."""
    return [int(np.flatnonzero(column_of == column)[0]) for column in columns]


def _perpendicular(rows: np.ndarray) -> list[int]:
    """Which of the rows (r, STATES, c) have a constant length and are perpendicular to those before."""
    chosen: list[int] = []
    lengths = np.sqrt((rows**2).sum(axis=2))
    for k, (row, length) in enumerate(zip(rows, lengths, strict=True)):
        if length.min() > SMALL and np.ptp(length) <= ROUNDING * length.max():
            cosines = [(row * rows[j]).sum(axis=1) / (length * lengths[j]) for j in chosen]
            if (np.abs(cosines) < ROUNDING).all():
                chosen.append(k)
    return chosen


@inlined
def add_multipliers_of_held(plan, work):
    """The multipliers of rows that hold: they balance the forces on what is held, which has no q̈."""
    blocks, multipliers, force = work[JACOBIAN].reshape(-1), work[ROWS][MULTIPLIERS], work[COLUMNS][FORCE]
    row, start, entry, column = (
        part(plan, HELD_ROW), part(plan, HELD_START), part(plan, HELD_ENTRY), part(plan, HELD_COLUMN),
    )  # fmt: skip
    first, other = part(plan, OTHER_START), part(plan, HELD_OTHER)
    for k in range(row.shape[0]):
        value, square = 0.0, 0.0
        for p in range(start[k], start[k + 1]):
            balance, own = force[column[p]], blocks[entry[p]]
            for o in range(first[p], first[p + 1]):
                balance -= blocks[other[o]] * multipliers[other[o] // 12]
            value += own * balance
            square += own * own
        multipliers[row[k]] = value / square
