"""Sums of products over blocks of eight numbers, each a vector of the processor.

Compiled loops over as few numbers would cost several times as much.  Offsets and strides count numbers of the
arrays' memory; every array's rows are filled up to a multiple of LANES.  Without the JIT the functions are
written in NumPy.
"""

from __future__ import annotations

from collections.abc import Callable

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from mbref.kernels.compilation import PLAIN

LANES = 8
WORD, BLOCK = ir.IntType(64), ir.VectorType(ir.DoubleType(), LANES)
ZERO = ir.Constant(BLOCK, [0.0] * LANES)


def filled(size: int) -> int:
    """A size up to the next multiple of LANES."""
    return -(-size // LANES) * LANES


class _Blocks:
    """Vectors in the arrays that an intrinsic is given."""

    def __init__(self, context, builder, signature, arguments):
        self._context, self.builder = context, builder
        self._arguments = list(zip(signature.args, arguments, strict=True))

    def __getitem__(self, argument):
        return self._arguments[argument][1]

    def place(self, argument, offset):
        kind, value = self._arguments[argument]
        return self.builder.gep(
            self._context.make_array(kind)(self._context, self.builder, value).data, [offset]
        )

    def load(self, place):
        block = self.builder.load(self.builder.bitcast(place, BLOCK.as_pointer()))
        block.align = LANES
        return block

    def store(self, block, place):
        self.builder.store(block, self.builder.bitcast(place, BLOCK.as_pointer())).align = LANES

    def repeated(self, number):
        first = self.builder.insert_element(ZERO, number, ir.IntType(32)(0))
        return self.builder.shuffle_vector(
            first, ZERO, ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
        )

    def total(self, count, term: Callable):
        """Σ term(i), i = 0 … count - 1, with count ≥ 1."""
        b, before = self.builder, self.builder.block
        loop, after = b.append_basic_block("terms"), b.append_basic_block("sum")
        b.branch(loop)
        b.position_at_end(loop)
        i, value = b.phi(WORD), b.phi(BLOCK)
        larger, following = b.fadd(value, term(i)), b.add(i, WORD(1))
        for phi, first, later in ((i, WORD(0), following), (value, ZERO, larger)):
            phi.add_incoming(first, before)
            phi.add_incoming(later, b.block)
        b.cbranch(b.icmp_signed("<", following, count), loop, after)
        b.position_at_end(after)
        return larger

    def at(self, offset, stride, i):
        return self.builder.add(offset, self.builder.mul(stride, i))


@intrinsic
def _sum_products(typing, left, p, dp, right, q, dq, count, out, r):
    def generate(context, builder, signature, arguments):
        x = _Blocks(context, builder, signature, arguments)
        block = x.total(x[6], lambda i: builder.fmul(
            x.load(x.place(0, x.at(x[1], x[2], i))), x.load(x.place(3, x.at(x[4], x[5], i)))
        ))  # fmt: skip
        x.store(block, x.place(7, x[8]))
        return context.get_dummy_value()

    return types.void(left, p, dp, right, q, dq, count, out, r), generate


@intrinsic
def _sum_multiples(typing, rows, p, dp, factors, q, count, out, r):
    def generate(context, builder, signature, arguments):
        x = _Blocks(context, builder, signature, arguments)
        block = x.total(x[5], lambda i: builder.fmul(
            x.load(x.place(0, x.at(x[1], x[2], i))),
            x.repeated(builder.load(x.place(3, builder.add(x[4], i)))),
        ))  # fmt: skip
        x.store(block, x.place(6, x[7]))
        return context.get_dummy_value()

    return types.void(rows, p, dp, factors, q, count, out, r), generate


@intrinsic
def _add_product(typing, left, p, right, q, out, r):
    def generate(context, builder, signature, arguments):
        x = _Blocks(context, builder, signature, arguments)
        place = x.place(4, x[5])
        product = builder.fmul(x.load(x.place(0, x[1])), x.load(x.place(2, x[3])))
        x.store(builder.fadd(x.load(place), product), place)
        return context.get_dummy_value()

    return types.void(left, p, right, q, out, r), generate


@intrinsic
def _add_multiple(typing, factor, rows, p, out, r):
    def generate(context, builder, signature, arguments):
        x = _Blocks(context, builder, signature, arguments)
        place = x.place(3, x[4])
        multiple = builder.fmul(x.load(x.place(1, x[2])), x.repeated(x[0]))
        x.store(builder.fadd(x.load(place), multiple), place)
        return context.get_dummy_value()

    return types.void(factor, rows, p, out, r), generate


def _plain_products(left, p, dp, right, q, dq, count, out, r):
    left, right, out = left.reshape(-1), right.reshape(-1), out.reshape(-1)
    out[r : r + LANES] = sum(
        left[p + i * dp : p + i * dp + LANES] * right[q + i * dq : q + i * dq + LANES] for i in range(count)
    )


def _plain_multiples(rows, p, dp, factors, q, count, out, r):
    rows, factors, out = rows.reshape(-1), factors.reshape(-1), out.reshape(-1)
    out[r : r + LANES] = sum(rows[p + i * dp : p + i * dp + LANES] * factors[q + i] for i in range(count))


def _plain_add_product(left, p, right, q, out, r):
    out[r : r + LANES] += left[p : p + LANES] * right[q : q + LANES]


def _plain_add(factor, rows, p, out, r):
    out.reshape(-1)[r : r + LANES] += factor * rows.reshape(-1)[p : p + LANES]


sum_products = _plain_products if PLAIN else _sum_products
"""(left, p, dp, right, q, dq, count, out, r): out[r …] := Σ left[p + i dp …] right[q + i dq …]."""
sum_multiples = _plain_multiples if PLAIN else _sum_multiples
"""(rows, p, dp, factors, q, count, out, r): out[r …] := Σ rows[p + i dp …] factors[q + i]."""
add_product = _plain_add_product if PLAIN else _add_product
"""(left, p, right, q, out, r): out[r …] += left[p …] right[q …]."""
add_multiple = _plain_add if PLAIN else _add_multiple
"""(factor, rows, p, out, r): out[r …] += factor rows[p …]."""
