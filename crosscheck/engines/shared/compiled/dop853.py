"""Compiled integrator DOP853 from sample to sample, around a C function that computes the rates of a state.

The 8(5,3) pair of Dormand and Prince (Hairer, Nørsett & Wanner, Solving Ordinary Differential Equations I,
2nd edition, 1993, section II.5) with the step control that needed the fewest evaluations on mechanisms. The
error is the largest over the components. The next step is the last one times 0.8 error^(-1/8), limited to 0.2
… 100. The factor is smaller if the error grew since the previous step (K. Gustafsson, ACM Trans. Math.
Software 20, 1994).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numba.extending import register_jitable
from scipy.integrate import DOP853

from crosscheck.engines.shared.compiled.calls import rates_of

STAGES = DOP853.n_stages
A = np.ascontiguousarray(DOP853.A)
B, C, ERROR3, ERROR5 = (array[:STAGES].copy() for array in (DOP853.B, DOP853.C, DOP853.E3, DOP853.E5))

SAFETY, SHRINK, GROW, RETRY = 0.8, 0.2, 100.0, 0.25
ORDER = 8
STRETCH = 1e-9  # relative extension of a step so that it ends at a sample
SMALLEST = 1e-14  # shortest step / time of the last sample
# lengths tried if the shortest step fails, and the longest of them in shortest steps
JUMPS, LONGEST_JUMP = 16, 4.0

REACHED, NOT_FINITE, TOO_SMALL, TOO_MANY, REFUSED = range(5)  # status codes of an integration to a sample
STEPS, REJECTED, EVALUATIONS = range(3)  # indices of the counters


class System(NamedTuple):
    """The C function of the rates with its context, and the tolerances of a run."""

    function: int  # address of ``int rates(void *context, double t, double *y, double *rates)``
    context: int
    quaternions: np.ndarray  # indices of the first components of unit quaternions in the state
    rtol: float
    atol: float
    shortest: float  # s; a step of this length is accepted whatever its error
    longest: float  # s
    most_steps: int
    settle: int  # address of a C function that corrects an accepted state in place, or 0


class Memory(NamedTuple):
    """Arrays of a run; n is the length of the state."""

    y: np.ndarray  # (n,) accepted state
    slopes: np.ndarray  # (STAGES, n) rates at the stages
    new: np.ndarray  # (n,) state at the end of an attempted step
    errors: np.ndarray  # (2, n) two error estimates
    # reached time, length of the next step, length and error of the last step (0 before the first)
    clock: np.ndarray
    counts: np.ndarray  # STEPS, REJECTED, EVALUATIONS


def memory(y: np.ndarray) -> Memory:
    """Return the arrays of a run that starts from a state (n,)."""
    n = len(y)
    return Memory(
        y.copy(), np.zeros((STAGES, n)), np.zeros(n), np.zeros((2, n)), np.zeros(4), np.zeros(3, np.int64)
    )


@register_jitable
def is_finite(y):
    """Return whether all numbers and their sum are finite."""
    return math.isfinite(np.sum(y))


@register_jitable
def evaluate(system, t, y, rates, memory):
    """Compute the rates of a state; returns REACHED, NOT_FINITE, or REFUSED if the function fails."""
    memory.counts[EVALUATIONS] += 1
    if not is_finite(y):
        return NOT_FINITE
    if rates_of(system.function, system.context, t, y.ctypes.data, rates.ctypes.data) != 0:
        return REFUSED
    return REACHED if is_finite(rates) else NOT_FINITE


@register_jitable
def add_slopes(weights, count, factor, slopes, total):
    """Add factor Σ_s weights[s] slopes[s] to ``total``; zero weights are skipped."""
    for s in range(count):
        if weights[s] != 0.0:
            weight = factor * weights[s]
            for i in range(total.shape[0]):
                total[i] += weight * slopes[s, i]


@register_jitable
def attempt(system, h, memory):
    """Write the state after a step of h into ``memory.new``; returns its error over the tolerance, or -1 if
    the step fails."""
    t, y, new, slopes = memory.clock[0], memory.y, memory.new, memory.slopes
    for s in range(1, STAGES):
        new[:] = y
        add_slopes(A[s], s, h, slopes, new)
        if evaluate(system, t + C[s] * h, new, slopes[s], memory) != REACHED:
            return -1.0
    new[:] = y
    add_slopes(B, STAGES, h, slopes, new)
    if not is_finite(new):
        return -1.0
    ratio = error_ratio(system, h, memory)
    return ratio if system.settle == 0 or is_settled(system, t + h, memory) else -1.0


@register_jitable
def is_settled(system, t, memory):
    """Correct the new state by the function ``system.settle``; returns whether the correction succeeded."""
    new, spare = memory.new, memory.errors[0]
    status = rates_of(system.settle, system.context, t, new.ctypes.data, spare.ctypes.data)
    return status == 0 and is_finite(new)


@register_jitable
def error_ratio(system, h, memory):
    """Return the error of a step over the tolerance, from the estimates of orders 5 and 3."""
    y, new, errors = memory.y, memory.new, memory.errors
    errors[:] = 0.0
    add_slopes(ERROR3, STAGES, 1.0, memory.slopes, errors[0])
    add_slopes(ERROR5, STAGES, 1.0, memory.slopes, errors[1])
    third, fifth = 0.0, 0.0
    for i in range(y.shape[0]):
        scale = system.atol + system.rtol * max(abs(y[i]), abs(new[i]))
        third, fifth = max(third, abs(errors[0, i]) / scale), max(fifth, abs(errors[1, i]) / scale)
    return h * fifth * fifth / math.sqrt(fifth * fifth + 0.01 * third * third) if fifth > 0.0 else 0.0


@register_jitable
def growth(ratio):
    """Return the factor for the next step length, from the error over the tolerance."""
    if ratio < 0.0:
        return RETRY
    return GROW if ratio == 0.0 else min(GROW, max(SHRINK, SAFETY * ratio ** (-1.0 / ORDER)))


@register_jitable
def trend(h, ratio, clock):
    """Return the factor, at most 1, by which growing errors shorten the step after a step of length h."""
    length, before = clock[2], clock[3]
    clock[2], clock[3] = h, ratio
    if not min(ratio, before) > 0.0:
        return 1.0
    return max(SHRINK, min(1.0, h / length * (before / ratio) ** (1.0 / ORDER)))


@register_jitable
def first_step(system, end, memory):
    """Return the initial step by Hairer, Nørsett & Wanner, section II.4, from the sizes of y and y'."""
    y, rate = memory.y, memory.slopes[0]
    size, speed = 0.0, 0.0
    for i in range(y.shape[0]):
        scale = system.atol + system.rtol * abs(y[i])
        size, speed = max(size, abs(y[i]) / scale), max(speed, abs(rate[i]) / scale)
    return 0.01 * size / speed if min(size, speed) > 1e-5 else 1e-6 * end


