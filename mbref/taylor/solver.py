"""The linear system of each order: M z + Gᵀ λ = f, G z = b, reduced to the motions that the rows allow.

All variables are z = N b + T u with the independent variables u.  N and T come from Gauss–Jordan elimination
of the tableau [G 1] by rows and dependent variables (R. A. Wehage and E. J. Haug, J. Mech. Design 104, 1982),
u from the reduced mass matrix Tᵀ M T, which is regular where each motion that the rows allow has inertia.
Rows that depend on other rows have no multiplier. The inverse is symmetric.
"""

from __future__ import annotations

from mbref.kernels.compilation import exchangeable, inlined, kernel
from mbref.kernels.layout import OK, SINGULAR
from mbref.taylor.generated_calls import factorise_by_code
from mbref.taylor.layout import RESPOND
from mbref.taylor.partition import put_rows, save_replaced_pivot
from mbref.taylor.simd import WIDTH, load, store

MIN_PIVOT_KEPT = 0.5  # pivot / first pivot below which rows and variables are selected again
WITHOUT_INERTIA = 1e-13  # inertia / largest inertia: smaller inertias count as zero


@inlined
def exchange(memory):
    """Eliminate the dependent variables of the independent rows (Gauss–Jordan).

    Afterwards a row of the tableau has N in the lanes of multipliers and -T in the lanes of independent
    variables.
    """
    solver, rank = memory.solver, memory.partition.rank
    tableau, rows, columns, last = solver.tableau, solver.pivot_rows, solver.pivot_columns, solver.last
    put_rows(memory)
    for k in range(rank):
        r, c = rows[k], columns[k]
        last[k] = tableau[r, c]
        multiply_row(tableau, r, inverse_or_zero(last[k]))
        for p in range(rank):
            i = rows[p]
            entry = tableau[i, c]
            if i != r and entry != 0.0:
                subtract_multiple(tableau, i, entry, r)


@inlined
def inverse_or_zero(pivot):
    """Return 1 / pivot, or 0 for a zero pivot, after which rows and variables are selected again."""
    return 1.0 / pivot if pivot != 0.0 else 0.0


@inlined
def multiply_row(matrix, i, factor):
    """Multiply row i of a matrix by a factor."""
    lanes = matrix.shape[1]
    for j in range(i * lanes, (i + 1) * lanes, WIDTH):
        store(factor * load(matrix, j), matrix, j)


@inlined
def subtract_multiple(matrix, i, factor, k):
    """Subtract row k of a matrix, times a factor, from row i."""
    lanes = matrix.shape[1]
    for j in range(0, lanes, WIDTH):
        left = load(matrix, i * lanes + j) - factor * load(matrix, k * lanes + j)
        store(left, matrix, i * lanes + j)


@inlined
def split(memory):
    """Put N in rows of all variables, and T in rows of the independent variables, from the tableau."""
    solver, rank, variable = memory.solver, memory.partition.rank, memory.series.variable
    tableau, rows, columns = solver.tableau, solver.pivot_rows, solver.pivot_columns
    lanes = tableau.shape[1]
    particular, null_space = solver.particular, solver.null_space
    for k in range(rank):
        for j in range(0, lanes, WIDTH):
            eliminated = load(tableau, rows[k] * lanes + j)
            store(eliminated - load(variable, j) * eliminated, particular, columns[k] * lanes + j)
        for q in range(rank, columns.shape[0]):
            null_space[q - rank, columns[k]] = -tableau[rows[k], columns[q]]
    for q in range(rank, columns.shape[0]):
        for j in range(0, lanes, WIDTH):
            store(0.0 * load(variable, j), particular, columns[q] * lanes + j)
        for p in range(rank, columns.shape[0]):
            null_space[q - rank, columns[p]] = 1.0 if p == q else 0.0


@inlined
def reduce_inertia(memory):
    """Compute Tᵀ M T, and put Tᵀ - Tᵀ M N into the rows of the independent variables in the response."""
    solver, mass, rank = memory.solver, memory.polynomials.inertia.mass, memory.partition.rank
    null_space, momentum, columns = solver.null_space, solver.momentum, solver.pivot_columns
    nz = columns.shape[0]
    for f in range(nz - rank):
        put_combination(f, null_space, mass, nz, momentum)
        for g in range(nz - rank):
            total = 0.0
            for i in range(nz):
                total += momentum[f, i] * null_space[g, i]
            solver.reduced[f, g] = total
        put_free_motion(f, columns[rank + f], nz, solver)


