"""Reduction: the primitives, rows and columns of a scene that a run needs, computed once for scenes with
equal decisions.

The numbers of a scene decide which primitives, rows and columns a run leaves out. They matter only by whether
they are zero. A scene of equal structure is tested in the same way. If all results are equal, the reduction
is reused. Rows and columns that act on a block may differ, as roundings of zero do, if they reach equal rows
and columns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from mbref.equations.active_coordinates import (
    RandomStates,
    active_coordinates,
    active_entries,
    nonzero,
    primitives_with,
    reached,
    without_rounding,
)
from mbref.equations.coordinates import displace_all
from mbref.equations.initial_state import Start, consistent_start
from mbref.equations.model import Model, Terms
from mbref.equations.planes import MotionEquations, motion_equations
from mbref.equations.structure import Structure
from mbref.kernels.layout import Active, SparseFactor, Symbolic
from mbref.kernels.scene_layout import Primitives, SceneData
from mbref.linear_algebra.symbolic_factorisation import sparse_factor, symbolic_factorisation, unsigned

MOST_STRUCTURES, MOST_OF_ONE = 64, 8  # cache sizes: number of structures, and of reductions of one structure


class Answers(NamedTuple):
    """Properties of s scenes: the deciding properties (s, …), including the active entries of each round of
    states, (s, rounds, m, 12), and the acting rows and columns (s, rounds, m + n)."""

    decisive: np.ndarray
    entries: np.ndarray
    acting: np.ndarray


class StructuralDecisions:
    """Results of all tests that decide which primitives, rows and columns of a scene a run evaluates.

    The equations are tested at the random states ``read``.
    """

    def __init__(self, model: Model, start: Start, read: Sequence[RandomStates]):
        at_rest = RandomStates(np.zeros(1), *np.zeros((2, 1, model.n)))
        self._states = RandomStates(*map(np.concatenate, zip(at_rest, *read, strict=True)))
        self._rounds = len(read)
        self._moves, self._found = start.v != 0, self._of_one(model, start, self.terms(model, start))
        self._reached = self._reach(model, self._found.acting[0])

    def agrees(self, model: Model, start: Start, terms: Terms) -> bool:
        """Return whether a scene of equal structure has equal properties, computed from its ``terms``."""
        return bool(self._agree(model, self._of_one(model, start, terms))[0])

    def terms(self, model: Model, start: Start) -> Terms:
        """Return the terms (1, k, …) of a scene at ``states``."""
        part, places, velocities = self.states(start.q[None], start.v[None])
        return model.terms(part * model.scene.duration, places[0], velocities[0])[None]

    def which_agree(self, model: Model, q: np.ndarray, v: np.ndarray, terms: Terms) -> np.ndarray:
        """Return which of s scenes of equal structure have equal properties.

        Arguments are their starts q (s, 7 nb) and v (s, 6 nb), and their terms (s, k, …) at ``states``.
        """
        return self._agree(model, self._answers(model, q, v, terms))

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
        return self._answers(model, start.q[None], start.v[None], terms)

    def _answers(self, model: Model, q: np.ndarray, v: np.ndarray, terms: Terms) -> Answers:
        """Return the properties of each of s scenes."""
        shape = terms.phi.shape[:2]
        found = np.concatenate([one.reshape(*shape, -1) for one in nonzero(model, terms)], axis=2)
        found = found[:, :1] | _of_rounds(found[:, 1:], self._rounds)
        entries, acting = found[..., : model.entry_columns.size], found[..., model.entry_columns.size :]
        decisive = np.concatenate([v != 0, q != 0, entries.reshape(len(q), -1)], axis=1)
        return Answers(decisive, entries.reshape(*found.shape[:2], *model.entry_columns.shape), acting)


def _of_rounds(found: np.ndarray, rounds: int) -> np.ndarray:
    """Return whether a property holds at one of the states (s, k, …) of each round; all rounds have equally
    many states."""
    scenes, states = found.shape[:2]
    each: np.ndarray = found.reshape(scenes, rounds, states // max(rounds, 1), *found.shape[2:])
    return np.any(each, axis=2)


@dataclass(frozen=True, eq=False)
class Reduction:
    """Numbers of the primitives with a nonzero entry, the active columns, and the factor of their rows.

    ``parts`` caches the reductions of steps that need a part of the rows and columns.
    """

    primitives: np.ndarray
    active: Active
    symbolic: Symbolic
    decisions: StructuralDecisions
    motion: MotionEquations
    parts: dict[tuple[bytes, ...], Reduction]

    def of_steps(self, model: Model, start: Start) -> Reduction:
        """Return the reduction of a scene with these decisions that determines its motion."""
        return self._part(model, start, motion_equations(model, start, *self.motion))

    def without_copies(self, model: Model, start: Start) -> Reduction:
        """Return the reduction whose factor has no copies of bodies (``linear_algebra.hubs``)."""
        return self._part(model, start, self.motion, of_body=0)

    def with_few_copies(self, model: Model, start: Start) -> Reduction:
        """Return the reduction whose factor has few copies of a body, so that they have more mass."""
        return self._part(model, start, self.motion, few=True)

    def _part(
        self, model: Model, start: Start, motion: MotionEquations | None, of_body: int = 6, few: bool = False
    ) -> Reduction:
        if motion is None:
            return self
        key = (*(array.tobytes() for array in motion), bytes((of_body, few)))
        if key not in self.parts:
            self.parts[key] = _of_stage(model, start, motion, self.decisions, of_body, few)
        return self.parts[key]

    def factor(self) -> SparseFactor:
        """Memory of the factor."""
        return sparse_factor(self.symbolic)

    def scene(self, data: SceneData, axis: int = 0) -> SceneData:
        """Return the data of a scene without the primitives that have no nonzero entry; ``axis`` counts
        primitives."""
        kept = data.primitives
        if self.primitives.size < kept.kind.shape[axis]:
            kept = Primitives(*(column.take(self.primitives, axis=axis) for column in kept))
        return data._replace(primitives=kept)


def reduced_data(model: Model, reduction: Reduction) -> SceneData:
    """Return the data of a model's scene without the primitives that have no nonzero entry."""
    return reduction.scene(model.data)


