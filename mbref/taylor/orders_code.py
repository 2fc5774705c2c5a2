"""Machine code of the orders of a scene's series: ``mbref.taylor.series`` for one scene.

The orders are a loop of few instructions, so that code fetched once serves all of them.  The numbers that
meet in a product are known, so that blocks are shuffled in registers.  A sum may take a product in before it
is rounded, as in the kernels.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from llvmlite import ir

from mbref.taylor import layout
from mbref.taylor.instructions import WHOLE, Blocks, Instructions, constant
from mbref.taylor.lanes import LANES
from mbref.taylor.layout import TaylorMemory

Products = dict[int, ir.Value]
"""Sums of products of a slot, by its place."""
AT_ONCE = 8  # slots whose sums a processor keeps in its registers
POINTERS = 7  # terms, response, left, right, scale, growth, sums
COUNTS = 1  # the last order of multipliers


class Factors(NamedTuple):
    """Both factors of a slot's products that a row of terms gives, and the left one times the weight."""

    left: ir.Value
    right: ir.Value
    weighted: ir.Value


class Orders:
    """The orders of a series from the first two, by the response; two at a time share their factors."""

    def __init__(self, taylor: TaylorMemory, write: Instructions, products: layout.Products | None = None):
        products = products or taylor.polynomials.products
        self._taylor, self._write, self._products = taylor, write, products
        solver, given = taylor.solver, taylor.polynomials.given
        self._equations = solver.order.size + solver.row.size
        self._functions = range(self._equations, self._equations + given.driver.size)
        self._lanes, self._slots = taylor.series.terms.shape[1], products.weight.size
        self._blocks = range(self._lanes // LANES)
        self._weights = products.weight.reshape(-1, LANES)
        self._first: dict[int, tuple[ir.Value, ir.Value]] = {}
        (self._terms, self._response, self._left, self._right, self._scale, self._growth,
         self._sums) = write.pointers  # fmt: skip
        (self._last,) = write.counts

    def put(self) -> None:
        """Write all orders of the variables and of the multipliers."""
        write, row = self._write, self._write.row(self._terms, self._lanes, self._lanes)
        factors = self._factors(WHOLE(0), row)
        products = {c: write.product(f.weighted, f.right) for c, f in factors.items()}
        row = self._solve(WHOLE(0), products, {}, self._taylor.polynomials.inertia.force)
        self._first = {
            c: (f.weighted, write.times(self._weights[c // LANES], f.right)) for c, f in factors.items()
        }
        pairs, alone = write.halved(self._last)
        row = write.repeat(
            0, alone, row, lambda _, row: self._order(WHOLE(1), self._factors(WHOLE(1), row), {})
        )
        first = write.plus(alone, 1)
        write.repeat(
            0, pairs, row, lambda pair, row: self._pair(write.plus(write.multiplied(pair, 2), first), row)
        )

    def _pair(self, k: ir.Value, row: Blocks) -> Blocks:
        """Orders k and k + 1, from the row of terms before."""
        factors, following = self._factors(k, row), self._write.plus(k, 1)
        products, ahead = self._inner(k, factors)
        row = self._order(k, factors, products)
        return self._order(following, self._factors(following, row), ahead)

    def _order(self, k: ir.Value, factors: dict[int, Factors], inner: Products) -> Blocks:
        """Order k + 2 of the variables and order k of the multipliers."""
        write, newest = self._write, {}
        for c, (left, right) in self._first.items():
            newest[c] = write.product(left, factors[c].right), write.product(factors[c].left, right)
        return self._solve(k, inner, newest)

    # --- products -----------------------------------------------------------------------------------------
    def _factors(self, k: ir.Value, row: Blocks) -> dict[int, Factors]:
        """The factors of order k by the places of their slots, kept for later orders."""
        write, products, known = self._write, self._products, {}
        place, factors = write.multiplied(k, self._slots), {}
        for c in range(0, self._slots, LANES):
            weight = self._weights[c // LANES]
            one, other = (
                tuple(np.where(weight, lanes[c : c + LANES], -1).tolist())
                for lanes in (products.left, products.right)
            )
            for lanes in {one, other} - known.keys():
                known[lanes] = write.gathered(row, lanes)
            factors[c] = Factors(known[one], known[other], write.times(weight, known[one]))
            write.store([factors[c].weighted], self._left, write.plus(place, c))
            write.store([factors[c].right], self._right, write.plus(place, c))
        return factors

    def _inner(self, k: ir.Value, factors: dict[int, Factors]) -> tuple[Products, Products]:
        """Of each slot the products of factors 1 … k - 1 with k - 1 … 1, and of 1 … k with k … 1."""
        write, products, ahead, slots = self._write, {}, {}, sorted(factors)
        for first in range(0, len(slots), AT_ONCE):
            group = slots[first : first + AT_ONCE]
            size, zero = len(group), constant([0.0] * LANES)
            begun = [zero] * (2 * size) + [factors[c].right for c in group]
            found = write.repeat(1, k, begun, functools.partial(self._multiply, k, group))
            for c, total, other, factor in zip(
                group, found[:size], found[size : 2 * size], found[2 * size :], strict=True
            ):
                products[c] = total
                ahead[c] = write.total([other, write.product(factors[c].weighted, factor)])
        return products, ahead

    def _multiply(self, k: ir.Value, group: Sequence[int], i: ir.Value, blocks: Blocks) -> Blocks:
        """Add the products with factor i to the sums of both orders; the last blocks are the other factors of
        the order ahead."""
        write, size = self._write, len(group)
        one, other = write.multiplied(i, self._slots), write.multiplied(write.less(k, i), self._slots)
        sums, ahead, factors = [], [], []
        for n, c in enumerate(group):
            left, right = write.block(self._left, one, c), write.block(self._right, other, c)
            sums.append(write.total([blocks[n], write.product(left, right)]))
            ahead.append(write.total([blocks[size + n], write.product(left, blocks[2 * size + n])]))
            factors.append(right)
        return [*sums, *ahead, *factors]

    # --- the linear system --------------------------------------------------------------------------------
    def _solve(
        self,
        k: ir.Value,
        known: Products,
        newest: dict[int, tuple[ir.Value, ...]],
        force: np.ndarray | None = None,
    ) -> Blocks:
        """Order k + 2 of the terms, stored; the sums known before the newest products are added up first."""
        write, place, sums = self._write, self._write.multiplied(k, self._lanes), []
        for b in self._blocks:
            others = self._linear_forces(place, b)
            if force is not None:
                others.append(constant(-force[b * LANES : (b + 1) * LANES]))
            total = self._total(b, known, newest, others)
            sums.append(write.product(write.block(self._scale, place, b * LANES), total))
        return self._respond(place, sums)

    def _total(
        self,
        block: int,
        known: Products,
        newest: dict[int, tuple[ir.Value, ...]],
        others: Blocks | None = None,
    ) -> ir.Value:
        """The sum of a block's products and of others, the newest last."""
        write, start = self._write, self._products.start
        slots = range(start[block], start[block + 1], LANES)
        parts = [known[c] for c in slots if c in known] + (others or [])
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