@inlined
def put_combination(f, factors, matrix, rows, out):
    """Compute the combination of the rows of a matrix by the factors in row f, into row f of ``out``."""
    lanes = matrix.shape[1]
    for j in range(0, lanes, WIDTH):
        total = factors[f, 0] * load(matrix, j)
        for i in range(1, rows):
            total = total + factors[f, i] * load(matrix, i * lanes + j)
        store(total, out, f * lanes + j)


@inlined
def put_free_motion(f, variable, nz, solver):
    """Put row f of Tᵀ - Tᵀ M N into the response of its independent variable."""
    null_space, particular, momentum, response = (
        solver.null_space, solver.particular, solver.momentum, solver.response,
    )  # fmt: skip
    lanes = response.shape[1]
    for j in range(0, lanes, WIDTH):
        total = load(null_space, f * lanes + j)
        for i in range(nz):
            total = total - momentum[f, i] * load(particular, i * lanes + j)
        store(total, response, variable * lanes + j)


@inlined
def solve_reduced(memory):
    """Compute the response of the independent variables, by Gauss–Jordan elimination of the reduced mass
    matrix."""
    solver, rank = memory.solver, memory.partition.rank
    reduced, response, columns, last = solver.reduced, solver.response, solver.pivot_columns, solver.last
    for f in range(columns.shape[0] - rank):
        last[rank + f] = reduced[f, f]
        factor = inverse_or_zero(reduced[f, f])
        multiply_row(response, columns[rank + f], factor)
        for e in range(reduced.shape[1]):
            reduced[f, e] *= factor
        for g in range(columns.shape[0] - rank):
            entry = reduced[g, f]
            if g != f and entry != 0.0:
                subtract_multiple(response, columns[rank + g], entry, columns[rank + f])
                for e in range(reduced.shape[1]):
                    reduced[g, e] -= entry * reduced[f, e]


@inlined
def put_dependent(memory):
    """Compute the response of the dependent variables:  N, plus T times the response of the independent
    variables."""
    solver, rank = memory.solver, memory.partition.rank
    response, particular, null_space, columns = (
        solver.response, solver.particular, solver.null_space, solver.pivot_columns,
    )  # fmt: skip
    lanes, nz = response.shape[1], columns.shape[0]
    for k in range(rank):
        i = columns[k]
        for j in range(0, lanes, WIDTH):
            total = load(particular, i * lanes + j)
            for f in range(nz - rank):
                total = total + null_space[f, i] * load(response, columns[rank + f] * lanes + j)
            store(total, response, i * lanes + j)


@inlined
def put_multipliers(memory):
    """Compute the response of the multipliers:  Nᵀ of the forces that the motion of dependent variables
    leaves."""
    solver, rank, response = memory.solver, memory.partition.rank, memory.solver.response
    particular, forces, columns = solver.particular, solver.forces, solver.pivot_columns
    nz, lanes = columns.shape[0], response.shape[1]
    for k in range(rank):
        put_force(columns[k], memory)
    for e in range(nz, nz + solver.pivot_rows.shape[0]):
        for j in range(0, lanes, WIDTH):
            total = 0.0 * load(response, 0)
            for k in range(rank):
                total = total + particular[columns[k], e] * load(forces, columns[k] * lanes + j)
            store(total, response, e * lanes + j)


@inlined
def put_force(i, memory):
    """Compute the remaining force at a variable: the applied force minus its inertia force."""
    solver, inertia, lanes = memory.solver, memory.polynomials.inertia, memory.solver.response.shape[1]
    response, forces, mass, coupled = solver.response, solver.forces, inertia.mass, inertia.coupled
    first, end = inertia.first[i], inertia.first[i + 1]
    for j in range(0, lanes, WIDTH):
        left = 0.0 * load(mass, 0)  # forces may be infinite after a zero pivot
        for e in range(first, end):
            left = left - mass[i, coupled[e]] * load(response, coupled[e] * lanes + j)
        store(left, forces, i * lanes + j)
    forces[i, i] += 1.0


@inlined
def is_sharp(solver):
    """Return whether all pivots are nearly as large as at the selection of rows and variables."""
    for k in range(solver.first.shape[0]):  # noqa: SIM110 - no generators in kernels
        if not abs(solver.last[k]) > MIN_PIVOT_KEPT * solver.first[k]:
            return False
    return True


