"""Acceptance of a step that comes near a singular position or crosses a singular position, and the tolerance
of such steps.

- If two branches are separated by a gap g, the series of one side continues straight to the other side.
Beyond the gap it violates the rows by at least g.  A step near a singular position is therefore as
  accurate as rounding allows, and accepted only if the violation at its end is due to rounding.
- Near a singular position rounding moves the state along the nearly free direction by (rounding / pivot), and
changes the direction of the velocity by that displacement over the pivot.  A motion that comes nearer than
MIN_PIVOT and does not cross is
  UNDECIDED.  Rounding of the lengths may open a gap that a motion meets before it turns back nearer than
  MIN_PIVOT_FREE: such a motion is UNDECIDED, too.  ``uniqueness`` judges other motions.
- A correction that moves the state by as much as its distance from the singular position may change the
  branch.  If a driver stands still at the singular position, the pivot itself depends on the correction.
"""

from __future__ import annotations

from mbref.kernels.compilation import exchangeable, kernel
from mbref.kernels.layout import OK
from mbref.stepping.loop import SINGULAR_AHEAD, STEP_TOO_SMALL, UNDECIDED
from mbref.taylor.coefficients import turns_back
from mbref.taylor.crossing.detection import (
    ends_deep,
    ends_near_singular,
    is_near_singular,
)
from mbref.taylor.crossing.thresholds import (
    BISECTIONS,
    CROSSING_NOISE,
    CROSSING_START,
    ENTRY_RATIO,
    MAX_SHIFT,
    MIN_PIVOT,
    MIN_PIVOT_ACROSS,
    MIN_PIVOT_FREE,
    MIN_PIVOT_RATIO_ACROSS,
    MIN_PIVOT_RESOLVED,
    TIME_ROUNDING,
    VIOLATION_ACROSS,
    VIOLATION_FLOOR,
    VIOLATION_LEFT,
    VIOLATION_NEAR,
)
from mbref.taylor.layout import TURNING_PIVOT
from mbref.taylor.mode import is_accurate
from mbref.taylor.partition import eliminate_below, freedoms, least_pivot
from mbref.taylor.samples import evaluate_series


@kernel
def relative_distance(memory):
    """Return the least pivot at the start of the step relative to the largest pivot."""
    return memory.distance.start_pivot / memory.distance.largest_pivot


@kernel
def step_tolerance(memory):
    """Return the tolerance of a step, which is smaller near a singular position, because the motion is more
    curved there."""
    return memory.mode.tolerance * min(1.0, relative_distance(memory))


@kernel
def crossing_tolerance(memory):
    """Return the tolerance of a step that crosses; the last terms of its series are rounding divided by the
    distance."""
    distance = relative_distance(memory)
    if is_accurate(memory) and memory.distance.approaching and distance < CROSSING_START:
        return max(memory.mode.tolerance, CROSSING_NOISE / distance)
    return step_tolerance(memory)


@kernel
def violation_by_rounding(memory):
    """Return the violation of the rows that rounding explains at the end of a step near a singular position.

    Drivers have the rounding of the time.  Corrections do not reduce the violation of dependent rows.
    """
    step, terms, rounding, speed = memory.step, memory.series.terms, VIOLATION_FLOOR, 0.0
    if memory.polynomials.given.driver.shape[0] > 0:
        for i in range(memory.solver.pivot_columns.shape[0]):
            speed = max(speed, abs(terms[1, i]))
        rounding = max(rounding, TIME_ROUNDING * memory.run.loop.clock.time * speed)
    if step.crossed:
        return max(VIOLATION_ACROSS, rounding)
    return max(VIOLATION_NEAR * relative_distance(memory), rounding, VIOLATION_LEFT * step.start_violation)


@kernel
def judge_branch(h, last, memory):
    """Return OK, or the status that refuses a step of h seconds because its branch is in doubt.

    Regular steps return SINGULAR_AHEAD if a singular position is near.
    """
    step, pivot = memory.step, least_pivot(memory)
    step.crossed = memory.kernels.detect(h, pivot, memory)
    if not is_accurate(memory):
        return SINGULAR_AHEAD if step.crossed or ends_near_singular(pivot, memory) else OK
    if not (step.crossed or is_near_singular(pivot, memory)):
        return OK
    turned = turns_back(memory.series.terms, memory)
    if step.crossed:
        return judge_crossing(pivot, turned, last, memory)
    return judge_approach(h, pivot, turned, last, memory)


@kernel
def judge_crossing(pivot, turned, last, memory):
    """Return OK, or the status that refuses a high-accuracy step that crosses a singular position."""
    step, distance = memory.step, memory.distance
    if turned:
        return STEP_TOO_SMALL
    if distance.start_pivot < min(MIN_PIVOT_ACROSS * distance.largest_pivot, distance.entry_pivot):
        return UNDECIDED
    is_shallow = pivot < MIN_PIVOT_RATIO_ACROSS * distance.start_pivot and not last
    if (
        is_shallow
        or not step.violation <= violation_by_rounding(memory)
        or step.correction > MAX_SHIFT * pivot
    ):
        return STEP_TOO_SMALL
    return OK


@kernel
def judge_approach(h, pivot, turned, last, memory):
    """Return OK, or the status that refuses a high-accuracy step near a singular position."""
    step, distance = memory.step, memory.distance
    if (ends_deep(memory) and not last) or not step.violation <= violation_by_rounding(memory):
        return STEP_TOO_SMALL
    if step.correction > MAX_SHIFT * pivot:
        return STEP_TOO_SMALL if last else UNDECIDED
    resolved = MIN_PIVOT_FREE if freedoms(memory) > 0 else MIN_PIVOT_RESOLVED
    resolved = min(resolved, ENTRY_RATIO * distance.entry_pivot)
    if turned and memory.kernels.turning_pivot(h, memory) < resolved:
        return UNDECIDED
    if pivot >= distance.start_pivot:
        return OK
    return OK if pivot >= max(resolved, MIN_PIVOT * distance.largest_pivot) else UNDECIDED


@exchangeable(TURNING_PIVOT)
def pivot_at_turning_point(h, memory):
    """Return the least pivot of G at the turning point of a motion that reverses in a step of h seconds."""
    solver, start, end, least = memory.solver, 0.0, h, 1.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (start + end)
        evaluate_series(middle, memory)
        if turns_back(memory.state, memory):
            end = middle
        else:
            start = middle
    memory.kernels.gradient(memory.state, memory)
    for k in range(memory.partition.rank):
        pivot = abs(solver.work[solver.pivot_rows[k], solver.pivot_columns[k]])
        least = min(least, solver.unit[solver.pivot_columns[k]] * pivot)
        eliminate_below(solver.work, solver.pivot_rows, solver.pivot_columns, k)
    evaluate_series(h, memory)
    return least
