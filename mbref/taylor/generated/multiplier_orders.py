"""Machine code of the orders of a scene's series with multipliers: ``mbref.taylor.series`` for one scene."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from llvmlite import ir

from mbref.taylor.generated.instructions import WHOLE, Instructions, Vectors, constant
from mbref.taylor.generated.orders import Factors, Newest, Orders, Sums
from mbref.taylor.layout import TaylorMemory
from mbref.taylor.polynomial_layout import Products
from mbref.taylor.simd import WIDTH

POINTERS = 7  # terms, response, left, right, scale, growth, sums


class MultiplierOrders(Orders):
    """The orders of variables and multipliers, by the response to all equations."""

    def __init__(self, taylor: TaylorMemory, write: Instructions, products: Products | None = None):
        products = products or taylor.polynomials.products
        super().__init__(taylor, write, products, products.weight.size)
        self._scale, self._growth, self._sums = write.pointers[4:]
        solver, given = taylor.solver, taylor.polynomials.given
        self._equations = solver.pivot_columns.size + solver.pivot_rows.size
        self._functions = range(self._equations, self._equations + given.driver.size)
        self._vectors = range(self._lanes // WIDTH)
        self._first: dict[int, tuple[ir.Value, ir.Value]] = {}

    def put(self) -> None:
        """Write all orders of the variables and of the multipliers."""
        write, row = self._write, self._write.row(self._terms, self._lanes, self._lanes)
        factors = self._factors(WHOLE(0), row)
        products = {c: write.product(f.weighted, f.right) for c, f in factors.items()}
        row = self._solve(WHOLE(0), products, {}, self._taylor.polynomials.inertia.force)
        self._first = {
            c: (f.weighted, write.times(self._weights[c // WIDTH], f.right)) for c, f in factors.items()
        }
        self._repeat(row)

    def _order(
        self, k: ir.Value, row: Vectors, factors: dict[int, Factors], inner: Sums, is_second: bool = False
    ) -> Vectors:
        """Write order k + 2 of the variables and order k of the multipliers."""
        write, newest = self._write, Newest()
        for c, (left, right) in self._first.items():
            newest[c] = write.product(left, factors[c].right), write.product(factors[c].left, right)
        return self._solve(k, inner, newest)

    def _solve(self, k: ir.Value, known: Sums, newest: Newest, force: np.ndarray | None = None) -> Vectors:
        """Write order k + 2 of the terms; the newest products are added last."""
        write, place, sums = self._write, self._write.multiplied(k, self._lanes), []
        for b in self._vectors:
            others = self._linear_forces(place, b)
            if force is not None:
                others.append(constant(-force[b * WIDTH : (b + 1) * WIDTH]))
            total = self._total(b, known, newest, others)
            sums.append(write.product(write.vector(self._scale, place, b * WIDTH), total))
        return self._respond(place, sums)

    def _total(self, vector: int, known: Sums, newest: Newest, others: Sequence[ir.Value] = ()) -> ir.Value:
        """Return the sum of the products of a vector and of other vectors, the newest product last."""
        write, start = self._write, self._products.start
        slots = range(start[vector], start[vector + 1], WIDTH)
        parts = [*(known[c] for c in slots if c in known), *others]
        parts = [write.total(parts)] if parts else []
        return write.total([*parts, *(product for c in slots if c in newest for product in newest[c])])

    def _linear_forces(self, place: ir.Value, vector: int) -> list[ir.Value]:
        """Return minus the forces that are linear in the variables."""
        write, inertia, parts = self._write, self._taylor.polynomials.inertia, []
        terms = [write.vector(self._terms, place, b * WIDTH) for b in self._vectors]
        for slot in range(inertia.start[vector], inertia.start[vector + 1], WIDTH):
            weight = inertia.weight[slot : slot + WIDTH]
            if weight.any():
                lanes = np.where(weight, inertia.source[slot : slot + WIDTH], -1).tolist()
                parts.append(write.times(-weight, write.gather(terms, lanes)))
        return parts

    def _respond(self, place: ir.Value, sums: Vectors) -> Vectors:
        """Return the coefficients two orders later, by the response to the sums and to prescribed
        functions."""
        write, ahead = self._write, self._write.plus(place, 2 * self._lanes)
        write.store(sums, self._sums, 0)
        numbers = [write.number(self._sums, e) for e in range(self._equations)]
        numbers += [write.number(self._terms, ahead, g) for g in self._functions]
        factors, row = [write.everywhere(number) for number in numbers], []
        for b in self._vectors:
            parts = [
                write.product(factor, write.vector(self._response, e * self._lanes + b * WIDTH))
                for e, factor in enumerate(factors)
            ]
            row.append(write.product(write.vector(self._growth, place, b * WIDTH), write.total(parts)))
        write.store(row, self._terms, ahead)
        return row
