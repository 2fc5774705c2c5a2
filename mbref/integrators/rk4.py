"""RK4: the classical Runge–Kutta method of order 4 with a fixed step."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from mbref.integrators.base import Integrator
from mbref.integrators.one_step import propose
from mbref.kernels.compilation import exchangeable
from mbref.kernels.layout import OK, STEP
from mbref.kernels.named_memory import Vector, opener


class Stages(NamedTuple):
    """The slope at a stage and the weighted sum of the previous slopes."""

    slope: Annotated[Vector, "14*nb"]
    total: Annotated[Vector, "14*nb"]


stages_of = opener(Stages)


@exchangeable(STEP)
def step(rates, t, h, y, y_rate, y_new, memory):
    n, stages = y.shape[0], stages_of(memory.integrator)
    k, total = stages.slope[:n], stages.total[:n]
    for i in range(n):
        y_new[i], total[i] = y[i] + 0.5 * h * y_rate[i], y_rate[i]
    for s in range(3):
        status = rates(t + (h if s == 2 else 0.5 * h), y_new, k, memory)
        if status != OK:
            return -float(status)
        part = 0.5 * h if s == 0 else h
        if s < 2:
            for i in range(n):
                y_new[i] = y[i] + part * k[i]
                total[i] += 2.0 * k[i]
    for i in range(n):
        y_new[i] = y[i] + h / 6.0 * (total[i] + k[i])
    return 0.0


RK4 = Integrator("rk4", 4, step, propose, Stages, adaptive=False, options={"step": 1e-4})
