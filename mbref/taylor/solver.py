"""The linear system of each order: M z + Gᵀ λ = f, G z = b, reduced to the motions that the rows allow.

All variables are z = N b + T u of the independent ones u.  N and T come from one exchange of rows and
dependent variables in a tableau of G (R. A. Wehage and E. J. Haug, J. Mech. Design 104, 1982), u from the
reduced mass matrix Tᵀ M T: a mass matrix that is singular but for the motions that the rows allow does no
harm.  Rows that depend on others have no multiplier.
"""

from __future__ import annotations

from mbref.kernels.compilation import inlined, kernel
from mbref.kernels.layout import OK, SINGULAR
from mbref.taylor.lanes import LANES, load, store
from mbref.taylor.partition import choose

KEPT = 0.5  # a pivot over its first below which rows and variables are chosen again
WITHOUT_INERTIA = 1e-13  # of the largest inertia of a variable


@inlined
def exchange(memory):
    """Exchange the independent rows of G, at the first coefficients, and their dependent variables.

    Behind it a row of the tableau tells its dependent variable: by the right-hand sides of rows, in the lanes
    of their variables, and by minus the independent variables.
    """
    solver, rows, terms = memory.solver, memory.polynomials.rows, memory.series.terms
    tableau, place = solver.tableau.reshape(-1), solver.place
    for j in range(0, tableau.shape[0], LANES):
        store(load(solver.linear, j), tableau, j)
    for e in range(place.shape[0]):
        tableau[place[e]] += rows.weight[e] * terms[0, rows.other[e]]
    for k in range(memory.progress.rank):
        r, c = solver.row[k], solver.order[k]
        solver.last[k] = solver.tableau[r, c]
        exchange_one(r, c, memory.progress.rank, solver)


@inlined
def multiply_row(matrix, i, factor):
    """Multiply row i of a matrix by a factor."""
    lanes = matrix.shape[1]
    for j in range(i * lanes, (i + 1) * lanes, LANES):
        store(factor * load(matrix, j), matrix, j)


@inlined
def subtract_multiple(matrix, i, factor, k):
    """Subtract row k of a matrix, times a factor, from row i."""
    lanes = matrix.shape[1]
    for j in range(0, lanes, LANES):
        left = load(matrix, i * lanes + j) - factor * load(matrix, k * lanes + j)
        store(left, matrix, i * lanes + j)


@inlined
def exchange_one(r, c, rank, solver):
    """Exchange a row of the tableau and a variable: the row over its pivot, then none of it in the others.

    Their entries in the variable's lane become minus themselves over the pivot: e - e (1 + 1 / pivot).
    """
    tableau = solver.tableau
    factor = 1.0 / tableau[r, c]
    tableau[r, c] += 1.0
    multiply_row(tableau, r, factor)
    for k in range(rank):
        i = solver.row[k]
        entry = tableau[i, c]
        if i != r and entry != 0.0:
            subtract_multiple(tableau, i, entry, r)
    tableau[r, c] = factor


@inlined
def spread(memory):
    """N in the rows of the dependent variables' response and Tᵀ in those of the independent ones."""
    solver, rank, response = memory.solver, memory.progress.rank, memory.solver.response
    tableau, nz, lanes = solver.tableau, solver.order.shape[0], solver.response.shape[1]
    zero = 0.0 * load(solver.linear, 0)
    for place in range(0, (nz + solver.row.shape[0]) * lanes, LANES):
        store(zero, response, place)
    for k in range(rank):
        r, i = solver.row[k], solver.order[k]
        for p in range(rank):
            response[i, nz + solver.row[p]] = tableau[r, solver.order[p]]
        for p in range(rank, nz):
            response[solver.order[p], i] = -tableau[r, solver.order[p]]
    for p in range(rank, nz):
        response[solver.order[p], solver.order[p]] = 1.0


@inlined
def reduce_inertia(memory):
    """Tᵀ M T in ``reduced``, in lanes of variables, and -Tᵀ M N beside Tᵀ in the rows of the response."""
    solver, mass, rank = memory.solver, memory.polynomials.inertia.mass, memory.progress.rank
    reduced, wide = solver.reduced, mass.shape[1]
    for q in range(rank, solver.order.shape[0]):
        i = solver.order[q]
        for j in range(0, wide, LANES):
            pushed = load(mass, i * wide + j)
            for k in range(rank):
                pushed = pushed - solver.tableau[solver.row[k], i] * load(mass, solver.order[k] * wide + j)
            store(pushed, reduced, i * wide + j)
        reduce_row(i, memory)


@inlined
def reduce_row(i, memory):
    """Subtract the dependent variables' share from a row of Tᵀ M, and put it into the response."""
    solver, rank, wide = memory.solver, memory.progress.rank, memory.solver.reduced.shape[1]
    reduced, change, nz = solver.reduced, solver.change, solver.order.shape[0]
    for j in range(0, wide, LANES):
        shared = 0.0 * load(reduced, i * wide + j)
        for k in range(rank):
            shared = shared + reduced[i, solver.order[k]] * load(solver.tableau, solver.row[k] * wide + j)
        store(shared, change, j)
    for k in range(rank):
        solver.response[i, nz + solver.row[k]] = -change[solver.order[k]]
    for j in range(0, wide, LANES):
        store(load(reduced, i * wide + j) - load(change, j), reduced, i * wide + j)


