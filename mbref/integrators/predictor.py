"""Predictor: no integration; Hermite extrapolation, for mechanisms whose motion the drivers prescribe.

The projection solves Φ(q, t) = 0 and Φ_q q' = ν from the predicted state, which is all there is to know
where no freedom is left: the kinematic analysis of Eqs. 1 to 3, in steps as long as the prediction is near
(Eq. 16 is its second order).  The polynomial goes through the last NODES states and their rates; how far it
is off is judged by the one through a state fewer, so that Newton's method stays with the branch.
"""

from __future__ import annotations

from mbref.integrators.base import Integrator
from mbref.integrators.one_step import propose
from mbref.kernels.arguments import opened
from mbref.kernels.compilation import exchangeable, kernel
from mbref.kernels.layout import LIVE, MOVING, STEP
from mbref.linear_algebra.vectors import copy, larger

NODES = 3
NEARNESS = 2e-2  # of the step: what the polynomial of a state fewer may be off; the prediction is much nearer
ROUNDING = 1e-9  # m or rad; what moves less is at rest but for rounding
ORDER = 3  # of the estimate as a part of the step
FOUND, TIMES, OTHER = range(2 * NODES, 2 * NODES + 3)  # rows of the memory after the nodes' states and rates


@kernel
def remember(t, y, y_rate, memory):
    """Make (t, y, y') the first of the nodes, unless it is from an earlier attempt; their number."""
    n, found, times = y.shape[0], int(memory[FOUND, 0]), memory[TIMES]
    if found > 0 and times[0] == t:
        return found
    for k in range(min(found, NODES - 1), 0, -1):
        copy(memory[2 * k - 2, :n], memory[2 * k, :n])
        copy(memory[2 * k - 1, :n], memory[2 * k + 1, :n])
        times[k] = times[k - 1]
    copy(y, memory[0, :n])
    copy(y_rate, memory[1, :n])
    times[0] = t
    memory[FOUND, 0] = min(found + 1, NODES)
    return int(memory[FOUND, 0])


@kernel
def add_hermite(t, found, memory, y):
    """y += the polynomial through the first ``found`` nodes at t."""
    n, times = y.shape[0], memory[TIMES]
    for j in range(found):
        basis, slope = 1.0, 0.0
        for k in range(found):
            if k != j:
                basis *= (t - times[k]) / (times[j] - times[k])
                slope += 1.0 / (times[j] - times[k])
        of_state = (1.0 - 2.0 * (t - times[j]) * slope) * basis * basis
        of_rate = (t - times[j]) * basis * basis
        for i in range(n):
            y[i] += of_state * memory[2 * j, i] + of_rate * memory[2 * j + 1, i]


@exchangeable(STEP)
def step(
    rates, accelerate, t, h, y, y_rate, y_new, memory, tolerances,
    problem,
):  # fmt: skip
    found, other = remember(t, y, y_rate, memory), memory[OTHER, : y.shape[0]]
    y_new[:] = 0.0
    add_hermite(t + h, found, memory, y_new)
    if found == 1:
        return 0.0
    other[:] = 0.0
    add_hermite(t + h, found - 1, memory, other)
    off, moved = 0.0, 0.0
    for i in range(opened(problem)[0][LIVE][0, MOVING]):
        off, moved = larger(off, y_new[i] - other[i]), larger(moved, y_new[i] - y[i])
    return off / (NEARNESS * max(moved, ROUNDING))


PREDICTOR = Integrator("predictor", ORDER, step, propose, 2 * NODES + 3, adaptive=True, integrates=False)