_known: dict[Structure, list[Reduction]] = {}


def reduced_start(model: Model) -> tuple[Start, Reduction, np.ndarray]:
    """Return the consistent start of a scene without roundings of zero, its reduction, and the blocks (m, 12)
    of Φ_q there."""
    return model.once(_reduced_start)


def _reduced_start(model: Model) -> tuple[Start, Reduction, np.ndarray]:
    start = consistent_start(model)
    q, v = without_rounding(start.q[None], start.v[None], start.given[None], np.array([model.length]))
    start = replace(start, q=q[0], v=v[0])
    return start, *reduction_of(model, start)


def reduction_of(model: Model, start: Start) -> tuple[Reduction, np.ndarray]:
    """Return the reduction of a scene at its start, and the blocks (m, 12) of Φ_q there.

    A stored reduction of the structure is reused if its decisions agree with the scene.
    """
    known = _known.get(model.structure, [])
    for reduction in known:
        terms = reduction.decisions.terms(model, start)
        if reduction.decisions.agrees(model, start, terms):
            return reduction, terms.blocks[0, 0]
    found = _found(model, start)
    if model.structure not in _known and len(_known) >= MOST_STRUCTURES:
        _known.pop(next(iter(_known)), None)
    _known[model.structure] = [found, *known][:MOST_OF_ONE]
    return found, model.terms(0.0, start.q, start.v).blocks


def _found(model: Model, start: Start) -> Reduction:
    read: list[RandomStates] = []
    motion = MotionEquations(*active_entries(model, start.q, start.v, read))
    return _of_stage(model, start, motion, StructuralDecisions(model, start, read))


def _of_stage(
    model: Model,
    start: Start,
    motion: MotionEquations,
    decisions: StructuralDecisions,
    of_body: int = 6,
    few: bool = False,
) -> Reduction:
    """Return the reduction to these columns and entries; bodies may be split if they have ``of_body``
    columns each."""
    row, entry = np.nonzero(motion.entries)
    columns = model.entry_columns
    places = columns.shape[1] * row + entry
    symbolic = symbolic_factorisation(row, columns[row, entry], places, motion.moving, of_body, few)
    velocities = np.unique(symbolic.column).astype(np.int64)
    return Reduction(
        primitives=primitives_with(model, np.flatnonzero(motion.entries.any(axis=1))),
        active=Active(unsigned(active_coordinates(start.q, velocities)), unsigned(velocities)),
        symbolic=symbolic,
        decisions=decisions,
        motion=motion,
        parts={},
    )
