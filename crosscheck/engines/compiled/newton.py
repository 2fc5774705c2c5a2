"""A mechanism that only drivers move, followed from sample to sample in compiled code by a C function that
meets its closures at a time."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from crosscheck.engines.compiled.calls import rates_of
from crosscheck.engines.compiled.dop853 import EVALUATIONS, NOT_FINITE, REACHED, STEPS, is_finite

NOT_MET = 10  # further status of the way to a sample: closures are not satisfied
STRETCH = 1e-9  # relative extension of a step that ends at a sample


class System(NamedTuple):
    """``int follow(void *context, double t, double *y, double *numbers)`` moves a state y to time t, and is 0
    where it could; numbers are a tolerance, the evaluations so far, and the time of y."""

    function: int
    context: int
    tolerance: float
    longest: float  # s; of a step


@njit(cache=True)
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
    """States at the times into the rows of ``samples``; how it ended, and the number of samples reached."""
    numbers = np.zeros(3)
    numbers[0] = system.tolerance
    for k in range(times.shape[0]):
        status = advance(system, times[k], memory, numbers)
        memory.counts[EVALUATIONS] = int(numbers[1])
        if status != REACHED:
            return status, k
        samples[k] = memory.y
    return REACHED, times.shape[0]
