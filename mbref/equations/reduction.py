"""Reduction: the primitives, rows and columns of a scene that a run needs, computed once for scenes with
equal decisions.

The numbers of a scene decide which primitives, rows and columns a run leaves out. A scene of equal structure
is tested in the same way (``structural_decisions``). If all results are equal, the reduction is reused.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mbref.equations.active_coordinates import active_coordinates, active_entries, primitives_of
from mbref.equations.initial_state import Start
from mbref.equations.model import Model
from mbref.equations.random_states import RandomStates
from mbref.equations.static_constraints import Asked, columns_held, held_by_rows, reduced_pattern
from mbref.equations.structural_decisions import StructuralDecisions
from mbref.equations.structure import Structure
from mbref.kernels.layout import Active, SparseFactor, StaticRows, Symbolic
from mbref.kernels.scene_layout import Primitives, SceneData
from mbref.linear_algebra.symbolic_factorisation import sparse_factor, unsigned

MOST_STRUCTURES, MOST_OF_ONE = 64, 8  # cache sizes: number of structures, and of reductions of one structure

_known: dict[Structure, list[Reduction]] = {}


@dataclass(frozen=True, eq=False)
class Reduction:
    """Numbers of the primitives with a nonzero entry, columns that rows keep at rest, all other columns, and
    their factor.

    ``resting`` are the primitives whose rows only keep columns at rest.
    """

    primitives: np.ndarray
    resting: np.ndarray
    held: list[int]
    active: Active
    symbolic: Symbolic
    static: StaticRows
    decisions: StructuralDecisions

    def factor(self) -> SparseFactor:
        """Memory of the factor."""
        return sparse_factor(self.symbolic, self.static)

    def scene(self, data: SceneData, all_move: bool, axis: int = 0) -> SceneData:
        """Return the data of a scene without the primitives that have no nonzero entry.

        ``axis`` is the axis that counts primitives. With ``all_move`` all remaining primitives are evaluated.
        """
        moving, still = self._all_moving if all_move else self._moving
        if axis:
            scenes = data.row_bodies.shape[:axis]
            moving, still = (np.broadcast_to(one, (*scenes, one.size)) for one in (moving, still))
        kept = data.primitives
        if self.primitives.size < kept.kind.shape[axis]:
            kept = Primitives(*(column.take(self.primitives, axis=axis) for column in kept))
        return data._replace(primitives=kept, moving=moving, resting=still)

    @cached_property
    def _moving(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the indices, among the remaining primitives, of primitives that move and of primitives at
        rest."""
        return np.flatnonzero(~self.resting), np.flatnonzero(self.resting)

    @cached_property
    def _all_moving(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the indices as in ``_moving`` if all remaining primitives move."""
        return np.arange(self.resting.size), np.zeros(0, dtype=np.int64)


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
    moving, entries = active_entries(model, start.q, start.v, read)
    asked = Asked()
    held, left = held_by_rows(model, start, moving, entries, asked)
    symbolic, static = reduced_pattern(moving, left, model.entry_columns, held)
    velocities = symbolic.column.astype(np.int64)
    primitives = primitives_of(model, np.flatnonzero(left.any(axis=1)))
    return Reduction(
        primitives=primitives,
        resting=~np.isin(primitives, primitives_of(model, symbolic.row)),
        held=columns_held(held),
        active=Active(unsigned(active_coordinates(start.q, velocities)), symbolic.column),
        symbolic=symbolic,
        static=static,
        decisions=StructuralDecisions(model, start, read, entries, asked),
    )
