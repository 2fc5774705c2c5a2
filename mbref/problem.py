"""The problem: every array of a simulation behind one argument of the exchangeable kernels.

A kernel called by its address receives each array as seven words; two dozen of them at every evaluation
cost more than many an evaluation.  So they are passed as a table of addresses, ``packed`` from Python,
which ``opened`` turns back into the tuples of ``tables``; arrays that a kernel does not use cost nothing.
Without the JIT the problem is the tuples themselves.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from mbref.compiled import INDEX_TABLE, INDICES, MATRIX, PLAIN, PLAN, VECTOR, kernel

NO_PLAN = np.zeros(1, dtype=np.uint32)


def packed(ints: tuple, floats: tuple, work: tuple, pivots, settings, counts, plan=NO_PLAN):
    """The problem of these arrays, which the caller must keep alive: (arrays, 3) addresses, rows, columns.

    ``plan`` has the indices of ``sparse.plan`` where a chart needs them.
    """
    if PLAIN:
        return ints, floats, work, pivots, settings, counts, plan
    arrays = (*ints, *floats, *work, pivots, settings, counts, plan)
    return np.array([[a.ctypes.data, a.shape[0], a.shape[-1]] for a in arrays], dtype=np.int64)


def _array_at(kind: types.Array) -> Callable:
    """A kernel function: the array of this type that a row of the table describes."""

    @intrinsic
    def array_at(typingctx, table, row):
        def generate(context, builder, signature, arguments):
            base = context.make_array(signature.args[0])(context, builder, arguments[0]).data
            word = ir.IntType(64)

            def entry(column):
                place = builder.add(builder.mul(arguments[1], word(3)), word(column))
                return builder.load(builder.gep(base, [place]))

            array = context.make_array(kind)(context, builder)
            columns, size = entry(2), word(kind.dtype.bitwidth // 8)
            context.populate_array(
                array,
                data=builder.inttoptr(entry(0), array.data.type),
                shape=[entry(1), columns] if kind.ndim == 2 else [columns],
                strides=[builder.mul(columns, size), size] if kind.ndim == 2 else [size],
                itemsize=size,
                meminfo=None,
            )
            return array._getvalue()

        return kind(table, row), generate

    return array_at


_table_at, _matrix_at = _array_at(INDEX_TABLE), _array_at(MATRIX)
_vector_at, _indices_at, _plan_at = _array_at(VECTOR), _array_at(INDICES), _array_at(PLAN)


def _first_six(problem):
    return problem[:6]


def _last(problem):
    return problem[6]


def _from_addresses(problem):
    """ints, floats, work, pivots, settings, counts; the numbers of arrays are those of ``tables``."""
    ints = (_table_at(problem, 0), _table_at(problem, 1), _table_at(problem, 2))
    floats = (
        _matrix_at(problem, 3), _matrix_at(problem, 4), _matrix_at(problem, 5), _matrix_at(problem, 6),
        _matrix_at(problem, 7),
    )  # fmt: skip
    work = (
        _matrix_at(problem, 8), _matrix_at(problem, 9), _matrix_at(problem, 10), _matrix_at(problem, 11),
        _matrix_at(problem, 12), _matrix_at(problem, 13), _matrix_at(problem, 14), _matrix_at(problem, 15),
        _matrix_at(problem, 16), _matrix_at(problem, 17), _matrix_at(problem, 18), _matrix_at(problem, 19),
    )  # fmt: skip
    return ints, floats, work, _table_at(problem, 20), _vector_at(problem, 21), _indices_at(problem, 22)


def _plan_from_address(problem):
    """The plan, whose row is the last."""
    return _plan_at(problem, problem.shape[0] - 1)


opened = _first_six if PLAIN else kernel(_from_addresses)
planned = _last if PLAIN else kernel(_plan_from_address)
