"""RK4: the classical Runge–Kutta method of order 4 with a fixed step."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from mbref.integrators.base import Integrator
from mbref.integrators.one_step import propose
from mbref.kernels.compilation import exchangeable
from mbref.kernels.layout import OK, STEP
from mbref.kernels.named_memory import Vector, opener
from mbref.linear_algebra.vectors import copy


class Stages(NamedTuple):
    """The slope of a stage and the weighted sum of all slopes."""

    slope: Annotated[Vector, "14*nb"]
    total: Annotated[Vector, "14*nb"]


stages_of = opener(Stages)


@exchangeable(STEP)
def step(rates, t, h, y, y_rate, y_new, memory):
    n, stages = y.shape[0], stages_of(memory.integrator)
    k, total = stages.slope[:n], stages.total[:n]
    copy(y_rate, k)
    copy(y_rate, total)
    for s in range(3):
        part = h if s == 2 else 0.5 * h
        for i in range(n):
            y_new[i] = y[i] + part * k[i]
        status = rates(t + part, y_new, k, memory)
        if status != OK:
            return -float(status)
        weight = 1.0 if s == 2 else 2.0
        for i in range(n):
            total[i] += weight * k[i]
    for i in range(n):
        y_new[i] = y[i] + h / 6.0 * total[i]
    return 0.0


RK4 = Integrator("rk4", 4, step, propose, Stages, adaptive=False, options={"step": 1e-4})
