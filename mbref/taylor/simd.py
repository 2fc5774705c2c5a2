"""SIMD vectors: eight numbers as one value of the processor, for the inner loops of the series.

Compiled loops over eight numbers would take several times as long. Offsets count numbers of an array's
memory; the rows of every array are padded to a multiple of WIDTH. Vectors are added, subtracted and
multiplied with each other, and multiplied by a number from the left; products may be added by fused
multiply-add.  Without the JIT a vector is a NumPy array.
"""

from __future__ import annotations

import operator
from collections.abc import Callable

import numpy as np
from llvmlite import ir
from numba import f8, i8, types
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model

from mbref.kernels.compilation import PLAIN
from mbref.kernels.named_memory import WORD

WIDTH = 8
SIMD_VECTOR = ir.VectorType(ir.DoubleType(), WIDTH)


def padded_size(size: int) -> int:
    """Return a size rounded up to the next multiple of WIDTH."""
    return -(-size // WIDTH) * WIDTH


class VectorType(types.Type):
    """The numba type of a vector."""

    def __init__(self):
        super().__init__(name="Vector")


SIMD = VectorType()


@register_model(VectorType)
class _VectorModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, SIMD_VECTOR)


def _repeated(builder, number):
    """Return a vector of one number."""
    none, first = ir.Constant(ir.VectorType(number.type, WIDTH), ir.Undefined), ir.IntType(32)(0)
    of_first = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH)
    return builder.shuffle_vector(builder.insert_element(none, number, first), none, of_first)


def _operation(function: Callable, name: str) -> None:
    """Let numba compile an operation of two vectors, or of a number and a vector."""

    @infer_global(function)
    class Operation(AbstractTemplate):
        def generic(self, arguments, keywords):
            left, right = arguments
            if isinstance(right, VectorType) and isinstance(left, VectorType | types.Float):
                return signature(SIMD, SIMD if isinstance(left, VectorType) else f8, SIMD)
            return None

    @lower_builtin(function, SIMD, SIMD)
    def of_vectors(context, builder, _, arguments):
        return getattr(builder, name)(*arguments, flags=("contract",))

    @lower_builtin(function, f8, SIMD)
    def of_number(context, builder, _, arguments):
        number, other = arguments
        return getattr(builder, name)(_repeated(builder, number), other, flags=("contract",))


for _function, _name in ((operator.add, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul")):
    _operation(_function, _name)


def _place(context, builder, kind, array, offset):
    return builder.gep(context.make_array(kind)(context, builder, array).data, [offset])


@intrinsic
def _load(typing, array, offset):
    def generate(context, builder, signature, arguments):
        place = _place(context, builder, signature.args[0], *arguments)
        loaded = builder.load(builder.bitcast(place, SIMD_VECTOR.as_pointer()))
        loaded.align = WIDTH
        return loaded

    return SIMD(array, i8), generate


@intrinsic
def _store(typing, value, array, offset):
    def generate(context, builder, signature, arguments):
        place = _place(context, builder, signature.args[1], *arguments[1:])
        builder.store(arguments[0], builder.bitcast(place, SIMD_VECTOR.as_pointer())).align = WIDTH
        return context.get_dummy_value()

    return types.void(SIMD, array, i8), generate


@intrinsic
def _gather(typing, array, offset, lanes, first):
    def generate(context, builder, signature, arguments):
        value, (kind, _, index_kind, _) = ir.Constant(SIMD_VECTOR, ir.Undefined), signature.args
        array, offset, lanes, first = arguments
        row = _place(context, builder, kind, array, offset)
        for k in range(WIDTH):
            place = _place(context, builder, index_kind, lanes, builder.add(first, WORD(k)))
            number = builder.load(builder.gep(row, [builder.load(place)]))
            value = builder.insert_element(value, number, ir.IntType(32)(k))
        return value

    return SIMD(array, i8, lanes, i8), generate


@intrinsic
def _max_abs(typing, of):
    def generate(context, builder, signature, arguments):
        (value,) = arguments
        opposite, apart = builder.fneg(value), WIDTH // 2
        largest = builder.select(builder.fcmp_ordered(">", value, opposite), value, opposite)
        while apart:
            places = [(k + apart) % WIDTH for k in range(WIDTH)]
            of_lanes = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), places)
            other = builder.shuffle_vector(largest, largest, of_lanes)
            largest = builder.select(builder.fcmp_ordered(">", other, largest), other, largest)
            apart //= 2
        return builder.extract_element(largest, ir.IntType(32)(0))

    return f8(SIMD), generate


def _plain_max_abs(of):
    return np.abs(of).max()


def _plain_load(array, offset):
    return array.reshape(-1)[offset : offset + WIDTH].copy()


def _plain_store(value, array, offset):
    array.reshape(-1)[offset : offset + WIDTH] = value


def _plain_gather(array, offset, lanes, first):
    return array.reshape(-1)[offset + lanes[first : first + WIDTH]]


load = _plain_load if PLAIN else _load
"""(array, offset): the vector at array[offset …]."""
store = _plain_store if PLAIN else _store
"""(value, array, offset): put a vector at array[offset …]."""
max_abs = _plain_max_abs if PLAIN else _max_abs
"""(vector): the size of its largest number."""
gather = _plain_gather if PLAIN else _gather
"""(array, offset, lanes, first): the vector of array[offset + lanes[first + k]], k = 0 … WIDTH - 1."""
