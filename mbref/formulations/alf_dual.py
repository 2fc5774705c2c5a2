"""ALF-dual: the same iteration as ALF, on the m x m matrix of its multipliers.

    (S + I/α) Δλ = Φ_q q̈_i - γ,   q̈_{i+1} = q̈_i - M⁻¹ Φ_qᵀ Δλ,   S = Φ_q M⁻¹ Φ_qᵀ,   q̈_0 = M⁻¹ g

By the Woodbury identity its iterates are those of Eqs. 17 to 19.  But α enters as 1/α beside S instead of
multiplying Φ_qᵀ Φ_q beside M, so that a large α costs no digits and few iterations are needed; no rank
is decided.  Regularised rows are those of unit length in the metric of M.  Stops when the next change would
be ≤ epsilon, relative to the larger of 1 and the acceleration, judged by how the changes shrink.
"""

from __future__ import annotations

from mbref.formulations.alf import changed, feedback
from mbref.formulations.base import Formulation
from mbref.formulations.moore_penrose import begin, transpose
from mbref.kernels.compilation import exchangeable
from mbref.kernels.layout import ACCELERATE, FACTORISATIONS, FORMULATION_OPTIONS, NOT_CONVERGED, OK, SINGULAR
from mbref.linear_algebra.elimination import (
    add_product,
    cholesky_factor,
    cholesky_solve,
    gram,
    times_transpose,
)
from mbref.linear_algebra.vectors import copy

TINY, NEVER = 1e-300, 1e300

OPTIONS = {"alpha": 1e10, "epsilon": 1e-12, "iterations": 20.0, "omega": 0.0, "mu": 1.0}


@exchangeable(ACCELERATE)
def accelerate(
    mass, inverse_root, jacobian, force, rhs, settings, scratch, pivots, counts, acceleration, multipliers
):
    m, n = jacobian.shape
    alpha, epsilon = settings[FORMULATION_OPTIONS], settings[FORMULATION_OPTIONS + 1]
    d = scratch[: m * n].reshape((m, n))
    s = scratch[m * n : m * n + m * m].reshape((m, m))
    dt = scratch[m * n + m * m : 2 * m * n + m * m].reshape((n, m))
    start = 2 * m * n + m * m
    b, step = scratch[start : start + m], scratch[start + m : start + 2 * m]
    total, x = scratch[start + 2 * m : start + 3 * m], scratch[start + 3 * m : start + 3 * m + n]
    before = scratch[start + 3 * m + n : start + 3 * m + 2 * n]
    if not begin(mass, inverse_root, jacobian, force, rhs, d, b, acceleration, multipliers):
        return SINGULAR
    transpose(d, dt)
    gram(dt, s)
    for i in range(m):
        s[i, i] += 1.0 / alpha
        total[i] = 0.0
    counts[FACTORISATIONS] += 1
    if not cholesky_factor(s, m):
        return SINGULAR
    status, change, expected = NOT_CONVERGED, 0.0, NEVER
    for _ in range(int(settings[FORMULATION_OPTIONS + 2])):
        copy(b, step)
        cholesky_solve(s, m, step)
        times_transpose(d, step, x)
        copy(acceleration, before)
        for j in range(n):
            acceleration[j] += inverse_root[j] * x[j]
        for i in range(m):
            total[i] -= step[i]
        last, change = change, changed(before, acceleration)
        expected = min(expected, change * min(1.0, change / max(last, TINY)))
        if expected <= epsilon:
            status = OK
            break
        add_product(dt, x, -1.0, b)
    for i in range(m):
        multipliers[i] *= total[i]
    return status


ALF_DUAL = Formulation(
    name="alf-dual",
    equations="Eqs. 17-19 in the multipliers",
    accelerate=accelerate,
    scratch=lambda m, n: 2 * m * n + m * m + 3 * m + 2 * n,
    handles_redundancy=True,
    handles_singular_mass=False,
    iterative=True,
    sparse=True,
    options=OPTIONS,
    feedback=feedback,
)
