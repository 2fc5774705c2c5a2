"""DOP853: explicit Runge–Kutta of order 8 with error estimates of orders 5 and 3, adaptive.

The error of a step is the largest over the components, so that components at rest do not dilute it.
"""

from __future__ import annotations

from numpy import sqrt

from mbref.compiled import exchangeable
from mbref.integrators.base import Integrator
from mbref.integrators.coefficients import ERROR3, ERROR5, STAGES, A, B, C
from mbref.integrators.one_step import propose
from mbref.tables import OK, STEP
from mbref.vectors import larger


@exchangeable(STEP)
def step(
    rates, accelerate, t, h, y, y_rate, y_new, memory, tolerances,
    problem,
):  # fmt: skip
    n = y.shape[0]
    memory[0, :n] = y_rate
    for s in range(1, STAGES):
        for i in range(n):
            y_new[i] = 0.0
        for j in range(s):
            a = A[s, j]
            if a != 0.0:
                for i in range(n):
                    y_new[i] += a * memory[j, i]
        for i in range(n):
            y_new[i] = y[i] + h * y_new[i]
        status = rates(accelerate, t + C[s] * h, y_new, memory[s, :n], problem)
        if status != OK:
            return -float(status)
    error3, error5 = 0.0, 0.0
    for i in range(n):
        increment, e3, e5 = 0.0, 0.0, 0.0
        for s in range(STAGES):
            k = memory[s, i]
            increment += B[s] * k
            e3 += ERROR3[s] * k
            e5 += ERROR5[s] * k
        y_new[i] = y[i] + h * increment
        scale = tolerances[1] + tolerances[0] * max(abs(y[i]), abs(y_new[i]))
        error3 = larger(error3, e3 / scale)
        error5 = larger(error5, e5 / scale)
    if error5 == 0.0:
        return 0.0  # nothing is integrated, or nothing changes
    return abs(h) * error5 * error5 / sqrt(error5 * error5 + 0.01 * error3 * error3)


DOP853 = Integrator("dop853", 8, step, propose, STAGES, adaptive=True)