@inlined
def respond(memory):
    """Compute pivots and response at the first coefficients, by generated code if the scene has it."""
    solver, code = memory.solver, memory.code
    if code.factorise != 0 and code.rank == memory.partition.rank:
        factorise_by_code(
            code.factorise, memory.series.terms, solver.tableau, solver.particular, solver.null_space,
            solver.response, solver.last, solver.pivot_rows, solver.pivot_columns,
        )  # fmt: skip
    else:
        memory.kernels.respond(memory)
    if memory.polynomials.given.driver.shape[0] > 0:
        add_functions(memory.polynomials.given.driver.shape[0], memory)


@inlined
def put_inverse(solver):
    """Compute the response of variables that rows determine, so that no force moves a variable."""
    response, particular, nz = solver.response, solver.particular, solver.pivot_columns.shape[0]
    zero, lanes = 0.0 * load(solver.linear, 0), response.shape[1]
    for j in range(0, (nz + solver.pivot_rows.shape[0]) * lanes, WIDTH):
        store(zero, response, j)
    for e in range(nz, nz + solver.pivot_rows.shape[0]):
        for i in range(nz):
            response[e, i] = particular[i, e]


@exchangeable(RESPOND)
def respond_in_loops(memory):
    """Compute pivots and response by elimination of the rows, then of the reduced mass matrix; return OK."""
    exchange(memory)
    split(memory)
    if memory.partition.rank == memory.solver.pivot_columns.shape[0]:
        put_inverse(memory.solver)
    else:
        reduce_inertia(memory)
        solve_reduced(memory)
        put_dependent(memory)
        put_multipliers(memory)
    return OK


@kernel
def factorise_equations(memory):
    """Compute the response at the first coefficients; return OK, or SINGULAR if a rank changes."""
    memory.run.equations.system.counts.factorisations += 1
    respond(memory)
    if not is_sharp(memory.solver):
        save_replaced_pivot(memory)
        if memory.kernels.choose(memory) != memory.partition.rank:
            return SINGULAR
        factorise_anew(memory)
    return inertia_left(memory)


@kernel
def factorise_anew(memory):
    """Compute the response for a newly chosen partition, whose pivots become the reference."""
    respond(memory)
    for k in range(memory.solver.first.shape[0]):
        memory.solver.first[k] = abs(memory.solver.last[k])


@inlined
def inertia_left(memory):
    """Return OK, or SINGULAR if a motion that the rows allow has no inertia."""
    solver, mass, largest = memory.solver, memory.polynomials.inertia.mass, 0.0
    for i in range(mass.shape[0]):
        largest = max(largest, mass[i, i])
    for k in range(memory.partition.rank, mass.shape[0]):
        if not solver.first[k] > WITHOUT_INERTIA * largest:
            return SINGULAR
    return OK


@kernel
def add_functions(functions, memory):
    """Compute the response to prescribed functions, in rows that depend on them and in themselves."""
    solver, rows, terms = memory.solver, memory.polynomials.rows, memory.series.terms
    response, n = solver.response, solver.pivot_columns.shape[0] + solver.pivot_rows.shape[0]
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
    """Subtract from the right-hand side the part of a row that depends on a function."""
    response, lanes, nz = solver.response, solver.response.shape[1], solver.pivot_columns.shape[0]
    if lane >= nz + solver.pivot_rows.shape[0]:
        for j in range(0, lanes, WIDTH):
            more = value * load(response, (nz + row) * lanes + j)
            store(load(response, lane * lanes + j) - more, response, lane * lanes + j)


@inlined
def solution(solver, j):
    """Return the vector from lane j on of the solution of the right-hand side."""
    response, rhs, lanes = solver.response, solver.rhs, solver.response.shape[1]
    a, b = rhs[0] * load(response, j), rhs[1] * load(response, lanes + j)
    c, d = rhs[2] * load(response, 2 * lanes + j), rhs[3] * load(response, 3 * lanes + j)
    for e in range(4, lanes, 4):
        a = a + rhs[e] * load(response, e * lanes + j)
        b = b + rhs[e + 1] * load(response, (e + 1) * lanes + j)
        c = c + rhs[e + 2] * load(response, (e + 2) * lanes + j)
        d = d + rhs[e + 3] * load(response, (e + 3) * lanes + j)
    return (a + b) + (c + d)
