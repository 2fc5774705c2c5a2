"""Hubs: a body with many joints becomes several copies that rigid links hold together.

All rows on one body are connected in S = D Dᵀ, so that the factor of a body with h rows has about h³/6
updates. Copies of the body share its mass and forces equally and carry a part of its rows each; one row for
each velocity links a copy to the next one. Links have no 1/α, and all other rows the 1/α of the whole body,
so that elimination of the links gives S + I/α of the whole body: all solutions and iterates are unchanged.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mbref.linear_algebra.connected_parts import connected_parts

HUB = 30  # rows on a body from which it may be split
ROWS_ON_COPY = 12  # least number of rows on a copy: as many as its links have in space
FEW_COPIES = 5  # of a body where rows on smaller copies seem dependent: pivots fall with the mass of a copy


class Pattern(NamedTuple):
    """Numbers of D: rows (k,), columns (k,), places in the flat constraint Jacobian (k,); the column of the
    system of each column (c,), and the number of rows."""

    row: np.ndarray
    column: np.ndarray
    entry: np.ndarray
    own: np.ndarray
    rows: int


def least_updates(pattern: Pattern, of_body: int) -> int:
    """Return a lower bound of the updates of the factor: of the rows of the body with most rows."""
    _, rows = _rows_of_bodies(pattern, of_body)
    most = int(np.bincount(rows[:, 0]).max(initial=0))
    return most * (most - 1) * (most + 1) // 6


def _rows_of_bodies(pattern: Pattern, of_body: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the body of each number of D (k,), and all pairs (p, 2) of a body and a row on it."""
    body = pattern.own[pattern.column] // of_body
    return body, np.unique(np.stack([body, pattern.row], axis=1), axis=0)


def split_hubs(pattern: Pattern, of_body: int, few: bool = False) -> Pattern | None:
    """Return a pattern in which bodies with many rows are split, with ``of_body`` columns for a body, into
    many small copies or a ``few``; None if no body has many rows."""
    body, pairs = _rows_of_bodies(pattern, of_body)
    hubs = np.flatnonzero(np.bincount(pairs[:, 0]) >= HUB) if len(pairs) else pairs[:0, 0]
    if not hubs.size:
        return None
    label = _parts_without(hubs, pairs, pattern.rows)
    for hub in hubs.tolist():
        pattern = _split(pattern, np.flatnonzero(body == hub), label, few)
        body = np.append(body, np.full(pattern.row.size - body.size, -1))
    return pattern


def _parts_without(hubs: np.ndarray, pairs: np.ndarray, rows: int) -> np.ndarray:
    """Return the connected part (rows,) of the mechanism without hubs to which each row belongs."""
    others = pairs[~np.isin(pairs[:, 0], hubs)]
    size = rows + int(pairs[:, 0].max()) + 1
    return connected_parts(size, others[:, ::-1] + [0, rows])[:rows]


def _split(pattern: Pattern, on_hub: np.ndarray, label: np.ndarray, few: bool) -> Pattern:
    """Return a pattern with copies of one body, whose numbers in D are ``on_hub``: connected parts stay on
    one copy if they are small."""
    rows = np.unique(pattern.row[on_hub])
    rows = rows[np.lexsort((rows, label[rows]))]
    starts = np.flatnonzero(np.diff(label[rows], prepend=-1))
    begin = np.repeat(starts, np.diff(np.append(starts, rows.size)))
    position = np.arange(rows.size)
    on_copy = max(ROWS_ON_COPY, -(-rows.size // FEW_COPIES)) if few else ROWS_ON_COPY
    copy_of = np.where(position - begin < on_copy, begin, position) // on_copy
    copy_of = np.unique(copy_of, return_inverse=True)[1]
    count = int(copy_of.max()) + 1
    if count == 1:
        return pattern
    columns = np.unique(pattern.column[on_hub])
    size = pattern.own.size
    # the first copy has the columns of the body itself
    of_copy = np.concatenate(
        [columns[None], size + np.arange((count - 1) * columns.size).reshape(-1, columns.size)]
    )
    column, of_row = pattern.column.copy(), np.zeros(pattern.rows, dtype=np.int64)
    of_row[rows] = copy_of
    column[on_hub] = of_copy[of_row[pattern.row[on_hub]], np.searchsorted(columns, column[on_hub])]
    links = np.arange((count - 1) * columns.size)
    ends = np.stack([of_copy[:-1].ravel(), of_copy[1:].ravel()], axis=1)
    return Pattern(
        row=np.concatenate([pattern.row, np.repeat(pattern.rows + links, 2)]),
        column=np.concatenate([column, ends.ravel()]),
        entry=np.concatenate([pattern.entry, np.zeros(2 * links.size, dtype=np.int64)]),
        own=np.concatenate([pattern.own, np.tile(pattern.own[columns], count - 1)]),
        rows=pattern.rows + links.size,
    )
