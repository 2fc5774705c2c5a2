"""Compiled kinematics of a fully driven mechanism: a C function satisfies the closures at each time from
sample to sample."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numba.extending import register_jitable

from crosscheck.engines.shared.compiled.calls import rates_of
from crosscheck.engines.shared.compiled.dop853 import EVALUATIONS, NOT_FINITE, REACHED, STEPS, is_finite

NOT_MET = 10  # further status: the closures could not be satisfied at a time
STRETCH = 1e-9  # relative extension of a step so that it ends at a sample


class System(NamedTuple):
    """The C function ``int follow(void *context, double t, double *y, double *numbers)``, which moves a state
    y to time t.

    It returns 0 if it succeeds. ``numbers`` are a tolerance, the count of evaluations, and the time of y.
    """

    function: int
    context: int
    tolerance: float
    longest: float  # s; longest step


@register_jitable
def advance(system, target, memory, numbers):
    """Take equal steps to a sample time; return REACHED or the failure status."""
    start = memory.clock[0]
    count = max(1, math.ceil((target - start) / system.longest * (1.0 - STRETCH)))
    for k in range(count):
        t = target if k == count - 1 else start + (target - start) * (k + 1) / count
        status = rates_of(system.function, system.context, t, memory.y.ctypes.data, numbers.ctypes.data)
        if status != 0:
            return NOT_MET
        if not is_finite(memory.y):
            return NOT_FINITE
        memory.clock[0] = t
        memory.counts[STEPS] += 1
    return REACHED


@njit(cache=True)
def integrate(system, times, samples, memory):
    """Write the states at the times into the rows of ``samples``; returns the status and the number of
    samples reached."""
    numbers = np.zeros(3)
    numbers[0] = system.tolerance
    for k in range(times.shape[0]):
        status = advance(system, times[k], memory, numbers)
        memory.counts[EVALUATIONS] = int(numbers[1])
        if status != REACHED:
            return status, k
        samples[k] = memory.y
    return REACHED, times.shape[0]
