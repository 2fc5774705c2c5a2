"""The plan of a sparse factorisation: where every number of S + I/α and of its Cholesky factor stands.

Made once per scene.  The order of elimination and the fill are SuperLU's (multiple minimum degree on the
symmetric pattern); what is added here are the lists of products that the kernels of ``factor`` go through.
Rows are counted in the order of elimination, columns only where something moves that no row of its own holds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_array, csr_array, eye_array
from scipy.sparse.linalg import splu

# parts of the index vector, each from plan[k] to plan[k + 1]
(
    ROW,  # (r,) the model's row of each row here
    COLUMN,  # (c,) the velocity vector's column of each column here
    D_START,  # (r + 1,) where each row of D begins
    D_ENTRY,  # (d,) position of each number of D in the Jacobian's blocks
    D_COLUMN,  # (d,) its column
    S_START,  # (s + 1,) where the products of each number of S begin
    S_TARGET,  # (s,) position of that number in L
    S_LEFT,  # (p,) the products: two numbers of D
    S_RIGHT,
    L_START,  # (r + 1,) where each column of L begins, its diagonal first
    L_ROW,  # (l,) row of each number of L
    UPDATE,  # positions in L that the elimination of each column changes, column after column
    HELD_ROW,  # (h,) rows that hold columns at rest, those found last first
    HELD_START,  # (h + 1,) where the entries of each begin
    HELD_ENTRY,  # (e,) their positions in the blocks
    HELD_COLUMN,  # (e,) and their columns
    OTHER_START,  # (e + 1,) where the entries of other rows in that column begin
    HELD_OTHER,  # positions of these in the blocks
) = range(18)
PARTS = 18


class Held(NamedTuple):
    """Rows and the columns that they hold at rest, as many."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]


def columns_held(held: Sequence[Held]) -> list[int]:
    """The columns of all groups."""
    return [column for each in held for column in each.columns]


