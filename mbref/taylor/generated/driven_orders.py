"""Machine code for the orders of a driven scene's series, in which rows determine all variables.

Forces have no influence, and no multiplier is needed. Only products of rows remain; a row may use several
lanes, whose sums the response matrix adds.
"""

from __future__ import annotations

import numpy as np
from llvmlite import ir

from mbref.taylor.generated.instructions import Instructions, Vectors
from mbref.taylor.generated.multiplier_orders import MultiplierOrders
from mbref.taylor.generated.orders import Newest, Sums, Term, terms_of_rows
from mbref.taylor.layout import TaylorMemory
from mbref.taylor.polynomials import products_of_lanes
from mbref.taylor.simd import WIDTH, padded_size


class DrivenOrders(MultiplierOrders):
    """The orders of a series of a scene without freedom, from the first two, by the response."""

    def __init__(self, taylor: TaylorMemory, write: Instructions):
        self._nz = taylor.solver.pivot_columns.size
        lanes = _lanes_of(terms_of_rows(taylor))
        self._rows = [row for row, _ in lanes]
        unused: list[list[Term]] = [[]] * (padded_size(len(lanes)) - len(lanes))
        super().__init__(taylor, write, products_of_lanes([terms for _, terms in lanes] + unused))

    def _solve(self, k: ir.Value, known: Sums, newest: Newest, force: np.ndarray | None = None) -> Vectors:
        """Write order k + 2 of the variables and of the prescribed functions."""
        write, ahead = self._write, self._write.plus(self._write.multiplied(k, self._lanes), 2 * self._lanes)
        numbers = [write.everywhere(write.number(self._terms, ahead, g)) for g in self._functions]
        response = list(self._functions)
        for b, rows in enumerate(self._rows[i : i + WIDTH] for i in range(0, len(self._rows), WIDTH)):
            total = self._total(b, known, newest)
            numbers += [write.repeated([total], lane) for lane in range(len(rows))]
            response += [self._nz + row for row in rows]
        row = write.row(self._terms, ahead, self._lanes)
        for b in range(-(-self._nz // WIDTH)):
            parts = [
                write.product(number, write.vector(self._response, e * self._lanes + b * WIDTH))
                for number, e in zip(numbers, response, strict=True)
            ]
            row[b] = write.total(parts)
            write.store([row[b]], self._terms, write.plus(ahead, b * WIDTH))
        return row


def _lanes_of(terms: list[list[Term]]) -> list[tuple[int, list[Term]]]:
    """Return the row of each lane and its products, the longest first: unused lanes of a vector are given to
    the rows with the most products."""
    count = [1] * len(terms)
    for _ in range(WIDTH - len(terms) if terms else 0):
        count[max(range(len(terms)), key=lambda row: len(terms[row]) / count[row])] += 1
    lanes = [(row, terms[row][i :: count[row]]) for row in range(len(terms)) for i in range(count[row])]
    return sorted((lane for lane in lanes if lane[1]), key=lambda lane: -len(lane[1]))
