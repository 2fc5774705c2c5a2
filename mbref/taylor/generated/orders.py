"""Machine code of the orders of a scene's series: the loop over them, and the products of series.

The orders are a short loop, so that its instructions are fetched once. The factors of each product are known
in advance, so that vectors are shuffled in registers. Products are added with fused multiply-add, as in the
kernels.  ``multiplier_orders``, ``driven_orders`` and ``power_orders`` find each order.
"""

from __future__ import annotations

import functools
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from llvmlite import ir

from mbref.taylor.generated.instructions import WHOLE, Instructions, Vectors, constant
from mbref.taylor.layout import TaylorMemory
from mbref.taylor.polynomial_layout import Products
from mbref.taylor.simd import WIDTH

Sums = dict[int, ir.Value]
"""Sums of products of a slot, by its place."""
Newest = dict[int, tuple[ir.Value, ...]]
"""The products of a slot with the newest factors, by its place."""
Term = tuple[int, int, float]
"""A product's factors and minus its weight."""
AT_ONCE = 8  # slots whose sums fit into the registers of a processor
ORDER_ARGUMENTS = 1  # number of integer arguments: the last order of multipliers


class Factors(NamedTuple):
    """Both factors of the products of a slot, from the coefficients of one order; the left factor includes
    the weight."""

    left: ir.Value
    right: ir.Value
    weighted: ir.Value


class Orders(ABC):
    """Code for the orders of a series from the first two orders; two successive orders share their factors.

    Factors of ``products``, and of further products that give ``slots``, are stored in ``left`` and
    ``right``.
    """

    def __init__(self, taylor: TaylorMemory, write: Instructions, products: Products, slots: int):
        self._taylor, self._write, self._products, self._slots = taylor, write, products, slots
        self._terms, self._response, self._left, self._right = write.pointers[:4]
        self._lanes = taylor.series.terms.shape[1]
        self._weights = products.weight.reshape(-1, WIDTH)
        (self._last,) = write.counts

    @abstractmethod
    def put(self) -> None:
        """Write all orders."""

    @abstractmethod
    def _order(
        self, k: ir.Value, row: Vectors, factors: dict[int, Factors], inner: Sums, is_second: bool = False
    ) -> Vectors:
        """Generate code for order k + 2 of the variables, from the coefficients of the previous order, their
        factors, and the sums of products of earlier orders; the second order of a pair lacks two more
        products."""

    def _factors(self, k: ir.Value, row: Vectors) -> dict[int, Factors]:
        """Return the factors of order k by the places of their slots, kept for later orders."""
        return self._factors_of_products(k, row)

    def _repeat(self, row: Vectors) -> None:
        """Generate code for all orders except the first, from the coefficients of the previous order."""
        write = self._write
        pairs, alone = write.halved(self._last)
        row = write.repeat(
            0, alone, row, lambda _, row: self._order(WHOLE(1), row, self._factors(WHOLE(1), row), {})
        )
        first = write.plus(alone, 1)
        write.repeat(
            0, pairs, row, lambda pair, row: self._pair(write.plus(write.multiplied(pair, 2), first), row)
        )

    def _pair(self, k: ir.Value, row: Vectors) -> Vectors:
        """Generate code for orders k and k + 1 from the coefficients of the previous order."""
        factors, following = self._factors(k, row), self._write.plus(k, 1)
        products, ahead = self._inner(k, factors)
        row = self._order(k, row, factors, products)
        return self._order(following, row, self._factors(following, row), ahead, is_second=True)

    # --- products -----------------------------------------------------------------------------------------
    def _factors_of_products(self, k: ir.Value, row: Vectors) -> dict[int, Factors]:
        """Return the factors of ``products`` at order k, stored for later orders."""
        write, products = self._write, self._products
        known: dict[tuple[int, ...], ir.Value] = {}
        place, factors = write.multiplied(k, self._slots), {}
        for c in range(0, products.weight.size, WIDTH):
            weight = self._weights[c // WIDTH]
            one, other = (
                tuple(np.where(weight, lanes[c : c + WIDTH], -1).tolist())
                for lanes in (products.left, products.right)
            )
            for lanes in {one, other} - known.keys():
                known[lanes] = write.gather(row, lanes)
            factors[c] = Factors(known[one], known[other], write.times(weight, known[one]))
            write.store([factors[c].weighted], self._left, write.plus(place, c))
            write.store([factors[c].right], self._right, write.plus(place, c))
        return factors

    def _inner(self, k: ir.Value, factors: dict[int, Factors]) -> tuple[Sums, Sums]:
        """Return for each slot the sums of products 1 … k - 1 with k - 1 … 1, and of 1 … k with k … 1."""
        write, products, ahead, slots = self._write, {}, {}, sorted(factors)
        for first in range(0, len(slots), AT_ONCE):
            group = slots[first : first + AT_ONCE]
            size, zero = len(group), constant([0.0] * WIDTH)
            begun = [zero] * (2 * size) + [factors[c].right for c in group]
            found = write.repeat(1, k, begun, functools.partial(self._multiply, k, group))
            for c, total, other, factor in zip(
                group, found[:size], found[size : 2 * size], found[2 * size :], strict=True
            ):
                products[c] = total
                ahead[c] = write.total([other, write.product(factors[c].weighted, factor)])
        return products, ahead

    def _multiply(self, k: ir.Value, group: Sequence[int], i: ir.Value, vectors: Vectors) -> Vectors:
        """Add the products with factor i to the sums of both orders.

        The last vectors are the other factors of the order ahead.
        """
        write, size = self._write, len(group)
        one, other = write.multiplied(i, self._slots), write.multiplied(write.less(k, i), self._slots)
        sums, ahead, factors = [], [], []
        for n, c in enumerate(group):
            left, right = write.vector(self._left, one, c), write.vector(self._right, other, c)
            sums.append(write.total([vectors[n], write.product(left, right)]))
            ahead.append(write.total([vectors[size + n], write.product(left, vectors[2 * size + n])]))
            factors.append(right)
        return [*sums, *ahead, *factors]


def terms_of_rows(taylor: TaylorMemory) -> list[list[Term]]:
    """Return the products of each row."""
    products, nz, nr = (
        taylor.polynomials.products,
        taylor.solver.pivot_columns.size,
        taylor.solver.pivot_rows.size,
    )
    terms: list[list[Term]] = [[] for _ in range(nr)]
    for vector, (start, end) in enumerate(zip(products.start[:-1], products.start[1:], strict=True)):
        for c in range(start, end):
            row = vector * WIDTH + (c - start) % WIDTH - nz
            if products.weight[c] and 0 <= row < nr:
                terms[row].append((int(products.left[c]), int(products.right[c]), -products.weight[c]))
    return terms
