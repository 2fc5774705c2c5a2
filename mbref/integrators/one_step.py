"""Step control of one-step methods: the error ratio to the power of -1 / order."""

from __future__ import annotations

from mbref.kernels.compilation import exchangeable, kernel
from mbref.kernels.layout import PROPOSE
from mbref.linear_algebra.vectors import larger

SAFETY, SHRINK, GROW, RETRY = 0.8, 0.2, 100.0, 0.25  # 0.8 takes 5 to 10 % fewer evaluations than 0.9


@kernel
def first_step(y, y_rate, control):
    """A first step from the sizes of y and y': the first guess of Hairer, Nørsett & Wanner, section II.4."""
    size, rate = 0.0, 0.0
    for i in range(y.shape[0]):
        scale = control.atol + control.rtol * abs(y[i])
        size = larger(size, y[i] / scale)
        rate = larger(rate, y_rate[i] / scale)
    return 0.01 * size / rate if min(size, rate) > 1e-5 else 1e-6 * control.largest_step


@exchangeable(PROPOSE)
def propose(h, suggested, ratio, y, y_rate, memory):
    control = memory.control
    if h == 0.0:
        return first_step(y, y_rate, control)
    if ratio > 1.0:
        return h * max(SHRINK, SAFETY * ratio ** (-1.0 / control.order))
    if not ratio >= 0.0:
        return h * RETRY
    factor = GROW if ratio == 0.0 else min(GROW, SAFETY * ratio ** (-1.0 / control.order))
    return max(suggested, h * factor) if h < suggested else h * factor
