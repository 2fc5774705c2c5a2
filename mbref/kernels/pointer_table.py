"""Arrays and kernels behind one argument: a table of addresses, and how kernels read it.

A kernel called by its address receives each array as seven words, which for two dozen arrays costs more
than many an evaluation; and numba takes 50 µs to accept a function from Python.  Reading from a table costs
nothing for what is not used.  Without the JIT what is passed are the arrays and functions themselves.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from mbref.kernels.compilation import PLAIN

WORD = ir.IntType(64)


def table_of(items: Sequence[np.ndarray | Callable]) -> np.ndarray:
    """(items, 3): address, rows and columns of each array, or the address of a compiled kernel.

    The caller must keep the items alive.  Without the JIT, the items.
    """
    return tuple(items) if PLAIN else np.array([_row(item) for item in items], dtype=np.int64)


def _row(item: np.ndarray | Callable) -> list[int]:
    if isinstance(item, np.ndarray):
        return [item.ctypes.data, item.shape[0], item.shape[-1]]
    return [item.address, 0, 0]


def _entry(context, builder, signature, arguments, column: int) -> ir.Value:
    """Instructions that load a word from a row of the table."""
    base = context.make_array(signature.args[0])(context, builder, arguments[0]).data
    place = builder.add(builder.mul(arguments[1], WORD(3)), WORD(column))
    return builder.load(builder.gep(base, [place]))


def array_at(kind: types.Array) -> Callable:
    """A kernel function (table, row) -> the array of this type there."""

    @intrinsic
    def array(typingctx, table, row):
        def generate(*build):
            context, builder, _, _ = build
            columns, size = _entry(*build, 2), WORD(kind.dtype.bitwidth // 8)
            made = context.make_array(kind)(context, builder)
            context.populate_array(
                made,
                data=builder.inttoptr(_entry(*build, 0), made.data.type),
                shape=[_entry(*build, 1), columns] if kind.ndim == 2 else [columns],
                strides=[builder.mul(columns, size), size] if kind.ndim == 2 else [size],
                itemsize=size,
                meminfo=None,
            )
            return made._getvalue()

        return kind(table, row), generate

    return operator.getitem if PLAIN else array


def kernel_at(kind: types.FunctionType) -> Callable:
    """A kernel function (table, row) -> the exchangeable kernel of this type there."""

    @intrinsic
    def function(typingctx, table, row):
        def generate(*build):
            context, builder, _, _ = build
            made = cgutils.create_struct_proxy(kind)(context, builder)
            made.c_addr = builder.inttoptr(_entry(*build, 0), made.c_addr.type)
            return made._getvalue()

        return kind(table, row), generate

    return operator.getitem if PLAIN else function
