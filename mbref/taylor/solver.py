"""The linear system of each order: M z + Gᵀ λ = f, G z = b, by the inverse of its matrix K.

Independent rows, and a dependent variable for each, come from complete pivoting of G.  The pivots of K are
then G's, once in its rows and once in those of the dependent variables, and the reduced mass matrix's in
those of the others (R. A. Wehage and E. J. Haug, J. Mech. Design 104, 1982): a mass matrix that is singular
but for the motions that the rows allow does no harm.  Rows that depend on others have no multiplier.
"""

from __future__ import annotations

from mbref.kernels.compilation import inlined, kernel
from mbref.kernels.layout import OK, SINGULAR
from mbref.taylor.lanes import LANES, add_multiple, sum_multiples

KEPT = 0.05  # a pivot over its first below which rows and variables are chosen again
WITHOUT_INERTIA = 1e-13  # of the largest inertia of a variable


@kernel
def put_gradient(memory):
    """G at the first coefficients into ``work``; rows are of length one about, or zero in all positions."""
    rows, work, y = memory.polynomials.rows, memory.solver.work, memory.series.terms
    work[:] = 0.0
    for e in range(rows.linear_row.shape[0]):
        if rows.linear_lane[e] < work.shape[1]:
            work[rows.linear_row[e], rows.linear_lane[e]] += rows.linear_weight[e]
    for e in range(rows.row.shape[0]):
        if rows.lane[e] < work.shape[1]:
            work[rows.row[e], rows.lane[e]] += rows.weight[e] * y[0, rows.other[e]]


@kernel
def largest_entry(work, row, order, k):
    """The largest entry among the rows and columns from k on, and its places."""
    best, at_row, at_column = -1.0, k, k
    for p in range(k, row.shape[0]):
        for q in range(k, order.shape[0]):
            size = abs(work[row[p], order[q]])
            if size > best:
                best, at_row, at_column = size, p, q
    return best, at_row, at_column


@kernel
def eliminate(work, row, order, k):
    """Subtract the pivot row k from those after it."""
    for p in range(k + 1, row.shape[0]):
        factor = work[row[p], order[k]] / work[row[k], order[k]]
        if factor != 0.0:
            for q in range(k, order.shape[0]):
                work[row[p], order[q]] -= factor * work[row[k], order[q]]


@kernel
def choose(memory):
    """Choose independent rows and dependent variables by complete pivoting; how many there are."""
    solver, tolerance = memory.solver, memory.run.equations.system.settings.rank_tolerance
    row, order, work, rank = solver.row, solver.order, solver.work, 0
    put_gradient(memory)
    for k in range(row.shape[0]):
        row[k] = k
    for k in range(order.shape[0]):
        order[k] = k
    while rank < min(row.shape[0], order.shape[0]):
        size, p, q = largest_entry(work, row, order, rank)
        if size <= tolerance:
            break
        row[rank], row[p] = row[p], row[rank]
        order[rank], order[q] = order[q], order[rank]
        eliminate(work, row, order, rank)
        rank += 1
    pair(rank, memory)
    return rank


@kernel
def pair(rank, memory):
    """Partners and order of the pivots, and the constant part of K."""
    solver, rows, mass = memory.solver, memory.polynomials.rows, memory.polynomials.inertia.mass
    nz, nr = solver.order.shape[0], solver.row.shape[0]
    for k in range(nz + nr):
        solver.partner[k] = k
    for k in range(rank):
        solver.partner[nz + solver.row[k]], solver.partner[solver.order[k]] = (
            solver.order[k],
            nz + solver.row[k],
        )
        solver.pivot[k], solver.pivot[rank + k] = nz + solver.row[k], solver.order[k]
    for k in range(rank, nz):
        solver.pivot[rank + k] = solver.order[k]
    for k in range(rank, nr):
        solver.pivot[nz + k] = nz + solver.row[k]
    for c in range(nz + nr):
        e = memory.polynomials.products.equation[c]
        solver.place[c], solver.of_force[c] = solver.partner[e], 1.0 if e < nz else 0.0
        solver.of_row[c] = 1.0 if e >= nz and solver.partner[e] != e else 0.0
    solver.base[:] = 0.0
    for i in range(nz):
        for j in range(nz):
            solver.base[i, solver.partner[j]] = mass[i, j]
    for e in range(rows.linear_row.shape[0]):
        put_row(solver.base, rows.linear_row[e], rows.linear_lane[e], rows.linear_weight[e], rank, solver)
    for k in range(rank, nr):
        solver.base[nz + solver.row[k], nz + solver.row[k]] = 1.0


