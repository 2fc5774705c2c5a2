"""Machine code of a scene's series: ``mbref.taylor.series`` for one scene and one order, without loops.

The orders stand one after the other, so that a processor begins one while it ends another.  The numbers that
meet in a product are known, so that blocks are shuffled in registers.  A sum may take a product in before it
is rounded, as in the kernels.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from mbref.kernels.compilation import CACHE, PLAIN
from mbref.kernels.machine_code import Code, code_at, processor
from mbref.specialised import Untraceable
from mbref.taylor.lanes import BLOCK, LANES, WORD
from mbref.taylor.layout import TaylorMemory

DOUBLES, PLACE = ir.DoubleType().as_pointer(), ir.IntType(32)
PLACES = ir.VectorType(PLACE, LANES)
FUSED = ("contract",)
CHAINS = 4  # sums that are added up side by side: one would wait for each of its products
NAME = "expand"
MOST_BLOCKS = 12_000  # what LLVM compiles in a second or two

Blocks = list[ir.Value]


class Instructions:
    """A function of some pointers to doubles that is being written."""

    def __init__(self, module: ir.Module, name: str, pointers: int):
        function = ir.Function(module, ir.FunctionType(ir.VoidType(), [DOUBLES] * pointers), name)
        for argument in function.args:
            argument.add_attribute("noalias")
        self.pointers = function.args
        self._builder = ir.IRBuilder(function.append_basic_block())

    def row(self, pointer: ir.Value, row: int, lanes: int) -> Blocks:
        """The blocks of a row of an array."""
        places = (self._place(pointer, row * lanes + lane) for lane in range(0, lanes, LANES))
        return [self._builder.load(place, align=8) for place in places]

    def store(self, blocks: Blocks, pointer: ir.Value, row: int) -> None:
        """Put the blocks of a row into an array."""
        for k, block in enumerate(blocks):
            self._builder.store(block, self._place(pointer, (row * len(blocks) + k) * LANES), align=8)

    def times(self, numbers: np.ndarray, block: ir.Value) -> ir.Value:
        """A block times numbers (LANES,)."""
        return block if (numbers == 1.0).all() else self.product(constant(numbers), block)

    def product(self, one: ir.Value, other: ir.Value) -> ir.Value:
        """The products of two blocks."""
        return self._builder.fmul(one, other, flags=FUSED)

    def total(self, blocks: Sequence[ir.Value]) -> ir.Value:
        """The sum of blocks, added up in several chains."""
        chains = [self._chain(blocks[k::CHAINS]) for k in range(min(CHAINS, len(blocks)))]
        return self._chain(chains)

    def _chain(self, blocks: Sequence[ir.Value]) -> ir.Value:
        total = blocks[0]
        for block in blocks[1:]:
            total = self._builder.fadd(total, block, flags=FUSED)
        return total

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

    def _place(self, pointer: ir.Value, offset: int) -> ir.Value:
        place = self._builder.gep(pointer, [WORD(offset)])
        return self._builder.bitcast(place, BLOCK.as_pointer())


def constant(numbers: Sequence[float]) -> ir.Constant:
    """A block of numbers known."""
    return ir.Constant(BLOCK, [float(number) for number in numbers])


class Orders:
    """The orders of a series, one after the other: terms (orders, lanes) by the response (lanes, lanes)."""

    def __init__(self, taylor: TaylorMemory, write: Instructions):
        self._taylor, self._write = taylor, write
        solver, given = taylor.solver, taylor.polynomials.given
        self._equations = solver.order.size + solver.row.size
        self._functions = range(self._equations, self._equations + given.driver.size)
        self._lanes = taylor.series.terms.shape[1]
        self._terms, response = write.pointers
        self._response = [
            write.row(response, e, self._lanes) for e in range(self._equations + len(self._functions))
        ]
        self._rows = [write.row(self._terms, k, self._lanes) for k in (0, 1)]
        self._left: list[dict[int, ir.Value]] = []
        self._right: list[dict[int, ir.Value]] = []

    def put(self, k: int) -> None:
        """Write order k + 2 of the variables and order k of the multipliers."""
        self._put_factors(k + 1)
        sums = [self._sum(k, block) for block in range(self._lanes // LANES)]
        numbers = [(self._write.repeated(sums, e), e) for e in range(self._equations) if sums[e // LANES]]
        if self._functions:
            prescribed = self._write.row(self._terms, k + 2, self._lanes)
            numbers += [(self._write.repeated(prescribed, g), g) for g in self._functions]
        row = [self._grown(k, block, numbers) for block in range(self._lanes // LANES)]
        self._write.store(row, self._terms, k + 2)
        self._rows.append(row)

    def _put_factors(self, order: int) -> None:
        """The factors of the products that a new row of terms gives."""
        products, row = self._taylor.polynomials.products, self._rows[order]
        left, right, known = {}, {}, {}
        for slot in range(0, products.weight.size, LANES):
            weight = products.weight[slot : slot + LANES]
            if weight.any():
                one, other = (
                    tuple(np.where(weight, lanes[slot : slot + LANES], -1).tolist())
                    for lanes in (products.left, products.right)
                )
                for lanes in {one, other} - known.keys():
                    known[lanes] = self._write.gathered(row, lanes)
                left[slot], right[slot] = self._write.times(weight, known[one]), known[other]
        self._left.append(left)
        self._right.append(right)

    def _sum(self, k: int, block: int) -> ir.Value | None:
        """A block of the right-hand side of order k; None where it has nothing but zeros."""
        terms = [*self._products(k, block), *self._forces(k, block)]
        if not terms:
            return None
        scale = self._taylor.series.scale[k, block * LANES : (block + 1) * LANES]
        return self._write.times(scale, self._write.total(terms))

    def _products(self, k: int, block: int) -> Iterator[ir.Value]:
        """The products of a block, those of the newest factors last, which are known last."""
        start = self._taylor.polynomials.products.start
        slots = [slot for slot in range(start[block], start[block + 1], LANES) if slot in self._left[0]]
        for i in [*range(1, k), *sorted({0, k})]:
            for slot in slots:
                yield self._write.product(self._left[i][slot], self._right[k - i][slot])

    def _forces(self, k: int, block: int) -> Iterator[ir.Value]:
        """Minus the constant forces and those linear in the variables."""
        inertia = self._taylor.polynomials.inertia
        force = inertia.force[block * LANES : (block + 1) * LANES]
        if k == 0 and force.any():
            yield constant(-force)
        for slot in range(inertia.start[block], inertia.start[block + 1], LANES):
            weight = inertia.weight[slot : slot + LANES]
            if weight.any():
                lanes = np.where(weight, inertia.source[slot : slot + LANES], -1).tolist()
                yield self._write.times(-weight, self._write.gathered(self._rows[k], lanes))

    def _grown(self, k: int, block: int, numbers: Sequence[tuple[ir.Value, int]]) -> ir.Value:
        """A block of the response to the numbers on the right-hand side."""
        parts = [self._write.product(number, self._response[e][block]) for number, e in numbers]
        growth = self._taylor.series.growth[k, block * LANES : (block + 1) * LANES]
        return self._write.times(growth, self._write.total(parts)) if parts else constant([0.0] * LANES)


def code_of(taylor: TaylorMemory) -> Code:
    """The code of a scene for the order of its series, made or loaded.

    Raises Untraceable where there are springs, the code would be long, or there is no JIT.
    """
    if PLAIN:
        raise Untraceable("without the JIT there is no machine code")
    polynomials = taylor.polynomials
    if polynomials.springs.damping.size + polynomials.torsions.damping.size:
        raise Untraceable("the series of its springs are made by the kernels that serve every scene")
    if (length := blocks_of(taylor)) > MOST_BLOCKS:
        raise Untraceable(f"its series take {length} products of blocks, more than {MOST_BLOCKS}")
    return code_at(CACHE / "scenes" / f"{_key(taylor)}.code", lambda: write_series(taylor))


def blocks_of(taylor: TaylorMemory) -> int:
    """Products of blocks in a series: of its factors, and of the right-hand sides with the response."""
    order, (_, lanes) = int(taylor.progress.order), taylor.series.terms.shape
    factors = taylor.polynomials.products.weight.size // LANES
    return factors * order * order // 2 + order * lanes * lanes // LANES


def _key(taylor: TaylorMemory) -> str:
    """A digest of all that the code depends on."""
    polynomials, solver = taylor.polynomials, taylor.solver
    digest = hashlib.sha256(f"{taylor.progress.order} {solver.order.size} {processor()}".encode())
    for array in (*polynomials.products, *polynomials.inertia, polynomials.given.driver):
        digest.update(str(array.shape).encode() + array.tobytes())
    return digest.hexdigest()[:32]


def write_series(taylor: TaylorMemory) -> str:
    """LLVM IR of the function that finds all orders from the first two, by the response."""
    module = ir.Module()
    write = Instructions(module, NAME, 2)
    orders = Orders(taylor, write)
    for k in range(int(taylor.progress.order) - 1):
        orders.put(k)
    write.end()
    return str(module)


@intrinsic
def call(typing, address, terms, response):
    """Call the function at an address with the data of two arrays."""

    def generate(context, builder, signature, arguments):
        kind = ir.FunctionType(ir.VoidType(), [DOUBLES, DOUBLES])
        data = [
            context.make_array(array)(context, builder, value).data
            for array, value in zip(signature.args[1:], arguments[1:], strict=True)
        ]
        builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), data)
        return context.get_dummy_value()

    return types.void(address, terms, response), generate
