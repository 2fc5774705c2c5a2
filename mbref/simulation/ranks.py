"""Ranks: how many constraint rows of a run are independent at its start, by singular values."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mbref.equations.model import Model
from mbref.equations.units import row_lengths
from mbref.kernels.layout import Symbolic

MOST_ROWS = 120  # rows whose rank is found


class Ranks(NamedTuple):
    """Singular values of unit rows of Φ_q: how many exceed a tolerance, the least of them, the next."""

    rank: int
    least: float
    next: float


NO_RANKS = Ranks(0, 1.0, 0.0)


def ranks_at(model: Model, q: np.ndarray, symbolic: Symbolic, tolerance: float) -> Ranks:
    """Those of the rows that take part, at q (7 nb,); rank 0 where there are too many."""
    rows, columns = symbolic.row.astype(int), symbolic.column.astype(int)
    if rows.size > MOST_ROWS or not rows.size:
        return NO_RANKS
    jacobian = model.terms(0.0, q, np.zeros(model.n)).jacobian[np.ix_(rows, columns)]
    jacobian *= model.data.metric_root[columns]
    values = np.linalg.svd(jacobian / row_lengths(jacobian)[:, None], compute_uv=False)
    rank = int((values > tolerance).sum())
    return Ranks(rank, float(values[rank - 1]) if rank else 1.0, float(np.append(values, 0.0)[rank]))
