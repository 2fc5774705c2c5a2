"""The problem: every array of a simulation behind one argument of the exchangeable kernels."""

from __future__ import annotations

import numpy as np

from mbref.kernels.compilation import INDEX_TABLE, INDICES, MATRIX, PLAN, VECTOR, view
from mbref.kernels.pointer_table import array_at, table_of

_table_at, _matrix_at = array_at(INDEX_TABLE), array_at(MATRIX)
_vector_at, _indices_at, _plan_at = array_at(VECTOR), array_at(INDICES), array_at(PLAN)

NO_PLAN = np.zeros(1, dtype=np.uint32)


def packed(
    ints: tuple,
    floats: tuple,
    work: tuple,
    pivots: np.ndarray,
    settings: np.ndarray,
    counts: np.ndarray,
    plan: np.ndarray = NO_PLAN,
) -> np.ndarray | tuple:
    """The problem of these arrays (see ``tables``), which the caller must keep alive.

    ``plan`` has the indices of ``sparse.plan`` where a chart needs them.
    """
    return table_of((*ints, *floats, *work, pivots, settings, counts, plan))


@view
def opened(problem):
    """ints, floats, work, pivots, settings, counts; the numbers of arrays are those of ``tables``."""
    ints = (
        _table_at(problem, 0), _table_at(problem, 1), _table_at(problem, 2), _table_at(problem, 3),
    )  # fmt: skip
    floats = (
        _matrix_at(problem, 4), _matrix_at(problem, 5), _matrix_at(problem, 6), _matrix_at(problem, 7),
        _matrix_at(problem, 8),
    )  # fmt: skip
    work = (
        _matrix_at(problem, 9), _matrix_at(problem, 10), _matrix_at(problem, 11), _matrix_at(problem, 12),
        _matrix_at(problem, 13), _matrix_at(problem, 14), _matrix_at(problem, 15), _matrix_at(problem, 16),
        _matrix_at(problem, 17), _matrix_at(problem, 18), _matrix_at(problem, 19), _matrix_at(problem, 20),
    )  # fmt: skip
    return ints, floats, work, _table_at(problem, 21), _vector_at(problem, 22), _indices_at(problem, 23)


@view
def planned(problem):
    """The plan of the sparse factor."""
    return _plan_at(problem, 24)
