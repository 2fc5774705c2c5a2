"""Machine code of the orders of a scene's series with multipliers: ``mbref.taylor.series`` for one scene."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from llvmlite import ir

from mbref.taylor.generated.instructions import WHOLE, Blocks, Instructions, constant
from mbref.taylor.generated.orders import Factors, Newest, Orders, Sums
from mbref.taylor.lanes import LANES
from mbref.taylor.layout import Products, TaylorMemory

POINTERS = 7  # terms, response, left, right, scale, growth, sums


class MultiplierOrders(Orders):
    """The orders of variables and multipliers, by the response to all equations."""

    def __init__(self, taylor: TaylorMemory, write: Instructions, products: Products | None = None):
        products = products or taylor.polynomials.products
        super().__init__(taylor, write, products, products.weight.size)
        self._scale, self._growth, self._sums = write.pointers[4:]
        solver, given = taylor.solver, taylor.polynomials.given
        self._equations = solver.order.size + solver.row.size
        self._functions = range(self._equations, self._equations + given.driver.size)
        self._blocks = range(self._lanes // LANES)
        self._first: dict[int, tuple[ir.Value, ir.Value]] = {}

    def put(self) -> None:
        """Write all orders of the variables and of the multipliers."""
        write, row = self._write, self._write.row(self._terms, self._lanes, self._lanes)
        factors = self._factors(WHOLE(0), row)
        products = {c: write.product(f.weighted, f.right) for c, f in factors.items()}
        row = self._solve(WHOLE(0), products, {}, self._taylor.polynomials.inertia.force)
        self._first = {
            c: (f.weighted, write.times(self._weights[c // LANES], f.right)) for c, f in factors.items()
        }
        self._repeat(row)

    def _order(
        self, k: ir.Value, row: Blocks, factors: dict[int, Factors], inner: Sums, is_second: bool = False
    ) -> Blocks:
        """Order k + 2 of the variables and order k of the multipliers."""
        write, newest = self._write, Newest()
        for c, (left, right) in self._first.items():
            newest[c] = write.product(left, factors[c].right), write.product(factors[c].left, right)
        return self._solve(k, inner, newest)

    def _solve(self, k: ir.Value, known: Sums, newest: Newest, force: np.ndarray | None = None) -> Blocks:
        """Order k + 2 of the terms, stored; the sums known before the newest products are added up first."""
        write, place, sums = self._write, self._write.multiplied(k, self._lanes), []
        for b in self._blocks:
            others = self._linear_forces(place, b)
            if force is not None:
                others.append(constant(-force[b * LANES : (b + 1) * LANES]))
            total = self._total(b, known, newest, others)
            sums.append(write.product(write.block(self._scale, place, b * LANES), total))
        return self._respond(place, sums)

    def _total(self, block: int, known: Sums, newest: Newest, others: Sequence[ir.Value] = ()) -> ir.Value:
        """The sum of a block's products and of others, the newest last."""
        write, start = self._write, self._products.start
        slots = range(start[block], start[block + 1], LANES)
        parts = [*(known[c] for c in slots if c in known), *others]
        parts = [write.total(parts)] if parts else []
        return write.total([*parts, *(product for c in slots if c in newest for product in newest[c])])

    def _linear_forces(self, place: ir.Value, block: int) -> list[ir.Value]:
        """Minus the forces that are linear in the variables."""
        write, inertia, parts = self._write, self._taylor.polynomials.inertia, []
        terms = [write.block(self._terms, place, b * LANES) for b in self._blocks]
        for slot in range(inertia.start[block], inertia.start[block + 1], LANES):
            weight = inertia.weight[slot : slot + LANES]
            if weight.any():
                lanes = np.where(weight, inertia.source[slot : slot + LANES], -1).tolist()
                parts.append(write.times(-weight, write.gathered(terms, lanes)))
        return parts

    def _respond(self, place: ir.Value, sums: Blocks) -> Blocks:
        """The row of terms two orders later, by the response to the sums and to functions prescribed."""
        write, ahead = self._write, self._write.plus(place, 2 * self._lanes)
        write.store(sums, self._sums, 0)
        numbers = [write.number(self._sums, e) for e in range(self._equations)]
        numbers += [write.number(self._terms, ahead, g) for g in self._functions]
        factors, row = [write.everywhere(number) for number in numbers], []
        for b in self._blocks:
            parts = [
                write.product(factor, write.block(self._response, e * self._lanes + b * LANES))
                for e, factor in enumerate(factors)
            ]
            row.append(write.product(write.block(self._growth, place, b * LANES), write.total(parts)))
        write.store(row, self._terms, ahead)
        return row
