"""Structural decisions: the properties of a scene's numbers on which the choice of its primitives, rows and
columns depends.

Numbers matter only by whether they are zero, constant, perpendicular or redundant. Scenes of one structure
with equal properties lead to equal choices. Rows and columns that act on a block may differ, as roundings of
zero do, if they reach equal rows and columns.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mbref.equations.active_coordinates import nonzero, reached
from mbref.equations.coordinates import displace_all
from mbref.equations.initial_state import Start
from mbref.equations.model import Model, Terms
from mbref.equations.random_states import RandomStates
from mbref.equations.static_constraints import MOST, ROUNDING, SMALL, Asked, are_redundant


class Answers(NamedTuple):
    """Properties of s scenes: the deciding properties (s, …), including the active entries of each round of
    states, (s, rounds, m, 12), and the acting rows and columns (s, rounds, m + n)."""

    decisive: np.ndarray
    entries: np.ndarray
    acting: np.ndarray


class StructuralDecisions:
    """Results of all tests that decide which primitives, rows and columns of a scene a run evaluates.

    The active ``entries`` (m, 12) of the Jacobian are determined at the random states ``read``; the remaining
    tests find statically determined rows.
    """

    def __init__(
        self, model: Model, start: Start, read: Sequence[RandomStates], entries: np.ndarray, asked: Asked
    ):
        at_rest = RandomStates(np.zeros(1), *np.zeros((2, 1, model.n)))
        joined = zip(at_rest, *read, *asked.read, strict=True)
        self._states = RandomStates(*map(np.concatenate, joined))
        self._rounds, self._split = (len(read), len(asked.read)), 1 + sum(len(s.part) for s in read)
        self._entries = entries
        self._trials, self._shared = Trials(model, asked), asked.shared
        self._moves, self._found = start.v != 0, self._of_one(model, start, self.terms(model, start))
        self._reached = self._reach(model, self._found.acting[0])

    def agrees(self, model: Model, start: Start, terms: Terms) -> bool:
        """Return whether a scene of equal structure has equal properties, computed from its ``terms``."""
        return bool(self._agree(model, self._of_one(model, start, terms))[0])

    def terms(self, model: Model, start: Start) -> Terms:
        """Return the terms (1, k, …) of a scene at ``states``."""
        part, places, velocities = self.states(start.q[None], start.v[None])
        return model.terms(part * model.scene.duration, places[0], velocities[0])[None]

    def which_agree(
        self, model: Model, q: np.ndarray, v: np.ndarray, mass: np.ndarray, terms: Terms
    ) -> np.ndarray:
        """Return which of s scenes of equal structure have equal properties.

        Arguments are their starts q (s, 7 nb) and v (s, 6 nb), masses (s, 6 nb) and terms (s, k, …) at
        ``states``.
        """
        return self._agree(model, self._answers(model, q, v, mass, terms))

    def states(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return k states about the starts q (s, 7 nb), v (s, 6 nb) of s scenes, the start first.

        A state has a time as a fraction of the duration (k,), coordinates (s, k, 7 nb) and velocities (s, k,
        6 nb).
        """
        part, displacement, velocity = self._states
        places = np.repeat(q, len(part), axis=0)
        displace_all(places, np.concatenate([displacement] * len(q)), np.zeros(q.shape[1]))
        places = places.reshape(len(q), len(part), q.shape[1])
        velocities = np.stack([velocity] * len(q))
        places[:, 0], velocities[:, 0] = q, v
        return part, places, velocities

    def _agree(self, model: Model, answers: Answers) -> np.ndarray:
        """Return which of s scenes give equal answers; rows and columns may differ if they reach equal rows
        and columns. No scene with loads over time agrees, because loads may be switched off at all states
        that are read."""
        if any(load.over_time for load in model.scene.load):
            return np.zeros(len(answers.decisive), dtype=bool)
        same: np.ndarray = (answers.decisive == self._found.decisive).all(axis=1)
        differ = (answers.acting != self._found.acting).any(axis=(1, 2))
        for k in np.flatnonzero(same & differ):
            same[k] = self._reach(model, answers.acting[k]) == self._reached
        return same

    def _reach(self, model: Model, acting: np.ndarray) -> list[bytes]:
        """Return the columns and rows that are reached in each round, from the acting rows and columns
        (rounds, m + n)."""
        entries = np.logical_or.accumulate(self._found.entries[0], axis=0)
        rounds = zip(entries, acting, strict=True)
        found = (reached(model, e, a[: model.m], a[model.m :] | self._moves) for e, a in rounds)
        return [part.tobytes() for parts in found for part in parts]

    def _of_one(self, model: Model, start: Start, terms: Terms) -> Answers:
        return self._answers(model, start.q[None], start.v[None], model.mass[None], terms)

    def _answers(self, model: Model, q: np.ndarray, v: np.ndarray, mass: np.ndarray, terms: Terms) -> Answers:
        """Return the properties of each of s scenes."""
        shape = terms.phi.shape[:2]
        found = np.concatenate([one.reshape(*shape, -1) for one in nonzero(model, terms)], axis=2)
        found = found[:, :1] | _of_rounds(found[:, 1 : self._split], self._rounds[0])
        entries, acting = found[..., : model.entry_columns.size], found[..., model.entry_columns.size :]
        redundant = are_redundant(model, terms.blocks[:, 0], self._shared)
        decisive = [v != 0, q != 0, mass > 0, entries, *self._of_held(terms), redundant]
        joined = np.concatenate([answer.reshape(len(q), -1) for answer in decisive], axis=1)
        return Answers(joined, entries.reshape(*found.shape[:2], *model.entry_columns.shape), acting)

    def _of_held(self, terms: Terms) -> list[np.ndarray]:
        """Return which active entries and rows are nonzero in each round, and which rows could keep columns
        at rest."""
        samples, rounds = terms.blocks[:, self._split :], self._rounds[1]
        left = _of_rounds((samples != 0) & self._entries, rounds)
        return [left, _of_rounds(terms.nu[:, self._split :] != 0, rounds), *self._trials.answers(samples)]


