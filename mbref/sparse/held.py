"""What constraint rows hold at rest although forces act on it: a slider's sides, a crank's other axes.

Where as many rows as columns, each row perpendicular to the others, prescribe no motion and bear on nothing
else, the velocities in those columns are zero.  Rows and columns are left out of the factorisation, after
which other rows may bear on as few; the multipliers follow from the forces on the columns.  That the rows
are so is asked at random states of everything else: what is held need not be moved, because it rests.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from mbref.compiled import inlined
from mbref.initial import Start
from mbref.model import Model, displaced
from mbref.sparse.factor import part
from mbref.sparse.plan import HELD_COLUMN, HELD_ENTRY, HELD_OTHER, HELD_ROW, HELD_START, OTHER_START, Held
from mbref.tables import COLUMNS, FORCE, JACOBIAN, MULTIPLIERS, ROWS

STATES = 3  # random states asked
MOST = 3  # columns that rows together hold
SMALL, ROUNDING = 1e-6, 1e-12  # a row so short may vanish; what is left of zero and of constant lengths


def held_by_rows(
    model: Model, q: np.ndarray, moving: np.ndarray, entries: np.ndarray
) -> tuple[list[Held], np.ndarray]:
    """What rows hold of the velocities that move (n,) from the coordinates q (7 nb,), in the order found.

    And which of the Jacobian's ``entries`` (m, 12) are then left other than zero.
    """
    resting = moving
    while True:
        samples, driven = _samples(model, q, moving & ~resting)
        held = list(_holding(model, samples, driven, moving))
        columns = np.isin(np.arange(model.n), [column for each in held for column in each.columns])
        if not (resting & ~columns).any():
            return held, entries & (samples != 0).any(axis=0)
        resting = resting & columns


def at_rest(start: Start, held: Sequence[Held]) -> Start:
    """The start with zero for the roundings of zero in the velocities held."""
    v = start.v.copy()
    for each in held:
        v[list(each.columns)] = 0.0
    return replace(start, v=v)


def _samples(model: Model, q: np.ndarray, displacing: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Jacobian blocks (STATES, m, 12) at random states, and which rows (m,) prescribe a motion."""
    rng, samples, driven = np.random.default_rng(2), [], np.zeros(model.m, dtype=bool)
    for _ in range(STATES):
        t, x = rng.uniform(0.0, 1.0) * model.scene.duration, displacing * rng.normal(size=model.n)
        terms = model.blocks(t, displaced(q, x), np.zeros(model.n))
        samples.append(terms.jacobian)
        driven |= terms.nu != 0
    return np.array(samples), driven


def _holding(model: Model, samples: np.ndarray, driven: np.ndarray, moving: np.ndarray) -> Iterator[Held]:
    """Groups of rows that hold columns, each after those that let it bear on so few."""
    column, free = model.entry_columns(), np.append(moving, np.zeros(6, dtype=bool))
    entries = (samples != 0).any(axis=0)
    while True:
        left = entries & free[column]
        few = np.flatnonzero(~driven & left.any(axis=1) & (left.sum(axis=1) <= MOST))
        groups: dict[tuple[int, ...], list[int]] = {}
        for row in few:
            groups.setdefault(tuple(np.sort(column[row, left[row]]).tolist()), []).append(int(row))
        found = False
        for columns, rows in groups.items():
            chosen = _perpendicular(samples, column, rows, columns)
            if len(chosen) == len(columns) and free[list(columns)].all():
                free[list(columns)], found = False, True
                yield Held(tuple(chosen), columns)
        if not found:
            return


def _perpendicular(
    samples: np.ndarray, column: np.ndarray, rows: Sequence[int], columns: Sequence[int]
) -> list[int]:
    """Rows of constant length that are perpendicular to those before, at most as many as columns."""
    chosen: list[int] = []
    parts = {row: np.array([samples[:, row, column[row] == c].sum(axis=1) for c in columns]) for row in rows}
    for row, values in parts.items():
        length = np.sqrt((values**2).sum(axis=0))
        constant = np.ptp(length) <= ROUNDING * length.max() and length.min() > SMALL
        apart = all(np.abs((values * parts[other]).sum(axis=0)).max() < ROUNDING for other in chosen)
        if constant and apart and len(chosen) < len(columns):
            chosen.append(row)
    return chosen


@inlined
def bear(plan, work):
    """The multipliers of the rows that hold: they balance the forces on what is held, which has no q̈."""
    blocks, multipliers, force = work[JACOBIAN].reshape(-1), work[ROWS][MULTIPLIERS], work[COLUMNS][FORCE]
    row, start, entry, column = (
        part(plan, HELD_ROW), part(plan, HELD_START), part(plan, HELD_ENTRY), part(plan, HELD_COLUMN),
    )  # fmt: skip
    first, other = part(plan, OTHER_START), part(plan, HELD_OTHER)
    for k in range(row.shape[0]):
        value, square = 0.0, 0.0
        for p in range(start[k], start[k + 1]):
            left, own = force[column[p]], blocks[entry[p]]
            for o in range(first[p], first[p + 1]):
                left -= blocks[other[o]] * multipliers[other[o] // 12]
            value += own * left
            square += own * own
        multipliers[row[k]] = value / square