def lies_in(columns: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Which entries, in these columns (m, 12), are in those wanted (n,); the fixed frame's are not."""
    return np.append(wanted, np.zeros(6, dtype=bool))[columns]


@dataclass(frozen=True)
class Plan:
    """Indices for the kernels (uint32: signed ones cost a test each), and how much memory they need."""

    indices: np.ndarray  # PARTS + 1 offsets, then the parts
    memory: int

    def part(self, k: int) -> np.ndarray:
        """One of the parts."""
        return self.indices[self.indices[k] : self.indices[k + 1]]


def plan_for(moving: np.ndarray, entries: np.ndarray, columns: np.ndarray, held: Sequence[Held] = ()) -> Plan:
    """The plan of D's pattern: velocities that move (n,), ``entries`` (m, 12), and the column of each.

    Of them all that rows hold at rest stays out, and rows that are then empty.
    """
    of_held = _held_parts(entries, columns, held)
    moving = moving & ~np.isin(np.arange(moving.size), columns_held(held))
    entries = entries & lies_in(columns, moving)
    kept = np.flatnonzero(entries.any(axis=1))
    row, entry = np.nonzero(entries[kept])
    d = csr_array((np.ones(row.size), (row, columns[kept[row], entry])), shape=(kept.size, moving.size))
    order, l_start, l_row = _factor_pattern(d)
    place = np.empty_like(order)
    place[order] = np.arange(order.size)
    row, entry, original = _sorted_by(place[row], entry, kept[row])
    d_start = np.searchsorted(row, np.arange(order.size + 1))
    d_column = columns[original, entry]
    l_key = np.repeat(np.arange(order.size), np.diff(l_start)) * order.size + l_row
    target, left, right = _products(row, d_column, l_key, order.size)
    s_target, s_start = np.unique(target, return_index=True)
    column = np.flatnonzero(moving)
    parts = [
        kept[order], column, d_start, 12 * original + entry, np.searchsorted(column, d_column),
        np.append(s_start, target.size), s_target, left, right, l_start, l_row,
        _updates(l_start, l_row, l_key, order.size), *of_held,
    ]  # fmt: skip
    offsets = np.cumsum([PARTS + 1, *(part.size for part in parts)])
    indices = np.concatenate([offsets, *parts])
    if indices.max(initial=0) > np.iinfo(np.uint32).max:
        raise OverflowError("the scene is too large for 32-bit indices")
    memory = row.size + l_row.size + 5 * order.size + 2 * column.size
    return Plan(indices.astype(np.uint32), memory)


def _held_parts(entries: np.ndarray, columns: np.ndarray, held: Sequence[Held]) -> list[np.ndarray]:
    """The parts of the rows that hold: a column's other entries are of rows whose multipliers are known."""
    row, entry = np.nonzero(entries)
    in_column: dict[int, list[int]] = {}
    for r, e in zip(row, entry, strict=True):
        in_column.setdefault(int(columns[r, e]), []).append(12 * int(r) + int(e))
    rows, starts, own, own_columns, firsts, others = [], [0], [], [], [0], []
    for each in reversed(held):
        for r in each.rows:
            for column in each.columns:
                (place,) = (place for place in in_column[column] if place // 12 == r)
                own.append(place)
                own_columns.append(column)
                others += [place for place in in_column[column] if place // 12 not in each.rows]
                firsts.append(len(others))
            rows.append(r)
            starts.append(len(own))
    return [np.array(part, dtype=int) for part in (rows, starts, own, own_columns, firsts, others)]


def _factor_pattern(d: csr_array) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Order of elimination of S = D Dᵀ, and where the columns of its factor begin and have their rows.

    SuperLU factors a matrix of that pattern with a dominant diagonal, so that it keeps the order.
    """
    size = d.shape[0]
    if not size:
        return np.zeros(0, dtype=int), np.zeros(1, dtype=int), np.zeros(0, dtype=int)
    sample = csr_array(
        (np.random.default_rng(1).uniform(0.5, 1.0, d.nnz), d.indices, d.indptr), shape=d.shape
    )
    s = csc_array(sample @ sample.T)
    s = s + eye_array(size, format="csc") * (10.0 * abs(s).sum(axis=0).max())
    factored = splu(
        s, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True, "Equil": False}
    )
    if not np.array_equal(factored.perm_c, factored.perm_r):
        raise AssertionError("the order of elimination is not symmetric")
    lower = csc_array(factored.L)
    lower.sort_indices()
    return np.argsort(factored.perm_c), lower.indptr.astype(np.int64), lower.indices.astype(np.int64)


def _sorted_by(key: np.ndarray, *others: np.ndarray) -> list[np.ndarray]:
    order = np.argsort(key, kind="stable")
    return [key[order], *(other[order] for other in others)]


def _products(
    row: np.ndarray, column: np.ndarray, l_key: np.ndarray, size: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs of numbers of D in one column, and the position in L of the number of S they add to, sorted."""
    by_column, pairs = np.argsort(column, kind="stable"), []
    for group in np.split(by_column, np.flatnonzero(np.diff(column[by_column])) + 1):
        first, second = np.tril_indices(group.size)
        pairs.append((group[first], group[second]))
    left, right = (np.concatenate(side) for side in zip(*pairs, strict=True))
    target = np.searchsorted(l_key, row[right] * size + row[left])
    return tuple(_sorted_by(target, left, right))


def _updates(l_start: np.ndarray, l_row: np.ndarray, l_key: np.ndarray, size: int) -> np.ndarray:
    """For every column k, the positions of (i, j) for the rows j ≤ i below its diagonal, j outermost."""
    keys = [np.zeros(0, dtype=np.int64)]
    for k in range(size):
        below = l_row[l_start[k] + 1 : l_start[k + 1]]
        first, second = np.triu_indices(below.size)
        keys.append(below[first] * size + below[second])
    return np.searchsorted(l_key, np.concatenate(keys))