@register_jitable
def step_within(left, h):
    """Return the next step towards a sample: the whole remaining time, half of the remaining time, or h."""
    if h * (1.0 + STRETCH) >= left:
        return left
    return min(h, 0.5 * left)


@register_jitable
def jump(system, left, memory):
    """Try the shortest and some longer steps and return the length with the least error; 0 if all attempted
    steps fail."""
    best, least = 0.0, math.inf
    for k in range(JUMPS):
        h = min(system.shortest * (1.0 + (LONGEST_JUMP - 1.0) * k / (JUMPS - 1)), left)
        ratio = attempt(system, h, memory)
        if 0.0 <= ratio < least:
            best, least = h, ratio
    memory.counts[REJECTED] += JUMPS
    if best > 0.0:
        attempt(system, best, memory)
    return best


@register_jitable
def accept(system, t, memory):
    """Accept the new state and normalise its quaternions."""
    y = memory.y
    y[:] = memory.new
    for start in system.quaternions:
        y[start : start + 4] /= math.sqrt(np.sum(y[start : start + 4] ** 2))
    memory.clock[0] = t
    memory.counts[STEPS] += 1


@register_jitable
def step(system, target, end, memory):
    """Take one accepted step towards a sample, from a state with known slope; return OK or the failure
    status."""
    clock = memory.clock
    while True:
        left, wanted = target - clock[0], min(max(clock[1], system.shortest), system.longest)
        h = step_within(left, wanted)
        ratio = attempt(system, h, memory)
        if 0.0 <= ratio <= 1.0:
            clock[1] = max(h * growth(ratio) * trend(h, ratio, clock), clock[1] if h < wanted else 0.0)
            break
        memory.counts[REJECTED] += 1
        clock[1] = h * min(growth(ratio), 1.0)
        if h <= system.shortest * (1.0 + STRETCH):
            h = jump(system, left, memory)
            if h == 0.0:
                return NOT_FINITE
            clock[3] = 0.0
            break
        if not clock[1] > SMALLEST * end:
            return TOO_SMALL
    accept(system, target if h == left else clock[0] + h, memory)
    return REACHED


@register_jitable
def advance(system, target, end, memory):
    """Step to a sample time; return REACHED or the failure status."""
    while memory.clock[0] < target:
        if memory.counts[STEPS] >= system.most_steps:
            return TOO_MANY
        status = evaluate(system, memory.clock[0], memory.y, memory.slopes[0], memory)
        if status != REACHED:
            return status
        if memory.clock[1] == 0.0:
            memory.clock[1] = first_step(system, end, memory)
        status = step(system, target, end, memory)
        if status != REACHED:
            return status
    return REACHED


@njit(cache=True)
def integrate(system, times, samples, memory):
    """Write the states at the times into the rows of ``samples``; returns the status and the number of
    samples reached."""
    for k in range(times.shape[0]):
        status = advance(system, times[k], times[-1], memory)
        if status != REACHED:
            return status, k
        samples[k] = memory.y
    return REACHED, times.shape[0]
