"""Step control of one-step methods: the error ratio to the power of -1 / order, and its trend."""

from __future__ import annotations

from mbref.kernels.compilation import exchangeable, inlined, kernel
from mbref.kernels.layout import PROPOSE
from mbref.linear_algebra.vectors import larger

# next step / step: margin (0.8 takes 5 to 10 % fewer evaluations than 0.9), limits, and after a failure
SAFETY, SHRINK, GROW, RETRY = 0.8, 0.2, 100.0, 0.25
ROUNDED_ERROR = 0.02  # error / tolerance below which the error may be rounding and shows no trend


@kernel
def first_step(y, y_rate, control):
    """Return the initial step from the sizes of y and y': the first guess of Hairer, Nørsett & Wanner,
    section II.4."""
    size, rate = 0.0, 0.0
    for i in range(y.shape[0]):
        scale = control.atol + control.rtol * abs(y[i])
        size = larger(size, y[i] / scale)
        rate = larger(rate, y_rate[i] / scale)
    return 0.01 * size / rate if min(size, rate) > 1e-5 else 1e-6 * control.largest_step


@inlined
def next_step(h, suggested, ratio, trend, control):
    """Return the next step after a step of length h, multiplied by ``trend`` if that step was accepted."""
    if ratio > 1.0:
        return h * max(SHRINK, SAFETY * ratio ** (-1.0 / control.order))
    if not ratio >= 0.0:
        return h * RETRY
    factor = GROW if ratio == 0.0 else min(GROW, trend * SAFETY * ratio ** (-1.0 / control.order))
    return max(suggested, h * factor) if h < suggested else h * factor


@kernel
def trend(h, ratio, memory):
    """Return the factor, at most 1, by which growing errors shorten the step after a step of length h.

    The error of steps of equal length is assumed to grow to the next step as it grew to the last step (K.
    Gustafsson, ACM Trans. Math. Software 20, 1994).
    """
    clock, taken = memory.loop.clock, memory.equations.system.counts.steps
    if taken - clock.restart < 2 or clock.share < ROUNDED_ERROR or not min(ratio, clock.past_ratio) > 0.0:
        return 1.0
    found = h / clock.past_length * (clock.past_ratio / ratio) ** (1.0 / memory.control.order)
    return max(SHRINK, min(1.0, found))


@exchangeable(PROPOSE)
def propose(h, suggested, ratio, y, y_rate, memory):
    """Propose a step by the last error and the trend of errors, which halves the number of refused steps."""
    control = memory.control
    if h == 0.0:
        return first_step(y, y_rate, control)
    return next_step(h, suggested, ratio, trend(h, ratio, memory), control)
