"""Statically determined constraint rows: rows that keep velocities (columns of Φ_q) at zero, such as the rows
of a slider normal to its line.

A group consists of rows that are perpendicular to each other, have constant length, prescribe no motion, and
are as many as the columns in which they have entries. A group is a square system Φ_q v = 0 that is never
singular, so its only solution is v = 0. Such rows and columns are eliminated before the factorisation.
Further groups may then appear among the remaining rows. The multipliers of eliminated rows balance the forces
on their columns. Rows are examined at random states of all other coordinates; columns at rest need not be
varied.

Columns of redundant rows are not eliminated, because the distribution of reactions depends on all redundant
rows. Columns without mass are not eliminated either, because formulations must report them. If a driver
contradicts a group, no row is eliminated.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import hypot
from typing import NamedTuple

import numpy as np

from mbref.equations.initial_state import LARGE, Start
from mbref.equations.model import Model
from mbref.equations.random_states import RandomStates, random_states
from mbref.kernels.layout import StaticRows, Symbolic
from mbref.linear_algebra.minimum_norm import MinimumNorm
from mbref.linear_algebra.redundancy import dense_null_shares, null_shares
from mbref.linear_algebra.symbolic_factorisation import symbolic_factorisation, unsigned

STATES = 3  # number of random states at which rows are examined
MOST = 3  # largest number of columns that a group of rows determines
SMALL = 1e-9  # length of a row (1 or m) below which it may be rounding
ROUNDING = 1e-12  # relative rounding of constant lengths and of scalar products
# component of a row in the left null space above which the row is redundant; independent rows have 1e-12
REDUNDANT = 1e-10


class Held(NamedTuple):
    """Groups of rows and the columns that they keep at rest, equal in number."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]


def columns_held(held: Sequence[Held]) -> list[int]:
    """Return the columns of all groups."""
    return [column for each in held for column in each.columns]


def are_held(held: Sequence[Held], n: int) -> np.ndarray:
    """Return which of n columns belong to a group."""
    found = np.zeros(n, dtype=bool)
    found[columns_held(held)] = True
    return found


