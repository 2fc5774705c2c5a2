"""Machine code of a scene's corrections: ``mbref.taylor.correction`` for one scene, without loops."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from llvmlite import ir

from mbref.taylor.generated.instructions import Instructions, Vectors, constant, levels
from mbref.taylor.layout import TaylorMemory
from mbref.taylor.simd import WIDTH

POINTERS = {"violation": 2, "close": 4, "close_rate": 4}  # terms, phi; response, change


class Correction:
    """Code for the violations of the rows, and for the least changes of variables and rates that remove
    them."""

    def __init__(self, taylor: TaylorMemory, write: Instructions):
        self._taylor, self._write = taylor, write
        self._nz, nr = taylor.solver.pivot_columns.size, taylor.solver.pivot_rows.size
        self._lanes = taylor.series.terms.shape[1]
        self._of_variables = range(-(-self._nz // WIDTH))  # vectors
        self._of_rows = range(self._nz // WIDTH, -(-(self._nz + nr) // WIDTH))
        self._rows = range(self._nz, self._nz + nr)
        self._terms, self._phi = write.pointers[:2]

    def violation(self) -> None:
        """Generate code for Φ of all rows at the variables."""
        terms = self._write.row(self._terms, 0, self._lanes)
        constants = self._taylor.polynomials.rows.constant
        for b in self._of_rows:
            parts = [constant(self._masked(b, constants[b * WIDTH : (b + 1) * WIDTH]))]
            for weights, left, right in self._products(b):
                one = self._write.times(weights, self._write.gather(terms, left))
                parts.append(self._write.product(one, self._write.gather(terms, right)))
            parts += self._linear(b, terms)
            self._write.store([self._write.total(parts)], self._phi, b * WIDTH)

    def close(self) -> None:
        """Generate code that changes the variables so that Φ vanishes."""
        self._subtract(0)

    def close_rate(self) -> None:
        """Generate code that changes the rates so that Φ' vanishes."""
        terms, rates = (self._write.row(self._terms, k * self._lanes, self._lanes) for k in (0, 1))
        for b in self._of_rows:
            parts = []
            for weights, left, right in self._products(b):
                for one, other in ((terms, rates), (rates, terms)):
                    factor = self._write.times(weights, self._write.gather(one, left))
                    parts.append(self._write.product(factor, self._write.gather(other, right)))
            parts += self._linear(b, rates)
            self._write.store([self._write.total(parts)], self._phi, b * WIDTH)
        self._subtract(1)

    def _subtract(self, order: int) -> None:
        write, (response, change) = self._write, self._write.pointers[2:]
        factors = [write.minus(write.everywhere(write.number(self._phi, e))) for e in self._rows]
        for b in self._of_variables:
            parts = [
                write.product(factor, write.vector(response, e * self._lanes + b * WIDTH))
                for e, factor in zip(self._rows, factors, strict=True)
            ]
            variables = [float(lane < self._nz) for lane in range(b * WIDTH, (b + 1) * WIDTH)]
            total = write.times(np.array(variables), write.total(parts))
            place = order * self._lanes + b * WIDTH
            write.store([write.total([write.vector(self._terms, place), total])], self._terms, place)
            write.store([total], change, b * WIDTH)

    def _products(self, vector: int) -> Iterator[tuple[np.ndarray, list[int], list[int]]]:
        """Yield weights and lanes of both factors of the products in a vector of rows."""
        products = self._taylor.polynomials.products
        for c in range(products.start[vector], products.start[vector + 1], WIDTH):
            weights = self._masked(vector, products.weight[c : c + WIDTH])
            if weights.any():
                left, right = (
                    np.where(weights, lanes[c : c + WIDTH], -1).tolist()
                    for lanes in (products.left, products.right)
                )
                yield weights, left, right

    def _linear(self, vector: int, row: Vectors) -> list[ir.Value]:
        """Return the linear terms in a vector of rows, one term of each row at a time."""
        rows = self._taylor.polynomials.rows
        places = (np.flatnonzero(rows.linear_row + self._nz == lane) for lane in self._lanes_of(vector))
        terms = [[(rows.linear_weight[e], int(rows.linear_lane[e])) for e in of_row] for of_row in places]
        return [
            self._write.times(weights, self._write.gather(row, lanes)) for weights, lanes in levels(terms)
        ]

    def _masked(self, vector: int, numbers: np.ndarray) -> np.ndarray:
        """Return numbers of a vector, with zero in lanes without a row."""
        return np.where([lane in self._rows for lane in self._lanes_of(vector)], numbers, 0.0)

    def _lanes_of(self, vector: int) -> range:
        return range(vector * WIDTH, (vector + 1) * WIDTH)
