"""Taylor coefficients of a motion, order by order, with one factorisation for all of them.

At order k the unknowns z_{k+2} and λ_k enter linearly, with the matrix at the time of expansion (J. D. Pryce,
BIT 41, 2001). All other terms are sums of products of lower orders, Σ a_i b_{k-i}.  Products of rows and of
forces run over the same orders because multipliers stand two orders later than variables.  A new coefficient
is added to the sums of all later orders at once, so that few operations separate one order from the next.
"""

from __future__ import annotations

from mbref.kernels.compilation import exchangeable, inlined
from mbref.kernels.layout import OK
from mbref.taylor.coefficients import largest_coefficient
from mbref.taylor.generated_calls import expand_by_code, expand_by_power
from mbref.taylor.joint_loads import add_slides, add_torsions, grow_slides, grow_torsions
from mbref.taylor.layout import TERMS
from mbref.taylor.loads import add_springs, add_timed_forces, grow_springs
from mbref.taylor.simd import WIDTH, gather, load, store
from mbref.taylor.solver import solution

# step length / time in which a constant deceleration would stop the motion: beyond it rounding grows with the
# order
SLOWEST = 2.0


@inlined
def start_sums(memory):
    """Set the sums to minus the constant forces in order 0."""
    sums, force = memory.series.sums, memory.polynomials.inertia.force
    size = sums.shape[0] * sums.shape[1]
    zero = 0.0 * load(force, 0)
    for j in range(0, size, WIDTH):
        store(zero, sums, j)
    for j in range(0, sums.shape[1], WIDTH):
        store(-1.0 * load(force, j), sums, j)


@inlined
def put_sums(k, memory):
    """Compute the right-hand side of order k, from the factors of order k + 1 and of lower orders."""
    series, products, terms = memory.series, memory.polynomials.products, memory.series.terms
    left, right, lanes, slots = series.left, series.right, terms.shape[1], series.left.shape[1]
    inertia = memory.polynomials.inertia
    share = 0.5 if k == 0 else 1.0  # the product of the first factors is counted twice
    for block in range(products.start.shape[0] - 1):
        place = k * lanes + block * WIDTH
        one = 0.0 * load(series.sums, place)
        other = one
        for c in range(products.start[block], products.start[block + 1], WIDTH):
            a = load(products.weight, c) * gather(terms, (k + 1) * lanes, products.left, c)
            b = gather(terms, (k + 1) * lanes, products.right, c)
            store(a, left, k * slots + c)
            store(b, right, k * slots + c)
            one = one + a * load(right, c)
            other = other + load(left, c) * b
        total = load(series.sums, place) + share * (one + other)
        for c in range(inertia.start[block], inertia.start[block + 1], WIDTH):
            total = total - load(inertia.weight, c) * gather(terms, k * lanes, inertia.source, c)
        store(load(series.scale, place) * total, memory.solver.rhs, block * WIDTH)


@inlined
def add_to_later_sums(k, last, memory):
    """Add the products of the factors of order k + 1 and of earlier orders to the sums up to the last
    order."""
    series, start = memory.series, memory.polynomials.products.start
    left, right, sums, slots = series.left, series.right, series.sums, series.left.shape[1]
    lanes = sums.shape[1]
    for block in range(start.shape[0] - 1):
        for c in range(start[block], start[block + 1], WIDTH):
            a, b = load(left, k * slots + c), load(right, k * slots + c)
            place, source = (k + 1) * lanes + block * WIDTH, slots + c
            for _ in range(min(k - 1, last - k)):
                more = a * load(right, source) + load(left, source) * b
                store(load(sums, place) + more, sums, place)
                place, source = place + lanes, source + slots
            if 2 * k <= last:
                place = 2 * k * lanes + block * WIDTH
                store(load(sums, place) + a * b, sums, place)


@inlined
def solve_order(k, last, memory):
    """Compute order k + 2 of the variables and order k of the multipliers; the right-hand side with the loads
    is in ``sums``."""
    series, terms, rhs = memory.series, memory.series.terms, memory.solver.rhs
    n, lanes = memory.solver.pivot_columns.shape[0] + memory.solver.pivot_rows.shape[0], terms.shape[1]
    put_sums(k, memory)
    for g in range(n, n + memory.polynomials.given.driver.shape[0]):
        rhs[g] = terms[k + 2, g]
    for j in range(0, lanes, WIDTH):
        grown = load(series.growth, k * lanes + j) * solution(memory.solver, j)
        store(grown, terms, (k + 2) * lanes + j)
    if k > 0:
        add_to_later_sums(k, last, memory)


@exchangeable(TERMS)
def expand_without_loads(memory):
    """Compute all orders with constant loads only, by code short enough for the registers; return OK."""
    last = memory.mode.order - 2
    for k in range(last + 1):
        solve_order(k, last, memory)
    return OK


@exchangeable(TERMS)
def expand_with_loads(memory):
    """Compute all orders with springs and other loads that vary; return OK.

    Order k of the loads follows from order k + 1 of the variables, order -1 from the first coefficients.
    """
    last = memory.mode.order - 2
    for k in range(-1, last + 1):
        grow_springs(k + 1, memory)
        grow_torsions(k + 1, memory)
        grow_slides(k + 1, memory)
        if k >= 0:
            add_springs(k, memory)
            add_torsions(k, memory)
            add_slides(k, memory)
            add_timed_forces(k, memory)
            solve_order(k, last, memory)
    return OK


@exchangeable(TERMS)
def expand_series(memory):
    """Compute all orders of the variables from the first two, which are consistent."""
    code, step, order = memory.code, memory.step, memory.mode.order
    step.deceleration = 0.0
    if code.expand_by_power != 0 and code.rank == memory.partition.rank and not starts_at_rest(memory):
        series, solver = memory.series, memory.solver
        expand_by_power(
            code.expand_by_power, series.terms, solver.response, series.left, series.right, solver.rhs,
            order - 2,
        )  # fmt: skip
        step.deceleration = abs(solver.rhs[0])
        length = memory.run.loop.clock.length
        if length == 0.0:  # at the start, before a step: use the time in which a variable moves by one
            length = 1.0 / largest_coefficient(series.terms, 1, solver.pivot_columns.shape[0])
        if not turns_back_in(length, memory):
            return OK
    return memory.kernels.multipliers(memory)


@inlined
def starts_at_rest(memory):
    """Return whether no step has been taken, and no variable moves."""
    is_first = memory.run.loop.clock.length == 0.0
    return (
        is_first
        and not largest_coefficient(memory.series.terms, 1, memory.solver.pivot_columns.shape[0]) > 0.0
    )


@inlined
def turns_back_in(h, memory):
    """Return whether a motion whose orders are computed by power is at rest, or may reverse in much less than
    h seconds."""
    return not memory.step.deceleration * h <= SLOWEST


@exchangeable(TERMS)
def expand_with_multipliers(memory):
    """Compute all orders of the variables and multipliers from the first two."""
    code = memory.code
    memory.step.deceleration = 0.0
    if code.expand_by_power != 0:
        memory.kernels.respond(memory)
    if code.expand != 0 and code.rank == memory.partition.rank:
        series, solver = memory.series, memory.solver
        expand_by_code(
            code.expand, series.terms, solver.response, series.left, series.right, series.scale,
            series.growth, solver.rhs, memory.mode.order - 2,
        )  # fmt: skip
        return OK
    start_sums(memory)
    return memory.kernels.orders(memory)
