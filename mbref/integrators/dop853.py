"""DOP853: explicit Runge–Kutta of order 8 with error estimates of orders 5 and 3, adaptive.

The 8(5,3) pair of Dormand and Prince (Hairer, Nørsett & Wanner, Solving Ordinary Differential Equations I,
2nd edition, 1993, section II.5).  The error of a step is the largest over the components, so that components
at rest do not dilute it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Annotated, NamedTuple

from numpy import sqrt

from mbref.integrators.base import Integrator
from mbref.integrators.dop853_tableau import ERROR3, ERROR5, STAGES, A, B, C
from mbref.integrators.one_step import propose
from mbref.kernels.compilation import exchangeable, inlined, kernel
from mbref.kernels.layout import OK, STEP
from mbref.kernels.named_memory import Matrix, Vector, opener
from mbref.linear_algebra.vectors import copy, larger


class Stages(NamedTuple):
    """Slopes at the stages, and both error estimates over the tolerance."""

    slopes: Annotated[Matrix, 12, "14*nb"]
    errors3: Annotated[Vector, "14*nb"]
    errors5: Annotated[Vector, "14*nb"]


stages_of = opener(Stages)


def sum_with(weights: Sequence[float]) -> Callable:
    """Return a kernel (k, i) → Σ_s weights[s] k[s, i] with constant weights; zero weights need no
    operations."""
    count, weights = len(weights), tuple(map(float, weights))

    @inlined
    def weighted(k, i):
        total = 0.0
        for s in range(count):
            if weights[s] != 0.0:
                total += weights[s] * k[s, i]
        return total

    return weighted


def stages_to(last: int) -> Callable:
    """Return a kernel that computes rows 1 to ``last`` of k, the slopes at those stages, and returns its
    status.

    The stages are not written as a loop, because a loop over their different sums takes half as long again.
    """
    if last == 0:
        return no_stage
    before, weighted, node = stages_to(last - 1), sum_with(A[last]), float(C[last])

    @kernel
    def stages(rates, t, h, y, y_new, k, memory):
        status = before(rates, t, h, y, y_new, k, memory)
        if status != OK:
            return status
        for i in range(y.shape[0]):
            y_new[i] = y[i] + h * weighted(k, i)
        return rates(t + node * h, y_new, k[last, : y.shape[0]], memory)

    return stages


@kernel
def no_stage(rates, t, h, y, y_new, k, memory):
    """Do nothing: stage 0 has the slope at y, which is known."""
    return OK


all_stages = stages_to(STAGES - 1)
eighth_order, third_order, fifth_order = (sum_with(weights) for weights in (B, ERROR3, ERROR5))


@exchangeable(STEP)
def step(rates, t, h, y, y_rate, y_new, memory):
    control, stages = memory.control, stages_of(memory.integrator)
    slopes, errors3, errors5 = stages.slopes, stages.errors3, stages.errors5
    copy(y_rate, slopes[0, : y.shape[0]])
    status = all_stages(rates, t, h, y, y_new, slopes, memory)
    if status != OK:
        return -float(status)
    for i in range(y.shape[0]):
        y_new[i] = y[i] + h * eighth_order(slopes, i)
    share, error3, error5 = memory.loop.clock.share, 0.0, 0.0
    rtol, atol = share * control.rtol, share * control.atol
    for i in range(y.shape[0]):
        weight = 1.0 / (atol + rtol * max(abs(y[i]), abs(y_new[i])))
        errors3[i] = third_order(slopes, i) * weight
        errors5[i] = fifth_order(slopes, i) * weight
    for i in range(y.shape[0]):
        error3, error5 = larger(error3, errors3[i]), larger(error5, errors5[i])
    if error5 == 0.0:
        return 0.0  # nothing is integrated, or nothing changes
    return abs(h) * error5 * error5 / sqrt(error5 * error5 + 0.01 * error3 * error3)


DOP853 = Integrator("dop853", 8, step, propose, Stages, adaptive=True)
