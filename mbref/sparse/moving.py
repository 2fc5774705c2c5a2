"""What of a scene can ever move: the rest needs no equation.

Rows and columns of Φ_q that hang together by non-zero entries form a block.  Where no force, no γ, Φ or ν and
no initial velocity acts on a block, it stays at rest with multipliers of zero; the bending of a planar
mechanism out of its plane is such a block.  Which entries are zero is asked at random states of what moves:
an expression that is not identically zero does not vanish there.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from mbref.model import Model, displaced
from mbref.tables import GEOMETRY, PRIMITIVES

FIRST_ROW = 4  # column of PRIMITIVES
STATES = 2  # random states asked, so that an accidental zero at one does no harm


def moving_entries(model: Model, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Which Jacobian entries (m, 12) of the blocks that move can be other than zero; q, v the start.

    ``v`` (6 nb,) has the given velocities, zero elsewhere.  Columns are those of ``tables.JACOBIAN``.
    """
    rng = np.random.default_rng(1)
    moving = np.zeros(model.n, dtype=bool)
    entries = np.zeros((model.m, 12), dtype=bool)
    while True:
        driving_rows, driving_columns = np.zeros(model.m, dtype=bool), v != 0
        for state in range(STATES + 1):
            t = rng.uniform(0.1, 1.0) * model.scene.duration if state else 0.0
            x, w = (moving * rng.normal(size=model.n) if state else np.zeros(model.n) for _ in range(2))
            terms = model.blocks(t, displaced(q, x), w if state else v)
            entries |= (terms.jacobian != 0) & (model.entry_columns() < model.n)
            driving_rows |= (terms.gamma != 0) | (terms.phi != 0) | (terms.nu != 0)
            driving_columns |= terms.force != 0
        found, rows = _reached(model, entries, driving_rows, driving_columns)
        if np.array_equal(found, moving):
            return entries & rows[:, None]
        moving = found


def _reached(
    model: Model, entries: np.ndarray, rows: np.ndarray, columns: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Columns (n,) and rows (m,) of the blocks that have a driving row or column."""
    row, entry = np.nonzero(entries)
    column = model.entry_columns()[row, entry]
    nodes = model.m + model.n
    graph = coo_array((np.ones(row.size), (row, model.m + column)), shape=(nodes, nodes))
    _, label = connected_components(graph, directed=False)
    driving = np.zeros(nodes, dtype=bool)
    driving[label[: model.m][rows]] = True
    driving[label[model.m :][columns]] = True
    return driving[label[model.m :]], driving[label[: model.m]]


def moving_primitives(model: Model, entries: np.ndarray) -> tuple[tuple, tuple]:
    """The model's ``ints`` and ``floats`` without the primitives none of whose rows has an entry."""
    primitives = model.ints[PRIMITIVES]
    live = np.flatnonzero(entries.any(axis=1))
    of_row = np.searchsorted(primitives[:, FIRST_ROW], live, side="right") - 1
    kept = np.unique(of_row)
    ints = tuple(table[kept] if k == PRIMITIVES else table for k, table in enumerate(model.ints))
    floats = tuple(table[kept] if k == GEOMETRY else table for k, table in enumerate(model.floats))
    return ints, floats
