"""The start of a step: the saved series that the step evaluates, and the return to it after a failed
attempt."""

from __future__ import annotations

from mbref.kernels.compilation import exchangeable, kernel
from mbref.kernels.layout import OK
from mbref.linear_algebra.vectors import copy
from mbref.taylor.correction import violation
from mbref.taylor.layout import PARTITION, RETURN_TO_START
from mbref.taylor.loads import TORSION, TORSION_SERIES
from mbref.taylor.partition import save_start_pivots
from mbref.taylor.simd import WIDTH, load, store
from mbref.taylor.solver import factorise_anew


@kernel
def save_series(memory):
    """Save the series that starts here as the one that the step evaluates; angles have no last order."""
    series, step, order = memory.series, memory.step, memory.mode.order
    for j in range(0, (order + 1) * series.terms.shape[1], WIDTH):
        store(load(series.terms, j), series.past, j)
    for s in range(series.past_angles.shape[0]):
        for k in range(order):
            series.past_angles[s, k] = series.torsions[TORSION_SERIES * s + TORSION, k]
        series.past_angles[s, order] = 0.0
    step.last_order = step.used_order = order
    step.time_to_pole = 0.0


@exchangeable(RETURN_TO_START)
def return_to_start(memory):
    """Restore the state, the partition and the pivots at the start of the step, and measure its violation."""
    past, terms = memory.series.past, memory.series.terms
    for k in range(2):
        copy(past[k], terms[k])
    memory.step.start_violation = violation(memory)
    if memory.partition.partition_id != memory.step.start_partition_id:
        memory.kernels.partition(memory)
        save_start_pivots(memory)
    return OK


@exchangeable(PARTITION)
def choose_partition(memory):
    """Choose a partition at the first coefficients, and compute its response; return its rank."""
    memory.partition.rank = memory.kernels.choose(memory)
    factorise_anew(memory)
    return memory.partition.rank
