"""Where a motion that turns back inside a step stands still, and how near a singular position that is."""

from __future__ import annotations

from mbref.kernels.compilation import kernel
from mbref.taylor.partition import eliminate, put_gradient
from mbref.taylor.samples import evaluate_series

HALVINGS = 40  # of the search for the place


@kernel
def turns_back(rates, memory):
    """Whether rates of the variables, in row 1, point against those where the step began."""
    past, along = memory.series.past, 0.0
    for i in range(memory.solver.pivot_columns.shape[0]):
        along += past[1, i] * rates[1, i]
    return along <= 0.0


@kernel
def pivot_of_turning(h, memory):
    """The least pivot of G where a motion stands still that turns back in a step of h seconds."""
    solver, start, end, least = memory.solver, 0.0, h, 1.0
    for _ in range(HALVINGS):
        middle = 0.5 * (start + end)
        evaluate_series(middle, memory)
        if turns_back(memory.state, memory):
            end = middle
        else:
            start = middle
    put_gradient(memory.state, memory)
    for k in range(memory.progress.rank):
        least = min(least, abs(solver.work[solver.pivot_rows[k], solver.pivot_columns[k]]))
        eliminate(solver.work, solver.pivot_rows, solver.pivot_columns, k)
    evaluate_series(h, memory)
    return least
