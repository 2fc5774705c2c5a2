"""LLVM instructions of a function on vectors of numbers, for code generated for a scene."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from llvmlite import ir

from mbref.taylor.generated_calls import function_type
from mbref.taylor.simd import SIMD_VECTOR, WIDTH, WORD

DOUBLE, PLACE = ir.DoubleType(), ir.IntType(32)
WHOLE = WORD
PLACES = ir.VectorType(PLACE, WIDTH)
FUSED = ("contract",)
PARALLEL_SUMS = 4  # sums that are added in parallel, since one sum would wait for each of its products

Vectors = list[ir.Value]


class Instructions:
    """A function under construction, whose arguments are arrays of doubles, arrays of integers, and
    integers."""

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
        vectors: Vectors,
        body: Callable[[ir.Value, Vectors], Vectors],
    ) -> Vectors:
        """Repeat a body for the integers from ``first`` to below ``end``; the body returns new values of the
        vectors."""
        before, write = self._builder.block, self._builder
        head, inside, behind = (self._function.append_basic_block() for _ in range(3))
        write.branch(head)
        write.position_at_end(head)
        count, kept = write.phi(WORD), [write.phi(SIMD_VECTOR) for _ in vectors]
        count.add_incoming(_whole(first), before)
        for phi, vector in zip(kept, vectors, strict=True):
            phi.add_incoming(vector, before)
        write.cbranch(write.icmp_signed("<", count, end), inside, behind)
        write.position_at_end(inside)
        made = body(count, kept)
        count.add_incoming(write.add(count, WORD(1)), write.block)
        for phi, vector in zip(kept, made, strict=True):
            phi.add_incoming(vector, write.block)
        write.branch(head)
        write.position_at_end(behind)
        return kept

    def row(self, pointer: ir.Value, start: int | ir.Value, lanes: int) -> Vectors:
        """Return the vectors of some lanes of an array, from a place on."""
        places = (self._vector(pointer, start, lane) for lane in range(0, lanes, WIDTH))
        return [self._builder.load(place, align=8) for place in places]

    def store(self, vectors: Vectors, pointer: ir.Value, start: int | ir.Value) -> None:
        """Put vectors into an array from a place on."""
        for k, vector in enumerate(vectors):
            self._builder.store(vector, self._vector(pointer, start, k * WIDTH), align=8)

    def vector(self, pointer: ir.Value, *places: int | ir.Value) -> ir.Value:
        """Return the vector at the sum of some places of an array."""
        return self._builder.load(self._vector(pointer, *places), align=8)

    def number(self, pointer: ir.Value, *places: int | ir.Value) -> ir.Value:
        """Return the number at the sum of some places of an array."""
        return self._builder.load(self._place(pointer, *places))

    def put(self, number: ir.Value, pointer: ir.Value, *places: int | ir.Value) -> None:
        """Put a number at the sum of some places of an array."""
        self._builder.store(number, self._place(pointer, *places))

    def multiplied(self, whole: ir.Value, factor: int) -> ir.Value:
        """Return an integer times a factor."""
        return self._builder.mul(whole, WORD(factor))

    def plus(self, whole: ir.Value, more: int | ir.Value) -> ir.Value:
        """Return the sum of two integers."""
        return self._builder.add(whole, _whole(more))

    def real(self, whole: ir.Value) -> ir.Value:
        """Return an integer as a floating-point number."""
        return self._builder.sitofp(whole, DOUBLE)

    def halved(self, whole: ir.Value) -> tuple[ir.Value, ir.Value]:
        """Return half of an integer, rounded down, and the remainder."""
        return self._builder.lshr(whole, WORD(1)), self._builder.and_(whole, WORD(1))

    def less(self, whole: ir.Value, by: ir.Value) -> ir.Value:
        """Return the difference of two integers."""
        return self._builder.sub(whole, by)

    def inverse(self, number: ir.Value) -> ir.Value:
        """Return the inverse of a number."""
        return self._builder.fdiv(DOUBLE(1.0), number)

    def minus(self, number: ir.Value) -> ir.Value:
        """Return a number or vector with its sign changed."""
        return self._builder.fneg(number)

    def everywhere(self, number: ir.Value) -> ir.Value:
        """Return a vector of one number in all lanes."""
        none = ir.Constant(SIMD_VECTOR, ir.Undefined)
        first = self._builder.insert_element(none, number, PLACE(0))
        return self._shuffled(first, none, [0] * WIDTH)

    def first(self, vector: ir.Value) -> ir.Value:
        """Return the first number of a vector."""
        return self._builder.extract_element(vector, PLACE(0))

    def summed(self, vector: ir.Value) -> ir.Value:
        """Return the sum of the numbers of a vector in all lanes."""
        apart = WIDTH // 2
        while apart:
            other = self._shuffled(vector, vector, [(k + apart) % WIDTH for k in range(WIDTH)])
            vector = self._builder.fadd(vector, other)
            apart //= 2
        return vector

    def difference(self, one: ir.Value, other: ir.Value) -> ir.Value:
        """Return the difference of two vectors; with fused multiply-add if the second vector is a product."""
        return self._builder.fsub(one, other, flags=FUSED)

    def times(self, numbers: np.ndarray, vector: ir.Value) -> ir.Value:
        """Return a vector times numbers (WIDTH,)."""
        return vector if (numbers == 1.0).all() else self.product(constant(numbers), vector)

    def product(self, one: ir.Value, other: ir.Value) -> ir.Value:
        """Return the products of two vectors."""
        return self._builder.fmul(one, other, flags=FUSED)

    def total(self, vectors: Sequence[ir.Value]) -> ir.Value:
        """Return the sum of vectors, added up in several chains; zero without vectors."""
        vectors = vectors or [constant([0.0] * WIDTH)]
        count = min(PARALLEL_SUMS, len(vectors))
        chains = [functools.reduce(self._sum, vectors[k::count]) for k in range(count)]
        while len(chains) > 1:
            chains = [functools.reduce(self._sum, chains[k : k + 2]) for k in range(0, len(chains), 2)]
        return chains[0]

    def _sum(self, one: ir.Value, other: ir.Value) -> ir.Value:
        return self._builder.fadd(one, other, flags=FUSED)

    def gather(self, row: Vectors, lanes: Sequence[int]) -> ir.Value:
        """Return a vector of lanes of a row; lane -1 for a number that is not used."""
        first, *others = sorted({lane // WIDTH for lane in lanes if lane >= 0})
        second, *more = others or [first]
        places = [lane % WIDTH + (WIDTH if lane // WIDTH == second != first else 0) for lane in lanes]
        vector = self._shuffled(row[first], row[second], places)
        for source in more:
            places = [WIDTH + lane % WIDTH if lane // WIDTH == source else k for k, lane in enumerate(lanes)]
            vector = self._shuffled(vector, row[source], places)
        return vector

    def _shuffled(self, one: ir.Value, other: ir.Value, places: Sequence[int]) -> ir.Value:
        return self._builder.shuffle_vector(one, other, ir.Constant(PLACES, places))

    def repeated(self, row: Vectors, lane: int) -> ir.Value:
        """Return the number of a lane in all lanes."""
        vector = row[lane // WIDTH]
        return self._shuffled(vector, vector, [lane % WIDTH] * WIDTH)

    def end(self) -> None:
        """Write the return instruction."""
        self._builder.ret_void()

    def _place(self, pointer: ir.Value, *places: int | ir.Value) -> ir.Value:
        for place in places:
            pointer = self._builder.gep(pointer, [_whole(place)])
        return pointer

    def _vector(self, pointer: ir.Value, *places: int | ir.Value) -> ir.Value:
        return self._builder.bitcast(self._place(pointer, *places), SIMD_VECTOR.as_pointer())


def _whole(number: int | ir.Value) -> ir.Value:
    return WORD(number) if isinstance(number, int) else number


def constant(numbers: Sequence[float] | np.ndarray) -> ir.Constant:
    """Return a vector of constants."""
    return ir.Constant(SIMD_VECTOR, [float(number) for number in numbers])


def levels(terms: Sequence[Sequence[tuple[float, int]]]) -> Iterator[tuple[np.ndarray, list[int]]]:
    """Yield weights (WIDTH,) and lanes of terms, given by weight and lane of each number of a vector.

    One term of each number is yielded at a time; lane -1 stands for a number without further terms.
    """
    for level in range(max(map(len, terms), default=0)):
        weights, lanes = np.zeros(WIDTH), [-1] * WIDTH
        for k, of_number in enumerate(terms):
            if level < len(of_number):
                weights[k], lanes[k] = of_number[level]
        yield weights, lanes
