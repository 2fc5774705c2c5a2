"""Evidence: the answers of a scene's numbers on which the choice of its primitives, rows and columns rests.

Numbers decide only by whether they are zero, constant, perpendicular or redundant.  Scenes of one structure
that give the same answers lead to the same choice.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mbref.equations.active_coordinates import nonzero
from mbref.equations.initial_state import Start
from mbref.equations.model import Model, Terms, all_displaced
from mbref.equations.random_states import RandomStates
from mbref.equations.static_constraints import MOST, ROUNDING, SMALL, Asked, are_redundant


class Evidence:
    """The questions asked of a scene at its start, and its answers.

    The choice of active ``entries`` (m, 12) has read the terms at each of ``read``, that of statically
    determined rows has asked the rest.
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
        self._found = self._answers(model, start)

    def agrees(self, model: Model, start: Start) -> bool:
        """Whether a scene of the same structure gives the same answers."""
        return self._answers(model, start) == self._found

    def _answers(self, model: Model, start: Start) -> bytes:
        terms = self._terms(model, start)
        answers = [start.v != 0, start.q != 0, model.mass > 0]
        answers += [*self._of_active(model, terms), *self._of_held(terms)]
        answers.append(are_redundant(model, terms.jacobian[0], self._shared))
        return b"".join(answer.tobytes() for answer in answers)

    def _terms(self, model: Model, start: Start) -> Terms:
        """The terms at the start, then at all states that were read."""
        part, displacement, velocity = self._states
        q, v = all_displaced(start.q, displacement), velocity.copy()
        q[0], v[0] = start.q, start.v
        return model.along(part * model.scene.duration, q, v)

    def _of_active(self, model: Model, terms: Terms) -> list[np.ndarray]:
        """Which entries, rows and columns are other than zero at the start or in each round of states."""
        return [
            found[0] | _of_rounds(found[1 : self._split], self._rounds[0]) for found in nonzero(model, terms)
        ]

    def _of_held(self, terms: Terms) -> list[np.ndarray]:
        """Which active entries and rows are other than zero in each round, and which rows could hold."""
        samples, rounds = terms.jacobian[self._split :], self._rounds[1]
        left = _of_rounds((samples != 0) & self._entries, rounds)
        return [left, _of_rounds(terms.nu[self._split :] != 0, rounds), *self._trials.answers(samples)]


def _of_rounds(found: np.ndarray, rounds: int) -> np.ndarray:
    """Whether something is so at one of the states of a round, which have as many each."""
    return found.reshape(rounds, len(found) // max(rounds, 1), *found.shape[1:]).any(axis=1)


class Trials:
    """Rows that were tried whether they hold columns, and the pairs of them that were compared."""

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
        """Which rows have a constant length, and which pairs are perpendicular, in blocks (k, m, 12)."""
        places = self._sample[:, :, None], self._row[:, None, None], self._entry[:, None, :]
        numbers = samples[places] * self._has_entry[:, None, :]
        lengths = np.sqrt((numbers * numbers).sum(axis=-1))
        least, most = lengths.min(axis=1, initial=np.inf), lengths.max(axis=1, initial=0.0)
        units = numbers / np.where(lengths > 0.0, lengths, 1.0)[..., None]
        cosines = np.abs((units[self._one] * units[self._other]).sum(axis=-1)).max(axis=1, initial=0.0)
        return (least > SMALL) & (most - least <= ROUNDING * most), cosines < ROUNDING


def _entries(columns_of_row: list[int], columns: Sequence[int]) -> list[int]:
    """The entries of a row in these columns, filled up with -1."""
    return [columns_of_row.index(column) for column in columns] + [-1] * (MOST - len(columns))
