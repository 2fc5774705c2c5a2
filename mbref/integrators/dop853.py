"""DOP853: explicit Runge–Kutta of order 8 with error estimates of orders 5 and 3, adaptive.

The error of a step is the largest over the components, so that components at rest do not dilute it.
"""

from __future__ import annotations

from numpy import sqrt

from mbref.compiled import exchangeable, kernel
from mbref.integrators.base import Integrator
from mbref.integrators.coefficients import ERROR3, ERROR5, STAGES, A, B, C
from mbref.integrators.one_step import propose
from mbref.tables import OK, STEP
from mbref.vectors import copy, larger


@kernel
def to_stage(s, h, y, k, y_new):
    """The state of stage s, y + h Σ_j A[s, j] k_j.

    Slopes are summed component by component, and only those with a coefficient: for the few components of
    a mechanism a loop over slopes outside takes three times as long.
    """
    if s < 3:
        for i in range(y.shape[0]):
            increment = A[s, 0] * k[0, i]
            if s == 2:
                increment += A[s, 1] * k[1, i]
            y_new[i] = y[i] + h * increment
    elif s < 5:
        for i in range(y.shape[0]):
            increment = A[s, 0] * k[0, i] + A[s, 2] * k[2, i]
            if s == 4:
                increment += A[s, 3] * k[3, i]
            y_new[i] = y[i] + h * increment
    else:
        for i in range(y.shape[0]):
            increment = A[s, 0] * k[0, i] + A[s, 3] * k[3, i] + A[s, 4] * k[4, i]
            for j in range(5, STAGES - 1):
                if j < s:
                    increment += A[s, j] * k[j, i]
            y_new[i] = y[i] + h * increment


@kernel
def weighted(weights, k, i):
    """Σ_s weights[s] k_s of a component; the slopes of stages 1 to 4 have no weight."""
    total = weights[0] * k[0, i]
    for s in range(5, STAGES):
        total += weights[s] * k[s, i]
    return total


@exchangeable(STEP)
def step(
    rates, accelerate, t, h, y, y_rate, y_new, memory, tolerances,
    problem,
):  # fmt: skip
    n = y.shape[0]
    copy(y_rate, memory[0, :n])
    for s in range(1, STAGES):
        to_stage(s, h, y, memory, y_new)
        status = rates(accelerate, t + C[s] * h, y_new, memory[s, :n], problem)
        if status != OK:
            return -float(status)
    for i in range(n):
        y_new[i] = y[i] + h * weighted(B, memory, i)
    error3, error5 = 0.0, 0.0
    for i in range(n):
        scale = tolerances[1] + tolerances[0] * max(abs(y[i]), abs(y_new[i]))
        error3 = larger(error3, weighted(ERROR3, memory, i) / scale)
        error5 = larger(error5, weighted(ERROR5, memory, i) / scale)
    if error5 == 0.0:
        return 0.0  # nothing is integrated, or nothing changes
    return abs(h) * error5 * error5 / sqrt(error5 * error5 + 0.01 * error3 * error3)


DOP853 = Integrator("dop853", 8, step, propose, STAGES, adaptive=True)
