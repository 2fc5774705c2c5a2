"""Ranks: the number of independent constraint rows at the start of a run, by singular values or pivots."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from mbref.equations.model import Model
from mbref.equations.reduction import Reduction, reduced_start
from mbref.equations.units import unit_rows
from mbref.kernels.layout import LINK, SparseFactor, Symbolic
from mbref.kernels.named_memory import packed
from mbref.linear_algebra.minimum_norm import factorise_once
from mbref.linear_algebra.symbolic_factorisation import MOST_PATTERNS, sparse_factor
from mbref.stabilisation.projection import INDEPENDENT

MOST_RANKED_ROWS = 120  # rows; singular values of more rows are not computed


class Ranks(NamedTuple):
    """Singular values of unit rows of Φ_q: how many exceed a tolerance, the least of these values, and the
    next smaller value."""

    rank: int
    least: float
    next: float


NO_RANKS = Ranks(0, 1.0, 0.0)


def ranks_of_start(model: Model, steps: Reduction | None, tolerance: float) -> Ranks:
    """Return the ranks of the rows of the steps of a run at its start; no ranks if nothing is left out."""
    if steps is None:
        return NO_RANKS
    start, _, blocks = reduced_start(model)
    return ranks_at(model, start.q, steps.symbolic, tolerance, blocks)


def ranks_at(
    model: Model, q: np.ndarray, symbolic: Symbolic, tolerance: float, blocks: np.ndarray | None = None
) -> Ranks:
    """Return the ranks of the rows of a factorisation at q (7 nb,); for many rows, only a test by pivots.

    ``blocks`` are the blocks of Φ_q at q, if they are known.
    """
    size = _of_system(symbolic)[0].size
    if blocks is None:
        blocks = model.terms(0.0, q).blocks
    if size > MOST_RANKED_ROWS:
        return NO_RANKS._replace(rank=size if are_clear(model, blocks, sparse_factor(symbolic)) else 0)
    (found,) = all_ranks(model, blocks[None], model.data.metric_root[None], symbolic, tolerance)
    return found


def all_ranks(
    model: Model, blocks: np.ndarray, metric_root: np.ndarray, symbolic: Symbolic, tolerance: float
) -> list[Ranks]:
    """Return ``ranks_at`` for s scenes of a model's structure; no ranks if there are too many rows.

    Arguments are Φ_q as blocks (s, m, 12) and the inverse roots (s, n) of their metrics.
    """
    rows, columns = _of_system(symbolic)
    if rows.size > MOST_RANKED_ROWS or not rows.size:
        return [NO_RANKS] * len(blocks)
    jacobian = model.structure.dense(blocks)[:, rows[:, None], columns] * metric_root[:, None, columns]
    every = np.linalg.svd(unit_rows(jacobian), compute_uv=False)
    return [_ranks(values, tolerance) for values in every]


def _of_system(symbolic: Symbolic) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows and the columns of the system in a factorisation, without links and copies."""
    return _of_indices(symbolic.row.tobytes(), symbolic.column.tobytes())


@lru_cache(maxsize=MOST_PATTERNS)
def _of_indices(row: bytes, column: bytes) -> tuple[np.ndarray, np.ndarray]:
    """Return ``_of_system`` for the indices of a factorisation as bytes."""
    rows, columns = np.frombuffer(row, np.uint32), np.frombuffer(column, np.uint32)
    return rows[rows != LINK].astype(int), np.unique(columns).astype(int)


def _ranks(values: np.ndarray, tolerance: float) -> Ranks:
    rank = int((values > tolerance).sum())
    least, rest = values[rank - 1] if rank else 1.0, values[rank] if rank < values.size else 0.0
    return Ranks(rank, float(least), float(rest))


def are_clear(model: Model, blocks: np.ndarray, factor: SparseFactor) -> bool:
    """Return whether all pivots of the factor of Φ_q, given as blocks (m, 12), show independent rows."""
    positive = factorise_once(blocks.reshape(-1), model.data.metric_root, packed(factor).argument)
    squares = 1.0 / (factor.l[factor.symbolic.l_start[:-1]] * factor.diagonal)
    return bool(positive and squares.min() > INDEPENDENT)
