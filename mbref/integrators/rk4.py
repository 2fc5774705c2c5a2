"""RK4: the classical Runge–Kutta method of order 4 with a fixed step."""

from __future__ import annotations

from mbref.integrators.base import Integrator
from mbref.integrators.one_step import propose
from mbref.kernels.compilation import exchangeable
from mbref.kernels.layout import OK, STEP
from mbref.linear_algebra.vectors import copy


@exchangeable(STEP)
def step(
    rates, accelerate, t, h, y, y_rate, y_new, memory, tolerances,
    problem,
):  # fmt: skip
    n = y.shape[0]
    k, total = memory[0, :n], memory[1, :n]
    copy(y_rate, k)
    copy(y_rate, total)
    for s in range(3):
        part = h if s == 2 else 0.5 * h
        for i in range(n):
            y_new[i] = y[i] + part * k[i]
        status = rates(accelerate, t + part, y_new, k, problem)
        if status != OK:
            return -float(status)
        weight = 1.0 if s == 2 else 2.0
        for i in range(n):
            total[i] += weight * k[i]
    for i in range(n):
        y_new[i] = y[i] + h / 6.0 * total[i]
    return 0.0


RK4 = Integrator("rk4", 4, step, propose, 2, adaptive=False, options={"step": 1e-4})
