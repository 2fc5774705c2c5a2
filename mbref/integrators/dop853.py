"""DOP853: explicit Runge–Kutta of order 8 with error estimates of orders 5 and 3, adaptive.

The error of a step is the largest over the components, so that components at rest do not dilute it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from numpy import sqrt

from mbref.integrators.base import Integrator
from mbref.integrators.coefficients import ERROR3, ERROR5, STAGES, A, B, C
from mbref.integrators.one_step import propose
from mbref.kernels.compilation import exchangeable, inlined
from mbref.kernels.layout import OK, STEP
from mbref.linear_algebra.vectors import copy, larger


def sum_with(weights: Sequence[float]) -> Callable:
    """A kernel (k, i) -> Σ_s weights[s] k[s, i], with the weights as constants; zeros cost nothing."""
    count = len(weights)

    @inlined
    def weighted(k, i):
        total = 0.0
        for s in range(count):
            if weights[s] != 0.0:
                total += weights[s] * k[s, i]
        return total

    return weighted


def stages_to(last: int) -> Callable:
    """A kernel that fills rows 1 to ``last`` of k with the slopes of those stages; its status.

    One piece of code a stage: a loop over the stages, whose sums differ, would take half as long again.
    """
    if last == 0:
        return no_stage
    before, weighted, node = stages_to(last - 1), sum_with(A[last, :last]), C[last]

    @inlined
    def stages(rates, accelerate, t, h, y, y_new, k, problem):
        status = before(rates, accelerate, t, h, y, y_new, k, problem)
        if status != OK:
            return status
        for i in range(y.shape[0]):
            y_new[i] = y[i] + h * weighted(k, i)
        return rates(accelerate, t + node * h, y_new, k[last, : y.shape[0]], problem)

    return stages


@inlined
def no_stage(rates, accelerate, t, h, y, y_new, k, problem):
    """Stage 0 has the slope at y, which is known."""
    return OK


all_stages = stages_to(STAGES - 1)
solution, third_order, fifth_order = (sum_with(weights) for weights in (B, ERROR3, ERROR5))


@exchangeable(STEP)
def step(
    rates, accelerate, t, h, y, y_rate, y_new, memory, tolerances,
    problem,
):  # fmt: skip
    copy(y_rate, memory[0, : y.shape[0]])
    status = all_stages(rates, accelerate, t, h, y, y_new, memory, problem)
    if status != OK:
        return -float(status)
    for i in range(y.shape[0]):
        y_new[i] = y[i] + h * solution(memory, i)
    errors3, errors5, error3, error5 = memory[1], memory[2], 0.0, 0.0  # stages of no weight in these sums
    for i in range(y.shape[0]):
        weight = 1.0 / (tolerances[1] + tolerances[0] * max(abs(y[i]), abs(y_new[i])))
        errors3[i] = third_order(memory, i) * weight
        errors5[i] = fifth_order(memory, i) * weight
    for i in range(y.shape[0]):
        error3, error5 = larger(error3, errors3[i]), larger(error5, errors5[i])
    if error5 == 0.0:
        return 0.0  # nothing is integrated, or nothing changes
    return abs(h) * error5 * error5 / sqrt(error5 * error5 + 0.01 * error3 * error3)


DOP853 = Integrator("dop853", 8, step, propose, STAGES, adaptive=True)
