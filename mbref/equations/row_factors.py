"""Factors of constraint rows at many states: independent rows, in units, determine dependent displacements.

The rows that a partition selects have unit length in units S of displacements. Their columns of the dependent
displacements are D, a sparse matrix, and their columns of the independent displacements are C.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from mbref.kernels.compilation import INT, entry
from mbref.kernels.named_memory import Indices, Matrix, Named, Vector
from mbref.linear_algebra.ordered_lu import (
    LuPattern,
    factorise_in_order,
    solve_in_order,
    solve_transposed_in_order,
)


class RowPartition(NamedTuple):
    """Independent constraint rows (r,), the dependent displacements (r,) that they determine, both in the
    order of elimination, and independent displacements (f,); places of D and C in the rows' entries."""

    rows: Annotated[Indices, "r"]
    dependent: Annotated[Indices, "r"]
    independent: Annotated[Indices, "free"]
    entry: Annotated[Indices, "dependent_entries"]  # of D in the entries (m width,) of all rows
    place: Annotated[Indices, "dependent_entries"]  # of these entries among the factors
    free_entry: Annotated[Indices, "free_entries"]  # of C in the entries of all rows, by columns
    free_row: Annotated[Indices, "free_entries"]  # of these entries among the r rows
    free_start: Annotated[Indices, "free + 1"]  # of the columns of C
    lu: LuPattern


class FactorMemory(NamedTuple):
    """Entries of unit rows at k states, and what follows from them: the factors of D, the bases N of the
    freedoms with Φ_q S N = 0, and the products of D⁻¹ with given vectors."""

    partition: RowPartition
    entries: Annotated[Matrix, "k", "entries"]
    probes: Annotated[Matrix, "probes", "r"]
    factors: Annotated[Matrix, "k", "factors"]
    basis: Annotated[Matrix, "k*n", "free"]
    probed: Annotated[Matrix, "k*probes", "r"]
    part: Annotated[Vector, "r"]


class SolveMemory(NamedTuple):
    """Factors at k states, and right-hand sides (c each), which become solutions."""

    lu: LuPattern
    factors: Annotated[Matrix, "k", "factors"]
    found: Annotated[Matrix, "k*c", "r"]


@entry(INT(Named(FactorMemory)))
def factorise_rows(memory):
    """Compute factors, bases and products at all states; return k."""
    partition, factors, basis, part = memory.partition, memory.factors, memory.basis, memory.part
    count, freedoms, size = factors.shape[0], partition.independent.shape[0], part.shape[0]
    n = size + freedoms
    for k in range(count):
        for e in range(partition.entry.shape[0]):
            factors[k, partition.place[e]] = memory.entries[k, partition.entry[e]]
        factorise_in_order(factors[k], part, partition.lu)
        for c in range(freedoms):
            part[:] = 0.0
            for e in range(partition.free_start[c], partition.free_start[c + 1]):
                part[partition.free_row[e]] -= memory.entries[k, partition.free_entry[e]]
            solve_in_order(factors[k], part, partition.lu)
            for i in range(size):
                basis[n * k + partition.dependent[i], c] = part[i]
            basis[n * k + partition.independent[c], c] = 1.0
        for p in range(memory.probes.shape[0]):
            found = memory.probed[memory.probes.shape[0] * k + p]
            for i in range(size):
                found[i] = memory.probes[p, i]
            solve_in_order(factors[k], found, partition.lu)
    return count


@entry(INT(INT, Named(SolveMemory)))
def solve_rows(transposed, memory):
    """Solve with D, or with Dᵀ, at all states; return k."""
    count = memory.factors.shape[0]
    columns = memory.found.shape[0] // max(1, count)
    for place in range(memory.found.shape[0]):
        factors, found = memory.factors[place // columns], memory.found[place]
        if transposed == 1:
            solve_transposed_in_order(factors, found, memory.lu)
        else:
            solve_in_order(factors, found, memory.lu)
    return count
