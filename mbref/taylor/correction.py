"""Correction of the first coefficients of a series: the least change, in the metric of M, that satisfies the
rows."""

from __future__ import annotations

from mbref.kernels.compilation import exchangeable, inlined, kernel
from mbref.kernels.layout import NOT_CONVERGED, OK
from mbref.linear_algebra.vectors import larger
from mbref.taylor.coupled_coordinates import add_coordinates, add_rates, has_coordinates
from mbref.taylor.generated_calls import close_by_code, violation_by_code
from mbref.taylor.layout import CORRECT
from mbref.taylor.partition import least_pivot
from mbref.taylor.simd import WIDTH, gather, load, store
from mbref.taylor.solver import factorise_equations, solution

MAX_VIOLATION = 1e-6  # violation below which one correction leaves rounding
MAX_CORRECTIONS = 8  # largest number of corrections of a state


@kernel
def violation(memory):
    """Evaluate Φ of every row at the first coefficients; return the largest |Φ|."""
    solver, code, largest = memory.solver, memory.code, 0.0
    if code.violation != 0:
        violation_by_code(code.violation, memory.series.terms, solver.phi)
    else:
        violation_in_loops(memory)
    for r in range(solver.pivot_columns.shape[0], solver.pivot_columns.shape[0] + solver.pivot_rows.shape[0]):
        largest = larger(largest, solver.phi[r])
    return largest


@inlined
def violation_in_loops(memory):
    """Evaluate Φ of every row at the first coefficients, by the general code."""
    rows, products, terms = memory.polynomials.rows, memory.polynomials.products, memory.series.terms
    phi, nz = memory.solver.phi, memory.solver.pivot_columns.shape[0]
    for block in range(products.start.shape[0] - 1):
        total = load(rows.constant, block * WIDTH)
        for c in range(products.start[block], products.start[block + 1], WIDTH):
            one = load(products.weight, c) * gather(terms, 0, products.left, c)
            total = total + one * gather(terms, 0, products.right, c)
        store(total, phi, block * WIDTH)
    for e in range(rows.linear_row.shape[0]):
        phi[nz + rows.linear_row[e]] += rows.linear_weight[e] * terms[0, rows.linear_lane[e]]
    if has_coordinates(memory.polynomials):
        add_coordinates(memory)


@inlined
def violation_rate_in_loops(memory):
    """Evaluate Φ' of every row at the first two coefficients."""
    rows, products, terms = memory.polynomials.rows, memory.polynomials.products, memory.series.terms
    phi, nz, lanes = memory.solver.phi, memory.solver.pivot_columns.shape[0], memory.series.terms.shape[1]
    for block in range(products.start.shape[0] - 1):
        total = 0.0 * load(rows.constant, block * WIDTH)
        for c in range(products.start[block], products.start[block + 1], WIDTH):
            left, left_rate = gather(terms, 0, products.left, c), gather(terms, lanes, products.left, c)
            right, right_rate = (
                gather(terms, 0, products.right, c),
                gather(terms, lanes, products.right, c),
            )
            total = total + load(products.weight, c) * (left * right_rate + left_rate * right)
        store(total, phi, block * WIDTH)
    for e in range(rows.linear_row.shape[0]):
        phi[nz + rows.linear_row[e]] += rows.linear_weight[e] * terms[1, rows.linear_lane[e]]
    if has_coordinates(memory.polynomials):
        add_rates(memory)


@inlined
def subtract_violation(order, memory):
    """Change the variables of order 0 or 1 by the least change, in the metric of M, that removes Φ or Φ'."""
    solver, terms, variable = memory.solver, memory.series.terms, memory.series.variable
    lanes = terms.shape[1]
    for j in range(0, lanes, WIDTH):
        store(-1.0 * load(solver.phi, j), solver.rhs, j)
    for j in range(0, lanes, WIDTH):
        change = load(variable, j) * solution(solver, j)
        store(change, solver.change, j)
        store(load(terms, order * lanes + j) + change, terms, order * lanes + j)


@inlined
def close(memory):
    """Remove Φ by changing the variables, with generated code if the scene has it."""
    solver, code, terms = memory.solver, memory.code, memory.series.terms
    if code.close != 0:
        close_by_code(code.close, terms, solver.phi, solver.response, solver.change)
    else:
        subtract_violation(0, memory)


@inlined
def close_rate(memory):
    """Remove Φ' by changing the rates, with generated code if the scene has it."""
    solver, code, terms = memory.solver, memory.code, memory.series.terms
    if code.close_rate != 0:
        close_by_code(code.close_rate, terms, solver.phi, solver.response, solver.change)
    else:
        violation_rate_in_loops(memory)
        subtract_violation(1, memory)


@kernel
def largest_change(memory):
    """Return the largest change of a variable by the last correction."""
    solver, change = memory.solver, 0.0
    for j in range(solver.pivot_columns.shape[0]):
        change = larger(change, solver.change[j])
    return change


@kernel
def changes_factor(left, memory):
    """Return whether the last correction has changed the factor.

    The relative change of the factor is the correction over the distance from a singular position, which is
    about the least pivot. If masses differ much, light bodies move farther, so the change of variables over Φ
    is also considered.
    """
    tolerance, change, pivot = memory.mode.tolerance, memory.step.correction, least_pivot(memory)
    return left > tolerance * pivot * pivot or change * change > tolerance * left


@exchangeable(CORRECT)
def correct_state(memory):
    """Correct positions and velocities, the first coefficients: OK, SINGULAR or NOT_CONVERGED."""
    step, left = memory.step, 1.0
    for attempt in range(MAX_CORRECTIONS):
        left = violation(memory)
        if attempt == 0:
            step.violation = left
        status = factorise_equations(memory)
        if status != OK:
            return status
        close(memory)
        if left <= MAX_VIOLATION:
            break
    if not left <= MAX_VIOLATION:
        return NOT_CONVERGED
    step.correction = largest_change(memory)
    if changes_factor(left, memory):
        status = factorise_equations(memory)
    close_rate(memory)
    return status