@inlined
def solve_reduced(memory):
    """The response of the independent variables, by Gauss–Jordan elimination of the reduced mass matrix."""
    solver, rank = memory.solver, memory.progress.rank
    reduced, response, nz = solver.reduced, solver.response, solver.order.shape[0]
    for p in range(rank, nz):
        c = solver.order[p]
        solver.last[p] = reduced[c, c]
        factor = 1.0 / reduced[c, c]
        multiply_row(response, c, factor)
        multiply_row(reduced, c, factor)
        for q in range(rank, nz):
            i = solver.order[q]
            entry = reduced[i, c]
            if i != c and entry != 0.0:
                subtract_multiple(response, i, entry, c)
                subtract_multiple(reduced, i, entry, c)


@inlined
def put_dependent(memory):
    """The response of the dependent variables: N, and T of the independent ones'."""
    solver, rank, nz = memory.solver, memory.progress.rank, memory.solver.order.shape[0]
    response, tableau, lanes = solver.response, solver.tableau, solver.response.shape[1]
    for k in range(rank):
        r, i = solver.row[k], solver.order[k]
        for j in range(0, lanes, LANES):
            total = load(response, i * lanes + j)
            for q in range(rank, nz):
                total = total - tableau[r, solver.order[q]] * load(response, solver.order[q] * lanes + j)
            store(total, response, i * lanes + j)


@inlined
def put_multipliers(memory):
    """The response of the multipliers: Nᵀ of the forces that the dependent variables' motion leaves."""
    solver, rank, nz = memory.solver, memory.progress.rank, memory.solver.order.shape[0]
    response, forces, lanes = solver.response, solver.forces, solver.response.shape[1]
    for k in range(rank):
        put_force(k, solver.order[k], memory)
    for p in range(rank):
        e = nz + solver.row[p]
        for j in range(0, lanes, LANES):
            total = load(response, e * lanes + j)
            for k in range(rank):
                total = total + solver.tableau[solver.row[k], solver.order[p]] * load(forces, k * lanes + j)
            store(total, response, e * lanes + j)


@inlined
def put_force(k, i, memory):
    """The force left at a variable: the one on the right-hand side minus that of its inertia."""
    solver, mass, lanes = memory.solver, memory.polynomials.inertia.mass, memory.solver.response.shape[1]
    for j in range(0, lanes, LANES):
        left = 0.0 * load(mass, 0)
        for other in range(solver.order.shape[0]):
            if mass[i, other] != 0.0:
                left = left - mass[i, other] * load(solver.response, other * lanes + j)
        store(left, solver.forces, k * lanes + j)
    solver.forces[k, i] += 1.0


@inlined
def is_sharp(solver):
    """Whether all pivots are nearly as large as when they were chosen."""
    for k in range(solver.first.shape[0]):  # noqa: SIM110 - no generators in kernels
        if not abs(solver.last[k]) > KEPT * solver.first[k]:
            return False
    return True


@kernel
def eliminate_all(memory):
    """The exchange of rows and dependent variables, and the response of the independent ones."""
    exchange(memory)
    spread(memory)
    reduce_inertia(memory)
    solve_reduced(memory)


@kernel
def factorise(memory):
    """The response at the first coefficients; SINGULAR where rows or inertia have another rank."""
    memory.run.equations.system.counts.factorisations += 1
    eliminate_all(memory)
    if not is_sharp(memory.solver):
        if choose(memory) != memory.progress.rank:
            return SINGULAR
        factorise_anew(memory)
    put_response(memory)
    return inertia_left(memory)


@kernel
def factorise_anew(memory):
    """The pivots of a partition that has just been chosen, and the response of its independent variables."""
    solver = memory.solver
    eliminate_all(memory)
    for k in range(solver.first.shape[0]):
        solver.first[k] = abs(solver.last[k])


@inlined
def inertia_left(memory):
    """SINGULAR where a motion that the rows allow has no inertia."""
    solver, mass, largest = memory.solver, memory.polynomials.inertia.mass, 0.0
    for i in range(mass.shape[0]):
        largest = max(largest, mass[i, i])
    for k in range(memory.progress.rank, mass.shape[0]):
        if not solver.first[k] > WITHOUT_INERTIA * largest:
            return SINGULAR
    return OK


@inlined
def put_response(memory):
    """The response of all variables and multipliers, and to the functions prescribed."""
    functions = memory.polynomials.given.driver.shape[0]
    if memory.progress.rank == memory.solver.order.shape[0]:
        put_inverse(memory)
    else:
        put_dependent(memory)
        put_multipliers(memory)
    if functions > 0:
        add_functions(functions, memory)


@inlined
def put_inverse(memory):
    """The response of the variables to rows that determine all of them, so that no force moves any."""
    solver, rank, nz = memory.solver, memory.progress.rank, memory.solver.order.shape[0]
    for p in range(rank):
        e, c = nz + solver.row[p], solver.order[p]
        for k in range(rank):
            solver.response[e, solver.order[k]] = solver.tableau[solver.row[k], c]


@kernel
def add_functions(functions, memory):
    """The response to functions prescribed: what rows that depend on them take, and themselves."""
    solver, rows, terms = memory.solver, memory.polynomials.rows, memory.series.terms
    response, n = solver.response, solver.order.shape[0] + solver.row.shape[0]
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
    if lane >= nz + solver.row.shape[0]:
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
