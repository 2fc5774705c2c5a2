"""Taylor coefficients of a motion, order by order, with one factorisation for all of them.

Of order k the unknowns z_{k+2} and λ_k enter linearly, with the matrix at the time of expansion (J. D.
Pryce, BIT 41, 2001); all else is sums of products of lower orders, Σ a_i b_{k-i}.  Products of rows and of
forces run over the same orders because multipliers stand two orders later than variables.
"""

from __future__ import annotations

from mbref.kernels.compilation import inlined, kernel
from mbref.taylor.lanes import LANES, add_product, sum_products
from mbref.taylor.loads import add_loads, start_loads
from mbref.taylor.solver import solve


@inlined
def gather(k, memory):
    """The factors of all products from the coefficients of order k + 1."""
    series, products = memory.series, memory.polynomials.products
    left, right = products.left, products.right
    for c in range(left.shape[0]):
        series.left[k, c] = series.terms[k + 1, left[c]]
        series.right[k, c] = series.terms[k + 1, right[c]]


@inlined
def convolve(k, memory):
    """Σ left_i right_{k-i} of all products, and their sums over the levels."""
    series, start, weight = (
        memory.series,
        memory.polynomials.products.start,
        memory.polynomials.products.weight,
    )
    sums, slots, totals = series.sums, series.sums.shape[0], series.totals
    totals[:] = 0.0
    for c in range(0, slots, LANES):
        sum_products(series.left, c, slots, series.right, k * slots + c, -slots, k + 1, sums, c)
    for level in range(start.shape[0] - 1):
        for c in range(0, start[level + 1] - start[level], LANES):
            add_product(sums, start[level] + c, weight, start[level] + c, totals, c)


@kernel
def expand(memory):
    """All orders of the variables from the first two, which are consistent."""
    series, solver, inertia = memory.series, memory.solver, memory.polynomials.inertia
    force, totals, rhs, terms = series.force, series.totals, solver.rhs, series.terms
    loads = memory.polynomials.springs.damping.shape[0] + memory.polynomials.torsions.damping.shape[0]
    nz, n = force.shape[0], solver.partner.shape[0]
    start_loads(memory)
    for k in range(memory.progress.order - 1):
        gather(k, memory)
        convolve(k, memory)
        factor = 1.0 / ((k + 1) * (k + 2))
        for c in range(n):
            rhs[solver.place[c]] = -(factor * solver.of_force[c] + solver.of_row[c]) * totals[c]
        for g in range(n, rhs.shape[0]):
            rhs[g] = terms[k + 2, g]
        if k == 0:
            for i in range(nz):
                rhs[solver.partner[i]] += factor * inertia.force[i]
        for e in range(inertia.target.shape[0]):
            moment = inertia.weight[e] * terms[k, inertia.source[e]]
            rhs[solver.partner[inertia.target[e]]] += factor * moment
        if loads > 0:
            force[:] = 0.0
            add_loads(k, memory)
            for i in range(nz):
                rhs[solver.partner[i]] += factor * force[i]
        solve(solver, rhs.shape[0], terms, (k + 2) * terms.shape[1])
        for r in range(nz, n):
            terms[k + 2, r] *= (k + 1) * (k + 2)
