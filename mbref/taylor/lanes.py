"""Blocks: eight numbers as one value, a vector of the processor, for the inner loops of the series.

Compiled loops over as few numbers would cost several times as much.  Offsets count numbers of an array's
memory; the rows of every array are filled up to a multiple of LANES.  Blocks are added, subtracted and
multiplied with each other, and multiplied by a number from the left; a sum may take a product in before it is
rounded.  Without the JIT a block is a NumPy array.
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

LANES = 8
WORD, BLOCK = ir.IntType(64), ir.VectorType(ir.DoubleType(), LANES)


def filled(size: int) -> int:
    """A size up to the next multiple of LANES."""
    return -(-size // LANES) * LANES


class Block(types.Type):
    """The numba type of a block."""

    def __init__(self):
        super().__init__(name="Block")


block = Block()


@register_model(Block)
class _BlockModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, BLOCK)


def _repeated(builder, number):
    """A vector of one number."""
    none, first = ir.Constant(ir.VectorType(number.type, LANES), ir.Undefined), ir.IntType(32)(0)
    of_first = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(builder.insert_element(none, number, first), none, of_first)


def _operation(function: Callable, name: str) -> None:
    """Let numba compile an operation of two blocks, or of a number and a block."""

    @infer_global(function)
    class Operation(AbstractTemplate):
        def generic(self, arguments, keywords):
            left, right = arguments
            if isinstance(right, Block) and isinstance(left, Block | types.Float):
                return signature(block, block if isinstance(left, Block) else f8, block)
            return None

    @lower_builtin(function, block, block)
    def of_blocks(context, builder, _, arguments):
        return getattr(builder, name)(*arguments, flags=("contract",))

    @lower_builtin(function, f8, block)
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
        loaded = builder.load(builder.bitcast(place, BLOCK.as_pointer()))
        loaded.align = LANES
        return loaded

    return block(array, i8), generate


@intrinsic
def _store(typing, value, array, offset):
    def generate(context, builder, signature, arguments):
        place = _place(context, builder, signature.args[1], *arguments[1:])
        builder.store(arguments[0], builder.bitcast(place, BLOCK.as_pointer())).align = LANES
        return context.get_dummy_value()

    return types.void(block, array, i8), generate


@intrinsic
def _gathered(typing, array, offset, lanes, first):
    def generate(context, builder, signature, arguments):
        value, (kind, _, index_kind, _) = ir.Constant(BLOCK, ir.Undefined), signature.args
        array, offset, lanes, first = arguments
        row = _place(context, builder, kind, array, offset)
        for k in range(LANES):
            place = _place(context, builder, index_kind, lanes, builder.add(first, WORD(k)))
            number = builder.load(builder.gep(row, [builder.load(place)]))
            value = builder.insert_element(value, number, ir.IntType(32)(k))
        return value

    return block(array, i8, lanes, i8), generate


@intrinsic
def _peak(typing, of):
    def generate(context, builder, signature, arguments):
        (value,) = arguments
        opposite, apart = builder.fneg(value), LANES // 2
        largest = builder.select(builder.fcmp_ordered(">", value, opposite), value, opposite)
        while apart:
            places = [(k + apart) % LANES for k in range(LANES)]
            of_lanes = ir.Constant(ir.VectorType(ir.IntType(32), LANES), places)
            other = builder.shuffle_vector(largest, largest, of_lanes)
            largest = builder.select(builder.fcmp_ordered(">", other, largest), other, largest)
            apart //= 2
        return builder.extract_element(largest, ir.IntType(32)(0))

    return f8(block), generate


def _plain_peak(of):
    return np.abs(of).max()


def _plain_load(array, offset):
    return array.reshape(-1)[offset : offset + LANES].copy()


def _plain_store(value, array, offset):
    array.reshape(-1)[offset : offset + LANES] = value


def _plain_gathered(array, offset, lanes, first):
    return array.reshape(-1)[offset + lanes[first : first + LANES]]


load = _plain_load if PLAIN else _load
"""(array, offset): the block at array[offset …]."""
store = _plain_store if PLAIN else _store
"""(value, array, offset): put a block at array[offset …]."""
peak = _plain_peak if PLAIN else _peak
"""(block): the size of its largest number."""
gathered = _plain_gathered if PLAIN else _gathered
"""(array, offset, lanes, first): the block of array[offset + lanes[first + k]], k = 0 … LANES - 1."""