def _of_rounds(found: np.ndarray, rounds: int) -> np.ndarray:
    """Return whether a property holds at one of the states (s, k, …) of each round; all rounds have equally
    many states."""
    scenes, states = found.shape[:2]
    each: np.ndarray = found.reshape(scenes, rounds, states // max(rounds, 1), *found.shape[2:])
    return np.any(each, axis=2)


class Trials:
    """Results of tests on rows: which columns each row determines, and which pairs of rows were compared."""

    def __init__(self, model: Model, asked: Asked):
        tried = [(t, row) for t in asked.tried for row in t.rows]
        states = len(asked.read[0].part) if asked.read else 0
        self._sample = np.array([t.round for t, _ in tried], dtype=int)[:, None] * states + np.arange(states)
        self._row = np.array([row for _, row in tried], dtype=int)
        entries = [_entries(model.entry_columns[row].tolist(), t.columns) for t, row in tried]
        self._entry = np.array(entries, dtype=int).reshape(-1, MOST)
        self._has_entry = self._entry >= 0
        pairs, first = [], 0
        for t in asked.tried:
            pairs += [(first + k, first + j) for k in range(len(t.rows)) for j in t.chosen if j < k]
            first += len(t.rows)
        self._one, self._other = np.array(pairs, dtype=int).reshape(-1, 2).T

    def answers(self, samples: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return which rows have a constant length, and which pairs are perpendicular, in blocks (s, k, m,
        12)."""
        if not self._row.size:
            return (np.zeros((len(samples), 0), dtype=bool),) * 2
        places = self._sample[:, :, None], self._row[:, None, None], self._entry[:, None, :]
        numbers = samples[:, *places] * self._has_entry[:, None, :]
        lengths = np.sqrt((numbers * numbers).sum(axis=-1))
        least, most = lengths.min(axis=2, initial=np.inf), lengths.max(axis=2, initial=0.0)
        are_constant = (least > SMALL) & (most - least <= ROUNDING * most)
        if not self._one.size:
            return are_constant, np.zeros((len(samples), 0), dtype=bool)
        units = numbers / np.where(lengths > 0.0, lengths, 1.0)[..., None]
        products = units[:, self._one] * units[:, self._other]
        cosines = np.abs(products.sum(axis=-1)).max(axis=2, initial=0.0)
        return are_constant, cosines < ROUNDING


def _entries(columns_of_row: list[int], columns: Sequence[int]) -> list[int]:
    """Return the entries of a row in these columns, padded with -1."""
    return [columns_of_row.index(column) for column in columns] + [-1] * (MOST - len(columns))