@inlined
def put_row(matrix, row, lane, value, rank, solver):
    """Add to an entry of G, in both places of K, where the row is an independent one."""
    nz = solver.order.shape[0]
    equation = nz + row
    if lane < nz and solver.partner[equation] != equation:
        matrix[equation, solver.partner[lane]] += value
        matrix[lane, solver.partner[equation]] += value


@inlined
def invert(solver, n, first):
    """The inverse of K in place of it (Gauss–Jordan); the least pivot of G over the first."""
    a, lanes, sharpness = solver.inverse, solver.inverse.shape[1], 1e300
    for step in range(n):
        k = solver.pivot[step]
        pivot = a[k, k]
        if first:
            solver.first[step] = abs(pivot)
        sharpness = min(sharpness, abs(pivot) / solver.first[step])
        factor = 1.0 / pivot
        a[k, k] = 1.0
        for j in range(lanes):
            a[k, j] *= factor
        for i in range(n):
            value = a[i, k]
            if i != k and value != 0.0:
                a[i, k] = 0.0
                for j in range(0, lanes, LANES):
                    add_multiple(-value, a, k * lanes + j, a, i * lanes + j)
    return sharpness


@inlined
def assemble(memory):
    """K at the first coefficients."""
    solver, rows, y = memory.solver, memory.polynomials.rows, memory.series.terms
    a, base, rank = solver.inverse, solver.base, memory.progress.rank
    for i in range(base.shape[0]):
        for j in range(base.shape[1]):
            a[i, j] = base[i, j]
    for e in range(rows.row.shape[0]):
        put_row(a, rows.row[e], rows.lane[e], rows.weight[e] * y[0, rows.other[e]], rank, solver)


@kernel
def factorise(memory):
    """The inverse of K at the first coefficients; SINGULAR where rows or inertia have another rank."""
    solver, progress = memory.solver, memory.progress
    n = solver.partner.shape[0]
    memory.run.equations.system.counts.factorisations += 1
    assemble(memory)
    if not invert(solver, n, False) > KEPT:
        if choose(memory) != progress.rank:
            return SINGULAR
        assemble(memory)
        invert(solver, n, True)
    return inertia_left(memory)


@inlined
def inertia_left(memory):
    """SINGULAR where a motion that the rows allow has no inertia."""
    solver, mass, largest = memory.solver, memory.polynomials.inertia.mass, 0.0
    rank, nz = memory.progress.rank, solver.order.shape[0]
    for i in range(nz):
        largest = max(largest, mass[i, i])
    for k in range(2 * rank, rank + nz):
        if not solver.first[k] > WITHOUT_INERTIA * largest:
            return SINGULAR
    return OK


@inlined
def add_functions(memory):
    """Rows of the inverse for the functions prescribed: what they take from rows, and themselves."""
    solver, rows, y = memory.solver, memory.polynomials.rows, memory.series.terms
    n, a = solver.partner.shape[0], solver.inverse
    nz, lanes = solver.order.shape[0], a.shape[1]
    for g in range(a.shape[0] - n):
        for j in range(lanes):
            a[n + g, j] = 0.0
    for e in range(rows.linear_row.shape[0]):
        subtract_row(rows.linear_row[e], rows.linear_lane[e], rows.linear_weight[e], nz, n, solver)
    for e in range(rows.row.shape[0]):
        subtract_row(rows.row[e], rows.lane[e], rows.weight[e] * y[0, rows.other[e]], nz, n, solver)
    for g in range(a.shape[0] - n):
        a[n + g, n + g] = 1.0


@inlined
def subtract_row(row, lane, value, nz, n, solver):
    """Of a row's dependence on a function: what it takes away from the right-hand side."""
    a, place = solver.inverse, solver.partner[nz + row]
    lanes = a.shape[1]
    if lane >= n and place != nz + row:
        for j in range(0, lanes, LANES):
            add_multiple(-value, a, place * lanes + j, a, lane * lanes + j)


@inlined
def solve(solver, count, out, start):
    """out[start …] (lanes) := the solution of the right-hand side's first ``count`` numbers."""
    a = solver.inverse
    for j in range(0, a.shape[1], LANES):
        sum_multiples(a, j, a.shape[1], solver.rhs, 0, count, out, start + j)


@inlined
def set_rows(values, solver):
    """The right-hand side: no forces, and minus the values (nr,) of rows that are independent."""
    solver.rhs[:] = 0.0
    nz = solver.order.shape[0]
    for r in range(values.shape[0]):
        if solver.partner[nz + r] != nz + r:
            solver.rhs[solver.partner[nz + r]] = -values[r]
