"""LLVM instructions of a function on blocks of numbers, for code of a scene's own."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from llvmlite import ir

from mbref.taylor.generated_calls import function_type
from mbref.taylor.lanes import BLOCK, LANES, WORD

DOUBLE, PLACE = ir.DoubleType(), ir.IntType(32)
WHOLE = WORD
PLACES = ir.VectorType(PLACE, LANES)
FUSED = ("contract",)
CHAINS = 4  # sums that are added up side by side: one would wait for each of its products

Blocks = list[ir.Value]


class Instructions:
    """A function of arrays of doubles and of whole numbers, and of whole numbers, that is being written."""

    def __init__(self, module: ir.Module, name: str, doubles: int, wholes: int = 0, counts: int = 0):
        function = ir.Function(module, function_type(doubles, wholes, counts), name)
        self.pointers = function.args[: doubles + wholes]
        self.counts = function.args[doubles + wholes :]
        for argument in self.pointers:
            argument.add_attribute("noalias")
        self._function = function
        self._builder = ir.IRBuilder(function.append_basic_block())

    def repeat(
        self,
        first: int | ir.Value,
        end: ir.Value,
        blocks: Blocks,
        body: Callable[[ir.Value, Blocks], Blocks],
    ) -> Blocks:
        """Repeat a body for the whole numbers from the first one on, below the end: it makes blocks anew."""
        before, write = self._builder.block, self._builder
        head, inside, behind = (self._function.append_basic_block() for _ in range(3))
        write.branch(head)
        write.position_at_end(head)
        count, kept = write.phi(WORD), [write.phi(BLOCK) for _ in blocks]
        count.add_incoming(_whole(first), before)
        for phi, block in zip(kept, blocks, strict=True):
            phi.add_incoming(block, before)
        write.cbranch(write.icmp_signed("<", count, end), inside, behind)
        write.position_at_end(inside)
        made = body(count, kept)
        count.add_incoming(write.add(count, WORD(1)), write.block)
        for phi, block in zip(kept, made, strict=True):
            phi.add_incoming(block, write.block)
        write.branch(head)
        write.position_at_end(behind)
        return kept

    def row(self, pointer: ir.Value, start: int | ir.Value, lanes: int) -> Blocks:
        """The blocks of as many lanes from a place of an array on."""
        places = (self._block(pointer, start, lane) for lane in range(0, lanes, LANES))
        return [self._builder.load(place, align=8) for place in places]

    def store(self, blocks: Blocks, pointer: ir.Value, start: int | ir.Value) -> None:
        """Put blocks into an array from a place on."""
        for k, block in enumerate(blocks):
            self._builder.store(block, self._block(pointer, start, k * LANES), align=8)

    def block(self, pointer: ir.Value, *places: int | ir.Value) -> ir.Value:
        """The block at the sum of some places of an array."""
        return self._builder.load(self._block(pointer, *places), align=8)

    def number(self, pointer: ir.Value, *places: int | ir.Value) -> ir.Value:
        """The number at the sum of some places of an array."""
        return self._builder.load(self._place(pointer, *places))

    def put(self, number: ir.Value, pointer: ir.Value, *places: int | ir.Value) -> None:
        """Put a number at the sum of some places of an array."""
        self._builder.store(number, self._place(pointer, *places))

    def multiplied(self, whole: ir.Value, factor: int) -> ir.Value:
        """A whole number times a factor."""
        return self._builder.mul(whole, WORD(factor))

    def plus(self, whole: ir.Value, more: int | ir.Value) -> ir.Value:
        """A whole number and more."""
        return self._builder.add(whole, _whole(more))

    def real(self, whole: ir.Value) -> ir.Value:
        """A whole number as a number."""
        return self._builder.sitofp(whole, DOUBLE)

    def halved(self, whole: ir.Value) -> tuple[ir.Value, ir.Value]:
        """A whole number's half, rounded down, and the remainder."""
        return self._builder.lshr(whole, WORD(1)), self._builder.and_(whole, WORD(1))

    def less(self, whole: ir.Value, by: ir.Value) -> ir.Value:
        """A whole number less another."""
        return self._builder.sub(whole, by)

    def inverse(self, number: ir.Value) -> ir.Value:
        """One over a number."""
        return self._builder.fdiv(DOUBLE(1.0), number)

    def minus(self, number: ir.Value) -> ir.Value:
        """A number or block with its sign changed."""
        return self._builder.fneg(number)

    def everywhere(self, number: ir.Value) -> ir.Value:
        """A block of one number."""
        none = ir.Constant(BLOCK, ir.Undefined)
        first = self._builder.insert_element(none, number, PLACE(0))
        return self._shuffled(first, none, [0] * LANES)

    def added_up(self, block: ir.Value) -> ir.Value:
        """The sum of a block's numbers."""
        return self.first(self.summed(block))

    def first(self, block: ir.Value) -> ir.Value:
        """The first number of a block."""
        return self._builder.extract_element(block, PLACE(0))

    def summed(self, block: ir.Value) -> ir.Value:
        """A block of the sum of a block's numbers."""
        apart = LANES // 2
        while apart:
            other = self._shuffled(block, block, [(k + apart) % LANES for k in range(LANES)])
            block = self._builder.fadd(block, other)
            apart //= 2
        return block

    def difference(self, one: ir.Value, other: ir.Value) -> ir.Value:
        """One minus the other; fused where the other is a product."""
        return self._builder.fsub(one, other, flags=FUSED)

    def times(self, numbers: np.ndarray, block: ir.Value) -> ir.Value:
        """A block times numbers (LANES,)."""
        return block if (numbers == 1.0).all() else self.product(constant(numbers), block)

    def product(self, one: ir.Value, other: ir.Value) -> ir.Value:
        """The products of two blocks."""
        return self._builder.fmul(one, other, flags=FUSED)

    def total(self, blocks: Sequence[ir.Value]) -> ir.Value:
        """The sum of blocks, zero without any, added up in several chains."""
        blocks = blocks or [constant([0.0] * LANES)]
        chains = [functools.reduce(self._sum, blocks[k::CHAINS]) for k in range(min(CHAINS, len(blocks)))]
        while len(chains) > 1:
            chains = [functools.reduce(self._sum, chains[k : k + 2]) for k in range(0, len(chains), 2)]
        return chains[0]

    def _sum(self, one: ir.Value, other: ir.Value) -> ir.Value:
        return self._builder.fadd(one, other, flags=FUSED)

    def gathered(self, row: Blocks, lanes: Sequence[int]) -> ir.Value:
        """The block of a row's lanes; -1 for a lane whose number is not used."""
        first, *others = sorted({lane // LANES for lane in lanes if lane >= 0})
        second, *more = others or [first]
        places = [lane % LANES + (LANES if lane // LANES == second != first else 0) for lane in lanes]
        block = self._shuffled(row[first], row[second], places)
        for source in more:
            places = [LANES + lane % LANES if lane // LANES == source else k for k, lane in enumerate(lanes)]
            block = self._shuffled(block, row[source], places)
        return block

    def _shuffled(self, one: ir.Value, other: ir.Value, places: Sequence[int]) -> ir.Value:
        return self._builder.shuffle_vector(one, other, ir.Constant(PLACES, places))

    def repeated(self, row: Blocks, lane: int) -> ir.Value:
        """A block of a lane's number."""
        block = row[lane // LANES]
        return self._shuffled(block, block, [lane % LANES] * LANES)

    def end(self) -> None:
        """Return."""
        self._builder.ret_void()

    def _place(self, pointer: ir.Value, *places: int | ir.Value) -> ir.Value:
        for place in places:
            pointer = self._builder.gep(pointer, [_whole(place)])
        return pointer

    def _block(self, pointer: ir.Value, *places: int | ir.Value) -> ir.Value:
        return self._builder.bitcast(self._place(pointer, *places), BLOCK.as_pointer())


def _whole(number: int | ir.Value) -> ir.Value:
    return WORD(number) if isinstance(number, int) else number


def constant(numbers: Sequence[float]) -> ir.Constant:
    """A block of numbers known."""
    return ir.Constant(BLOCK, [float(number) for number in numbers])


def levels(terms: Sequence[Sequence[tuple[float, int]]]) -> Iterator[tuple[np.ndarray, list[int]]]:
    """Weights (LANES,) and lanes of terms, given by weight and lane of each of a block's numbers: one of each
    number at a time; -1 for a number that has no more."""
    for level in range(max(map(len, terms), default=0)):
        weights, lanes = np.zeros(LANES), [-1] * LANES
        for k, of_number in enumerate(terms):
            if level < len(of_number):
                weights[k], lanes[k] = of_number[level]
        yield weights, lanes