def lies_in(columns: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return which entries, in columns (m, 12), are in the wanted columns (n,); entries in columns of the
    fixed frame never are."""
    return np.append(wanted, np.zeros(6, dtype=bool))[columns]


def reduced_pattern(
    moving: np.ndarray, entries: np.ndarray, columns: np.ndarray, held: Sequence[Held]
) -> tuple[Symbolic, StaticRows]:
    """Return the factorisation over the active columns (n,) that no group keeps at rest, and the eliminated
    rows.

    ``entries`` (m, 12) are True for numbers of the Jacobian's blocks that can be nonzero, ``columns`` (m, 12)
    are their columns.
    """
    static = _static_rows(entries, columns, held)
    active = moving & ~are_held(held, moving.size)
    row, entry = np.nonzero(entries & lies_in(columns, active))
    return symbolic_factorisation(row, columns[row, entry], columns.shape[1] * row + entry, active), static


def _static_rows(entries: np.ndarray, columns: np.ndarray, held: Sequence[Held]) -> StaticRows:
    """Return the eliminated rows; other entries of their columns belong to rows whose multipliers are
    computed before."""
    row, entry = np.nonzero(entries)
    width = columns.shape[1]
    in_column: dict[int, list[int]] = {}
    for r, e in zip(row.tolist(), entry.tolist(), strict=True):
        in_column.setdefault(int(columns[r, e]), []).append(width * r + e)
    rows: list[int] = []
    starts, own, own_columns, firsts = [0], list[int](), list[int](), [0]
    others: list[int] = []
    for each in reversed(held):
        for r in each.rows:
            for column in each.columns:
                (place,) = (place for place in in_column[column] if place // width == r)
                own.append(place)
                own_columns.append(column)
                others += [place for place in in_column[column] if place // width not in each.rows]
                firsts.append(len(others))
            rows.append(r)
            starts.append(len(own))
    return StaticRows(*map(unsigned, (rows, starts, own, own_columns, firsts, others)))


class Tried(NamedTuple):
    """Rows that may keep these columns at rest, found in a round of random states, and the rows among them
    that keep columns at rest."""

    round: int
    rows: list[int]
    columns: tuple[int, ...]
    chosen: list[int]


class Asked:
    """Questions about a scene's numbers that determined the groups."""

    def __init__(self) -> None:
        self.read: list[RandomStates] = []  # states at which the Jacobian was evaluated
        self.tried: list[Tried] = []
        self.shared = np.zeros(0, dtype=int)  # rows that may be redundant


def held_by_rows(
    model: Model, start: Start, moving: np.ndarray, entries: np.ndarray, asked: Asked | None = None
) -> tuple[list[Held], np.ndarray]:
    """Return groups of statically determined rows, and the active velocities (n,) that they keep at zero, in
    the order found.

    Also return the Jacobian's ``entries`` (m, 12) that can be nonzero while those velocities are zero.
    """
    can_rest, asked = moving & (model.mass > 0), asked or Asked()
    held, left = _found(model, start.q, moving, entries, can_rest, asked)
    asked.shared = np.flatnonzero(_bears_on(model, entries, are_held(held, model.n)))
    blocks = model.terms(0.0, start.q, start.v).blocks
    redundant = asked.shared[are_redundant(model, blocks, asked.shared)]
    shared = _columns_of(model, entries, redundant) & are_held(held, model.n)
    if shared.any():
        held, left = _found(model, start.q, moving, entries, can_rest & ~shared, asked)
    return held, left


def at_rest(start: Start, columns: Sequence[int]) -> Start:
    """Return the start with velocities of round-off size set to zero in the columns of the groups."""
    if not columns:
        return start
    v = start.v.copy()
    v[columns] = 0.0
    return replace(start, v=v)


def _found(
    model: Model, q: np.ndarray, moving: np.ndarray, entries: np.ndarray, can_rest: np.ndarray, asked: Asked
) -> tuple[list[Held], np.ndarray]:
    """Return groups and entries as ``held_by_rows`` does, for the columns that can rest (n,)."""
    resting = can_rest
    while resting.any():
        states = random_states(2, STATES, model.n).of(moving & ~resting)
        asked.read.append(states)
        terms = model.terms(*states.about(q, model.scene.duration))
        samples, driven = terms.blocks, (terms.nu != 0).any(axis=0)
        left = entries & (samples != 0).any(axis=0)
        rows, held = _Rows(model, samples, left, driven), []
        for bearing, columns, chosen in _tries(rows, moving, can_rest):
            asked.tried.append(Tried(len(asked.read) - 1, bearing, columns, chosen))
            if len(chosen) == len(columns):
                held.append(Held(tuple(bearing[k] for k in chosen), columns))
        found = are_held(held, model.n)
        if not (resting & ~found).any():
            works_against = driven & left.any(axis=1) & ~_bears_on(model, left, moving & ~found)
            return ([], entries) if works_against.any() else (held, left)
        resting = resting & found
    return [], entries


def _bears_on(model: Model, entries: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return which rows (m,) have an entry (m, 12) in one of these columns (n,)."""
    return (entries & lies_in(model.entry_columns, columns)).any(axis=1)


def _columns_of(model: Model, entries: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return the columns (n,) in which these rows have an entry (m, 12)."""
    columns = np.zeros(model.n + 6, dtype=bool)
    columns[model.entry_columns[rows][entries[rows]]] = True
    return columns[: model.n]


def are_redundant(model: Model, blocks: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return which (…, r) of r rows are redundant in Jacobians with blocks (…, m, 12)."""
    if not rows.size:
        return np.zeros((*blocks.shape[:-2], 0), dtype=bool)
    return _null_shares(model, blocks, rows) > REDUNDANT


def _null_shares(model: Model, blocks: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return the components (…, r) of r rows in the left null space of Jacobians with blocks (…, m, 12)."""
    if model.m <= LARGE:
        return dense_null_shares(model.structure.dense(blocks), rows)
    every = blocks.reshape(-1, *blocks.shape[-2:])
    found = [null_shares(MinimumNorm(model.structure.sparse(one), np.ones(model.n)), rows) for one in every]
    return np.array(found).reshape(*blocks.shape[:-2], rows.size)


class _Rows:
    """Rows at random states: the remaining columns of each row, and its entries in these columns.

    Arguments are Jacobian blocks (STATES, m, 12), which entries (m, 12) can be nonzero, and which rows (m,)
    prescribe a motion and cannot belong to a group.
    """

    def __init__(self, model: Model, samples: np.ndarray, left: np.ndarray, driven: np.ndarray):
        self.numbers = samples.transpose(1, 2, 0).tolist()  # indices: row, entry, state
        self.entry: dict[int, dict[int, int]] = {}  # row → column → index of the entry
        row, entry = np.nonzero(left & ~driven[:, None] & (model.entry_columns < model.n))
        for r, c, e in zip(
            row.tolist(), model.entry_columns[row, entry].tolist(), entry.tolist(), strict=True
        ):
            self.entry.setdefault(r, {})[c] = e

    def grouped(self, free: Sequence[bool]) -> dict[tuple[int, ...], list[int]]:
        """Return the rows with at most MOST remaining columns (n,), grouped by these columns."""
        groups: dict[tuple[int, ...], list[int]] = {}
        for row, entry in self.entry.items():
            columns = tuple(sorted(column for column in entry if free[column]))
            if 0 < len(columns) <= MOST:
                groups.setdefault(columns, []).append(row)
        return groups

    def at(self, row: int, columns: Sequence[int]) -> list[list[float]]:
        """Return the numbers of a row in these columns, state by state."""
        numbers, entry = self.numbers[row], self.entry[row]
        return [list(state) for state in zip(*(numbers[entry[column]] for column in columns), strict=True)]


def _tries(
    rows: _Rows, moving: np.ndarray, can_rest: np.ndarray
) -> Iterator[tuple[list[int], tuple[int, ...], list[int]]]:
    """Yield candidates: columns that move and can rest (n,), the rows that may keep them at rest, and which
    rows do.

    A group is found if these rows are as many as the columns. The group comes after the groups that reduce
    its columns.
    """
    free, rests, found = moving.tolist(), can_rest.tolist(), True
    while found:
        found = False
        for columns, bearing in rows.grouped(free).items():
            if len(bearing) < len(columns) or not all(free[c] and rests[c] for c in columns):
                continue  # too few rows, a column without mass, or a column of another group
            chosen = _perpendicular([rows.at(row, columns) for row in bearing])
            if len(chosen) == len(columns):
                found = True
                for column in columns:
                    free[column] = False
            yield bearing, columns, chosen


def _perpendicular(rows: Sequence[Sequence[Sequence[float]]]) -> list[int]:
    """Return which of the rows have a constant length and are perpendicular to the previous rows, in every
    state."""
    chosen: list[int] = []
    directions: list[list[list[float]]] = []
    for k, row in enumerate(rows):
        lengths = [hypot(*state) for state in row]
        least, most = min(lengths), max(lengths)
        if not (least > SMALL and most - least <= ROUNDING * most):
            continue
        own = [[x / length for x in state] for state, length in zip(row, lengths, strict=True)]
        if all(_largest_cosine(own, other) < ROUNDING for other in directions):
            chosen.append(k)
            directions.append(own)
    return chosen


def _largest_cosine(one: Sequence[Sequence[float]], other: Sequence[Sequence[float]]) -> float:
    """Return the largest cosine between unit vectors, over all states."""
    return max(abs(sum(x * y for x, y in zip(a, b, strict=True))) for a, b in zip(one, other, strict=True))
