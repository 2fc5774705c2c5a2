"""Machine code of a scene's linear system: ``mbref.taylor.solver`` for one scene, without loops.

Rows and dependent variables are chosen at run time and read from memory during the elimination; after it all
positions are known when the code is generated. The mass matrix and the rows' coefficients are constants of
the code.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from llvmlite import ir

from mbref.taylor.generated.instructions import Instructions, Vectors, constant, levels
from mbref.taylor.layout import TaylorMemory
from mbref.taylor.simd import WIDTH

IrRow = dict[int, ir.Value]
"""The vectors of a row that are not known to be zero, by their number."""
POINTERS = 6, 2  # terms, tableau, particular, null_space, response, last; row, order


class ResponseCode:
    """Code for the response matrix at the first coefficients, for a given rank of the rows."""

    def __init__(self, taylor: TaylorMemory, rank: int, write: Instructions):
        self._taylor, self._write = taylor, write
        self._rank, self._nz = rank, taylor.solver.pivot_columns.size
        self._nr, self._lanes = taylor.solver.pivot_rows.size, taylor.series.terms.shape[1]
        self._of_variables = range(-(-self._nz // WIDTH))  # vectors
        self._of_rows = range(self._nz // WIDTH, -(-(self._nz + self._nr) // WIDTH))
        (self._terms, self._tableau, self._particular, self._null_space, self._response, self._last,
         row, order) = write.pointers  # fmt: skip
        self._rows = [write.multiplied(write.number(row, k), self._lanes) for k in range(self._rank)]
        self._columns = [write.number(order, k) for k in range(self._nz)]

    def put(self) -> None:
        """Write the pivots and the response."""
        for r in range(self._nr):
            self._write.store(self._gradient(r), self._tableau, r * self._lanes)
        for k in range(self._rank):
            self._eliminate(k)
        self._split()
        if self._rank == self._nz:
            self._put_inverse()
        else:
            self._put_response()

    # --- N and T ------------------------------------------------------------------------------------------
    def _gradient(self, r: int) -> Vectors:
        """Return row r of [G 1]."""
        linear, variables = self._taylor.solver.linear[r], self._write.row(self._terms, 0, self._lanes)
        vectors = []
        for vector in range(self._lanes // WIDTH):
            parts = [constant(linear[vector * WIDTH : (vector + 1) * WIDTH])]
            for weights, lanes in self._levels(r, vector):
                parts.append(self._write.times(weights, self._write.gather(variables, lanes)))
            vectors.append(self._write.total(parts))
        return vectors

    def _levels(self, r: int, vector: int) -> Iterator[tuple[np.ndarray, list[int]]]:
        """Return weights and lanes of the products in a vector of row r, of each variable one at a time."""
        rows, variables = (
            self._taylor.polynomials.rows,
            range(vector * WIDTH, min((vector + 1) * WIDTH, self._nz)),
        )
        places = (np.flatnonzero((rows.row == r) & (rows.lane == variable)) for variable in variables)
        return levels([[(rows.weight[e], int(rows.other[e])) for e in of_one] for of_one in places])

    def _eliminate(self, k: int) -> None:
        """Eliminate the k-th dependent variable from all other rows, first from the next pivot row."""
        write, column = self._write, self._columns[k]
        pivot = write.number(self._tableau, self._rows[k], column)
        write.put(pivot, self._last, k)
        factor = write.everywhere(write.inverse(pivot))
        row = [
            write.product(factor, vector) for vector in write.row(self._tableau, self._rows[k], self._lanes)
        ]
        write.store(row, self._tableau, self._rows[k])
        for p in [*range(k + 1, self._rank), *range(k)]:
            entry = write.everywhere(write.number(self._tableau, self._rows[p], column))
            others = write.row(self._tableau, self._rows[p], self._lanes)
            left = [
                write.difference(other, write.product(entry, vector))
                for other, vector in zip(others, row, strict=True)
            ]
            write.store(left, self._tableau, self._rows[p])

    def _split(self) -> None:
        """Generate code that stores N (row by row) and T (number by number) in memory, in the order of the
        variables.

        All variables are z = N b + T u with the right-hand sides b of the rows and the independent variables
        u.
        """
        write, free = self._write, self._columns[self._rank :]
        for k, column in enumerate(self._columns[: self._rank]):
            place = write.multiplied(column, self._lanes)
            for vector in self._of_rows:
                (eliminated,) = write.row(self._tableau, write.plus(self._rows[k], vector * WIDTH), WIDTH)
                kept = [float(lane >= self._nz) for lane in range(vector * WIDTH, (vector + 1) * WIDTH)]
                eliminated = write.times(np.array(kept), eliminated)
                write.store([eliminated], self._particular, write.plus(place, vector * WIDTH))
            for f, other in enumerate(free):
                entry = write.number(self._tableau, self._rows[k], other)
                write.put(write.minus(entry), self._null_space, f * self._lanes, column)
        zero = constant([0.0] * WIDTH)
        for f, column in enumerate(free):
            place = write.multiplied(column, self._lanes)
            for vector in self._of_rows:
                write.store([zero], self._particular, write.plus(place, vector * WIDTH))
            for g, other in enumerate(free):
                write.put(ir.DoubleType()(float(f == g)), self._null_space, f * self._lanes, other)

    # --- the response -------------------------------------------------------------------------------------
    def _put_response(self) -> None:
        particular = [self._row(self._particular, i, self._of_rows) for i in range(self._nz)]
        free = self._free_motions(particular)
        rows = []
        for i in range(self._nz):
            row = particular[i]
            for f, motion in enumerate(free):
                share = self._write.everywhere(self._write.number(self._null_space, f * self._lanes + i))
                row = self._sum(row, self._times(share, motion))
            rows.append(row)
        forces = [self._force(i, rows) for i in range(self._nz)]
        for i, row in enumerate(rows):
            self._store(row, i)
        self._put_rows(forces)

    def _put_inverse(self) -> None:
        """Generate code for the response of rows that determine all variables: forces have no influence, and
        no multiplier is needed."""
        for i in range(self._nz):
            self._store({}, i)
        self._put_rows([self._one(i) for i in range(self._nz)])

    def _put_rows(self, forces: list[IrRow]) -> None:
        """Write the response to rows: Nᵀ of the forces that are left at the variables."""
        for e in range(self._nz, self._nz + self._nr):
            parts = [
                self._times(
                    self._write.everywhere(self._write.number(self._particular, i * self._lanes + e)), force
                )
                for i, force in enumerate(forces)
            ]
            self._store(self._sum(*parts), e)

    def _free_motions(self, particular: list[IrRow]) -> list[IrRow]:
        """Return the response of the independent variables, by the reduced mass matrix."""
        motions, momenta = self._motions_and_momenta()
        rest = [self._without_rows(p, motion, particular) for p, motion in zip(momenta, motions, strict=True)]
        return self._reduced(motions, momenta, rest)

    def _motions_and_momenta(self) -> tuple[list[IrRow], list[IrRow]]:
        """Return T and M T, a row for each independent variable."""
        free = range(self._nz - self._rank)
        motions = [self._row(self._null_space, f, self._of_variables) for f in free]
        return motions, [self._momentum(f, motion) for f, motion in enumerate(motions)]

    def _reduced(self, motions: list[IrRow], momenta: list[IrRow], solved: list[IrRow]) -> list[IrRow]:
        """Generate code that solves right-hand sides by the reduced mass matrix, and stores its pivots."""
        free = range(len(motions))
        reduced = [[self._inner(momenta[f], motions[g]) for g in free] for f in free]
        solved = list(solved)
        for f in free:
            self._write.put(reduced[f][f], self._last, self._rank + f)
            factor = self._write.inverse(reduced[f][f])
            solved[f] = self._times(self._write.everywhere(factor), solved[f])
            reduced[f] = [self._write.product(factor, number) for number in reduced[f]]
            for g in free:
                if g != f:
                    entry = self._write.minus(reduced[g][f])
                    solved[g] = self._sum(solved[g], self._times(self._write.everywhere(entry), solved[f]))
                    reduced[g] = [
                        self._write.total([number, self._write.product(entry, other)])
                        for number, other in zip(reduced[g], reduced[f], strict=True)
                    ]
        return solved

    def _momentum(self, f: int, motion: IrRow) -> IrRow:
        """Return M times a motion, whose variables are also in memory."""
        mass = self._taylor.polynomials.inertia.mass
        row = {}
        for vector in self._of_variables:
            lanes = slice(vector * WIDTH, (vector + 1) * WIDTH)
            diagonal = np.zeros(WIDTH)
            own = mass[lanes, lanes].diagonal()
            diagonal[: own.size] = own
            parts = [self._write.times(diagonal, motion[vector])]
            for i in range(self._nz):
                coupled = mass[i, lanes].copy()
                if i // WIDTH == vector:
                    coupled[i % WIDTH] = 0.0
                if coupled.any():
                    number = self._write.number(self._null_space, f * self._lanes + i)
                    parts.append(self._write.times(coupled, self._write.everywhere(number)))
            row[vector] = self._write.total(parts)
        return row

    def _inner(self, momentum: IrRow, motion: IrRow) -> ir.Value:
        parts = [self._write.product(momentum[vector], motion[vector]) for vector in self._of_variables]
        return self._write.first(self._write.summed(self._write.total(parts)))

    def _without_rows(self, momentum: IrRow, motion: IrRow, particular: list[IrRow]) -> IrRow:
        """Return a motion in the lanes of variables, and minus its momentum times N in the lanes of
        multipliers."""
        vectors = [momentum[vector] for vector in self._of_variables]
        parts = [
            self._times(self._write.minus(self._write.repeated(vectors, i)), row)
            for i, row in enumerate(particular)
        ]
        return self._sum(motion, *parts)

    def _force(self, i: int, rows: list[IrRow]) -> IrRow:
        """Return the force that the inertia of all other variables leaves at a variable."""
        mass = self._taylor.polynomials.inertia.mass[i]
        parts = [self._times(constant([-mass[j]] * WIDTH), rows[j]) for j in np.flatnonzero(mass[: self._nz])]
        return self._sum(self._one(i), *parts)

    def _one(self, i: int) -> IrRow:
        """Return a one in the lane of a variable."""
        return {i // WIDTH: constant([float(lane == i % WIDTH) for lane in range(WIDTH)])}

    # --- rows ---------------------------------------------------------------------------------------------
    def _row(self, pointer: ir.Value, k: int, vectors: range) -> IrRow:
        return {
            vector: self._write.row(pointer, k * self._lanes + vector * WIDTH, WIDTH)[0] for vector in vectors
        }

    def _times(self, factor: ir.Value, row: IrRow) -> IrRow:
        return {vector: self._write.product(factor, value) for vector, value in row.items()}

    def _sum(self, *rows: IrRow) -> IrRow:
        vectors = sorted(set().union(*rows))
        return {
            vector: self._write.total([row[vector] for row in rows if vector in row]) for vector in vectors
        }

    def _store(self, row: IrRow, k: int) -> None:
        zero = constant([0.0] * WIDTH)
        vectors = [row.get(vector, zero) for vector in range(self._lanes // WIDTH)]
        self._write.store(vectors, self._response, k * self._lanes)


class RowResponseCode(ResponseCode):
    """The response of the variables to rows alone."""

    def _put_response(self) -> None:
        """Write the response by the forces that no motion takes."""
        motions, momenta = self._motions_and_momenta()
        solved, forces = self._reduced(motions, momenta, motions), []
        for i in range(self._nz):
            taken = [
                self._times(self._write.minus(self._write.repeated(list(momentum.values()), i)), motion)
                for momentum, motion in zip(momenta, solved, strict=True)
            ]
            forces.append(self._sum(self._one(i), *taken))
        self._put_rows(forces)
