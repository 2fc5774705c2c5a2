"""Machine code for the orders of a series with one degree of freedom and no drivers, without multipliers.

The rows allow one motion, along the velocity v: the power of inertia and forces along it vanishes, v · w = 0
with w = M a - Q (P.  E.  B.  Jourdain, Quart.  J.  Pure Appl.  Math. 40, 1909).  The power equation and the
rows give each order without multipliers, which take most of the products in ``multiplier_orders``.  In Taylor
coefficients, with v_k = (k + 1) z_{k+1} and w_k = (k + 1) (k + 2) M z_{k+2} - Q_k,

    (k + 1) (k + 2) v_0 · M z_{k+2} = v_0 · Q_k - Σ_{i=1…k} v_i · w_{k-i},
    z_{k+2} = B z_{k+1} - R s_k + v_0 (v_0 · M z_{k+2}) / (v_0 · M v_0),

where R is the response to rows, s_k sums the products in Φ of z_2 … z_k, and B = -R G' with the rate of G:
so few operations separate one order from the next. At rest and at turning points the velocity does not
determine the motion, and the orders with multipliers are used.
"""

from __future__ import annotations

import numpy as np
from llvmlite import ir

from mbref.taylor.generated.instructions import WHOLE, Instructions, Vectors, constant, levels
from mbref.taylor.generated.orders import Factors, Orders, Sums, Term, terms_of_rows
from mbref.taylor.layout import TaylorMemory
from mbref.taylor.polynomial_layout import Inertia
from mbref.taylor.polynomials import products_of_lanes
from mbref.taylor.simd import WIDTH, padded_size

POINTERS = 5  # terms, response, left, right, sums
ZERO, HALF = constant([0.0] * WIDTH), constant([0.5] * WIDTH)


def serves(taylor: TaylorMemory) -> bool:
    """Return whether a scene has one degree of freedom and no drivers, and needs no more products by power
    than with multipliers."""
    if taylor.options.start_freedoms != 1 or taylor.polynomials.given.driver.size:
        return False
    products, nz, nr = (
        taylor.polynomials.products,
        taylor.solver.pivot_columns.size,
        taylor.solver.pivot_rows.size,
    )
    vectors = np.split(products.weight, products.start[1:-1])
    counts = np.concatenate([np.count_nonzero(vector.reshape(-1, WIDTH), axis=0) for vector in vectors])
    of_rows = np.maximum.reduceat(counts[nz : nz + nr], np.arange(0, nr, WIDTH)).sum() * WIDTH
    return bool(of_rows + padded_size(nz) <= products.weight.size)


