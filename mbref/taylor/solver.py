"""The linear system of each order: M z + Gᵀ λ = f, G z = b, by the inverse of its matrix K.

Independent rows, and a dependent variable for each, come from complete pivoting of G.  The pivots of K are
then G's, once in its rows and once in those of the dependent variables, and the reduced mass matrix's in
those of the others (R. A. Wehage and E. J. Haug, J. Mech. Design 104, 1982): a mass matrix that is singular
but for the motions that the rows allow does no harm.  Rows that depend on others have no multiplier.
"""

from __future__ import annotations

from mbref.kernels.compilation import inlined, kernel
from mbref.kernels.layout import OK, SINGULAR
from mbref.taylor.lanes import LANES, load, placed, store

KEPT = 0.05  # a pivot over its first below which rows and variables are chosen again
WITHOUT_INERTIA = 1e-13  # of the largest inertia of a variable


@kernel
def put_gradient(y, memory):
    """G at variables y[0] into ``work``; rows are of length one about, or zero in all positions."""
    rows, work = memory.polynomials.rows, memory.solver.work
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
    put_gradient(memory.series.terms, memory)
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
    memory.progress.choice += 1
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
    solver.base[:] = 0.0
    for i in range(nz):
        for j in range(nz):
            solver.base[i, solver.partner[j]] = mass[i, j]
    for k in range(rank, nr):
        solver.base[nz + solver.row[k], nz + solver.row[k]] = 1.0
    base = solver.base.reshape(-1)
    for e in range(rows.linear_row.shape[0]):
        for place in places_in_matrix(rows.linear_row[e], rows.linear_lane[e], solver):
            base[place] += rows.linear_weight[e]
    for e in range(rows.row.shape[0]):
        solver.place[2 * e], solver.place[2 * e + 1] = places_in_matrix(rows.row[e], rows.lane[e], solver)


@inlined
def places_in_matrix(row, lane, solver):
    """Where an entry of G stands in K, and where one of Gᵀ does; in the last row for those left out."""
    nz, lanes = solver.order.shape[0], solver.base.shape[1]
    equation = nz + row
    if lane < nz and solver.partner[equation] != equation:
        return equation * lanes + solver.partner[lane], lane * lanes + solver.partner[equation]
    outside = solver.partner.shape[0] * lanes
    return outside, outside


@inlined
def assemble(memory):
    """K at the first coefficients."""
    solver, rows, terms = memory.solver, memory.polynomials.rows, memory.series.terms
    a, place = solver.inverse.reshape(-1), solver.place
    for j in range(0, a.shape[0], LANES):
        store(load(solver.base, j), a, j)
    for e in range(rows.row.shape[0]):
        value = rows.weight[e] * terms[0, rows.other[e]]
        a[place[2 * e]] += value
        a[place[2 * e + 1]] += value


@inlined
def invert(solver, first):
    """The inverse of K in place of it (Gauss–Jordan); whether all pivots are as large as the first."""
    sharp = True
    for step in range(solver.pivot.shape[0]):
        k = solver.pivot[step]
        pivot = solver.inverse[k, k]
        solver.last[step] = pivot
        if first:
            solver.first[step] = abs(pivot)
        sharp = sharp and abs(pivot) > KEPT * solver.first[step]
        eliminate_column(k, 1.0 / pivot, solver)
    return sharp


@inlined
def eliminate_column(k, factor, solver):
    """Column k of a becomes the k-th unit vector's, which then gives way to the inverse's."""
    a, column, lanes = solver.inverse, solver.column, solver.inverse.shape[1]
    for i in range(column.shape[0]):
        column[i] = a[i, k]
    for j in range(0, lanes, LANES):
        row = factor * placed(1.0, k - j, load(a, k * lanes + j))
        for i in range(column.shape[0]):
            store(placed(0.0, k - j, load(a, i * lanes + j)) - column[i] * row, a, i * lanes + j)
        store(row, a, k * lanes + j)


@kernel
def factorise(memory):
    """The response at the first coefficients; SINGULAR where rows or inertia have another rank."""
    solver, progress = memory.solver, memory.progress
    memory.run.equations.system.counts.factorisations += 1
    assemble(memory)
    if not invert(solver, False):
        if choose(memory) != progress.rank:
            return SINGULAR
        factorise_anew(memory)
    put_response(memory)
    return inertia_left(memory)


@kernel
def factorise_anew(memory):
    """The inverse of K by a partition that has just been chosen."""
    assemble(memory)
    invert(memory.solver, True)


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
def put_response(memory):
    """The rows of the inverse in the order of the equations, and those of the functions prescribed."""
    solver, functions = memory.solver, memory.polynomials.given.driver.shape[0]
    a, response, nz = solver.inverse, solver.response, solver.order.shape[0]
    n, lanes = solver.partner.shape[0], response.shape[1]
    for e in range(n):
        source = solver.partner[e]
        kept = 0.0 if e >= nz and source == e else 1.0
        for j in range(0, lanes, LANES):
            store(kept * load(a, source * lanes + j), response, e * lanes + j)
    if functions > 0:
        add_functions(functions, memory)


@kernel
def add_functions(functions, memory):
    """The response to functions prescribed: what rows that depend on them take, and themselves."""
    solver, rows, terms = memory.solver, memory.polynomials.rows, memory.series.terms
    response, n = solver.response, solver.partner.shape[0]
    for g in range(n, n + functions):
        for j in range(response.shape[1]):
            response[g, j] = 0.0
    for e in range(rows.linear_row.shape[0]):
        subtract_row(rows.linear_row[e], rows.linear_lane[e], rows.linear_weight[e], solver)
    for e in range(rows.row.shape[0]):
        value = rows.weight[e] * terms[0, rows.other[e]]
        subtract_row(rows.row[e], rows.lane[e], value, solver)
    for g in range(n, n + functions):
        response[g, g] = 1.0


@inlined
def subtract_row(row, lane, value, solver):
    """Of a row's dependence on a function: what it takes away from the right-hand side."""
    response, lanes, nz = solver.response, solver.response.shape[1], solver.order.shape[0]
    if lane >= solver.partner.shape[0]:
        for j in range(0, lanes, LANES):
            more = value * load(response, (nz + row) * lanes + j)
            store(load(response, lane * lanes + j) - more, response, lane * lanes + j)


@inlined
def solution(solver, j):
    """The block from lane j on of the solution of the right-hand side."""
    response, rhs, lanes = solver.response, solver.rhs, solver.response.shape[1]
    a, b = rhs[0] * load(response, j), rhs[1] * load(response, lanes + j)
    c, d = rhs[2] * load(response, 2 * lanes + j), rhs[3] * load(response, 3 * lanes + j)
    for e in range(4, lanes, 4):
        a = a + rhs[e] * load(response, e * lanes + j)
        b = b + rhs[e + 1] * load(response, (e + 1) * lanes + j)
        c = c + rhs[e + 2] * load(response, (e + 2) * lanes + j)
        d = d + rhs[e + 3] * load(response, (e + 3) * lanes + j)
    return (a + b) + (c + d)