def moments_of(inertia: Inertia, nz: int) -> np.ndarray:
    """Return the matrix (nz, nz) of the forces that are linear in the variables."""
    matrix = np.zeros((nz, nz))
    for vector in range(padded_size(nz) // WIDTH):
        for c in range(inertia.start[vector], inertia.start[vector + 1]):
            if inertia.weight[c]:
                matrix[vector * WIDTH + c % WIDTH, inertia.source[c]] += inertia.weight[c]
    return matrix


class PowerOrders(Orders):
    """The orders of the variables, by the response to rows and the motion's power.

    The factors of power are v_k on the left and w_k on the right.
    """

    def __init__(self, taylor: TaylorMemory, write: Instructions):
        self._nr, self._nz = taylor.solver.pivot_rows.size, taylor.solver.pivot_columns.size
        unused: list[list[Term]] = [[]] * (padded_size(self._nr) - self._nr)
        products = products_of_lanes([*terms_of_rows(taylor), *unused])
        self._power = range(products.weight.size, products.weight.size + padded_size(self._nz), WIDTH)
        super().__init__(taylor, write, products, self._power.stop)
        self._sums = write.pointers[4]
        self._vectors = range(padded_size(self._nz) // WIDTH)
        inertia = taylor.polynomials.inertia
        self._mass, self._moments = inertia.mass[:, : self._nz], moments_of(inertia, self._nz)
        self._has_moments = bool(self._moments.any())
        self._force = [constant(inertia.force[b * WIDTH : (b + 1) * WIDTH]) for b in self._vectors]

    def put(self) -> None:
        """Write all orders, and v · Q / (v · M v), the rate at which the speed grows, into the sums."""
        write, start, velocity = self._write, self._row(WHOLE(0)), self._row(WHOLE(1))
        force = self._plus(self._force, self._times(self._moments, start))
        power = self._inner_product(velocity, force)
        energy = self._inner_product(velocity, self._times(self._mass, velocity))
        inverse = write.everywhere(write.inverse(write.first(energy)))
        self._share = self._scaled(inverse, velocity)
        self._turning = self._turning_by(velocity)
        row = self._put(WHOLE(0), self._scaled(HALF, self._turned(velocity)), power, HALF)
        rate = self._plus(row, row)
        self._inertia_of_rate = self._times(self._mass, rate)
        self._lost_force = list(map(write.difference, self._inertia_of_rate, force))
        self._velocity_moments, self._rate_moments = (
            self._times(self._moments.T, along) for along in (velocity, rate)
        )
        self._repeat(row)
        write.store([write.product(power, inverse)], self._sums, 0)

    def _order(
        self, k: ir.Value, row: Vectors, factors: dict[int, Factors], inner: Sums, is_second: bool = False
    ) -> Vectors:
        """Write order k + 2: v_k · w_0 is not yet in the power sums, nor v_1 · w_{k-1} of a second order."""
        write, one = self._write, real_vector(self._write, k, 1)
        newest = self._scaled(one, self._lost_force)
        known = [write.minus(inner[c]) for c in self._power if c in inner]
        known += self._power_of_moments(self._velocity_moments, k)
        if is_second:
            both = write.product(one, real_vector(write, k, 0))
            newest = self._plus(newest, self._scaled(both, self._inertia_of_rate))
            known += self._power_of_moments(self._rate_moments, write.less(k, WHOLE(1)))
        lost = (write.minus(write.product(n, z)) for n, z in zip(newest, row, strict=True))
        power = write.summed(write.total([write.total(known), *lost]))
        turned = self._turned(row)
        if inner:
            turned = self._plus(self._response_to(inner), turned)
        return self._put(k, turned, power, self._inverse_of_growth(k))

    # --- power --------------------------------------------------------------------------------------------
    def _factors(self, k: ir.Value, row: Vectors) -> dict[int, Factors]:
        """Return the factors of the products of rows and of the power, v_k and w_{k-1}, at order k."""
        write, before = self._write, self._write.less(k, WHOLE(1))
        factors, one = self._factors_of_products(k, row), real_vector(self._write, k, 1)
        force = self._scaled(write.product(one, real_vector(write, k, 0)), self._times(self._mass, row))
        if self._has_moments:
            force = list(map(write.difference, force, self._times(self._moments, self._row(before))))
        for c, velocity, lost in zip(self._power, self._scaled(one, row), force, strict=True):
            write.store([velocity], self._left, write.plus(write.multiplied(k, self._slots), c))
            write.store([lost], self._right, write.plus(write.multiplied(before, self._slots), c))
            factors[c] = Factors(velocity, ZERO, velocity)
        return factors

    def _power_of_moments(self, along: Vectors, k: ir.Value) -> Vectors:
        """Return the power of the moments of order k along the velocity or its rate, times their matrix."""
        if not self._has_moments:
            return []
        return [self._write.product(one, other) for one, other in zip(along, self._row(k), strict=True)]

    def _inverse_of_growth(self, k: ir.Value) -> ir.Value:
        """Return 1 / ((k + 1) (k + 2))."""
        write = self._write
        growth = write.product(real_vector(write, k, 1), real_vector(write, k, 2))
        return write.everywhere(write.inverse(write.first(growth)))

    # --- rows ---------------------------------------------------------------------------------------------
    def _turning_by(self, velocity: Vectors) -> list[Vectors]:
        """Return B, the response to the rate of G: a row of vectors for each variable."""
        write, rows = self._write, self._taylor.polynomials.rows
        numbers = [write.repeated(velocity, i) for i in range(self._nz)]
        turning = []
        for i in range(self._nz):
            entries = np.flatnonzero(rows.lane == i)
            rates = [write.times(np.full(WIDTH, -rows.weight[e]), numbers[rows.other[e]]) for e in entries]
            turning.append(
                [
                    self._combined(rates, [self._of_row(int(rows.row[e]), b) for e in entries])
                    for b in self._vectors
                ]
            )
        return turning

    def _turned(self, row: Vectors) -> Vectors:
        """Return the matrix B (the response to the rate of G) times a row of Taylor coefficients."""
        numbers = [self._write.repeated(row, i) for i in range(self._nz)]
        return [self._combined(numbers, [vectors[b] for vectors in self._turning]) for b in self._vectors]

    def _response_to(self, products: Sums) -> Vectors:
        """Return the response to minus sums of products of rows."""
        write, start, sums = self._write, self._products.start, []
        for b in range(start.size - 1):
            parts = [products[c] for c in range(start[b], start[b + 1], WIDTH)]
            sums.append(write.total(parts))
        write.store(sums, self._sums, 0)
        numbers = [write.everywhere(write.number(self._sums, e)) for e in range(self._nr)]
        return [self._combined(numbers, [self._of_row(e, b) for e in range(self._nr)]) for b in self._vectors]

    def _of_row(self, e: int, b: int) -> ir.Value:
        """Return a vector of the response to row e."""
        return self._write.vector(self._response, (self._nz + e) * self._lanes + b * WIDTH)

    def _put(self, k: ir.Value, row: Vectors, power: ir.Value, factor: ir.Value) -> Vectors:
        """Write order k + 2: a row plus the motion that the power, times a factor, adds."""
        write = self._write
        moved = (write.product(power, share) for share in self._scaled(factor, self._share))
        row = [write.total(pair) for pair in zip(row, moved, strict=True)]
        write.store(row, self._terms, write.multiplied(write.plus(k, 2), self._lanes))
        return row

    # --- vectors of variables ------------------------------------------------------------------------------
    def _row(self, k: ir.Value) -> Vectors:
        """Return order k of the variables."""
        place = self._write.multiplied(k, self._lanes)
        return self._write.row(self._terms, place, padded_size(self._nz))

    def _times(self, matrix: np.ndarray, row: Vectors) -> Vectors:
        """Return a matrix (nz, nz) of numbers known times a row."""
        write, vectors = self._write, []
        for b in self._vectors:
            lines = matrix[b * WIDTH : (b + 1) * WIDTH]
            terms = [[(line[i], int(i)) for i in np.flatnonzero(line)] for line in lines]
            parts = [write.times(weights, write.gather(row, lanes)) for weights, lanes in levels(terms)]
            vectors.append(write.total(parts))
        return vectors

    def _scaled(self, factor: ir.Value, row: Vectors) -> Vectors:
        return [self._write.product(factor, vector) for vector in row]

    def _plus(self, one: Vectors, other: Vectors) -> Vectors:
        return [self._write.total(pair) for pair in zip(one, other, strict=True)]

    def _combined(self, factors: Vectors, vectors: Vectors) -> ir.Value:
        """Return the sum of the products of factors and vectors."""
        return self._write.total(list(map(self._write.product, factors, vectors)))

    def _inner_product(self, one: Vectors, other: Vectors) -> ir.Value:
        """Return a vector of the inner product of two rows."""
        return self._write.summed(self._combined(one, other))


def real_vector(write: Instructions, k: ir.Value, more: int) -> ir.Value:
    """Return a vector of the number k + more."""
    return write.everywhere(write.real(write.plus(k, more)))
