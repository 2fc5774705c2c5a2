"""Judgement of a motion that starts near a singular position, where rounding may hide its degrees of freedom
or velocity."""

from __future__ import annotations

from numpy import sqrt

from mbref.equations.coordinates import copy_state
from mbref.kernels.compilation import exchangeable, kernel
from mbref.kernels.layout import OK, SINGULAR
from mbref.linear_algebra.vectors import larger, largest
from mbref.stepping.loop import UNDECIDED
from mbref.taylor.crossing.thresholds import (
    MIN_PIVOT_FREE,
    MIN_PIVOT_RESOLVED,
    REST_PIVOT,
    REST_TURN,
    START_ERROR,
    START_ERROR_DRIVEN,
)
from mbref.taylor.layout import JUDGE_START
from mbref.taylor.partition import freedoms, least_pivot
from mbref.taylor.samples import put_terms


@exchangeable(JUDGE_START)
def judge_start(status, memory):
    """Return the status of the start, or UNDECIDED if rounding hides the motion.

    ``status`` is OK, or SINGULAR for a rank that rounding changes.
    """
    nearly_dependent = memory.run.equations.system.settings.nearly_dependent
    if nearly_dependent and (status == SINGULAR or (status == OK and hides_rank(memory))):
        return UNDECIDED
    memory.distance.rests_near = rests_near(memory)
    if status == OK and (misses_state(memory) or is_turned(memory)):
        return UNDECIDED
    return status


@kernel
def hides_rank(memory):
    """Return whether rounding hides the degrees of freedom of a start at which rows are nearly dependent.

    Natural coordinates then give another number, or the motion could change to another branch.
    """
    is_moving = largest(memory.run.state.velocities) > 0.0
    if freedoms(memory) > 0 and least_pivot(memory) < (MIN_PIVOT_RESOLVED if is_moving else MIN_PIVOT_FREE):
        return True
    return memory.options.start_freedoms != freedoms(memory)


@kernel
def misses_state(memory):
    """Return whether the series misses the state in memory.

    In this case small numbers were wrongly treated as rounding, or rounding divided by the distance from a
    singular position has changed the direction of the velocities. Velocities that drivers prescribe determine
    the motion nevertheless.
    """
    state, before = memory.run.state, memory.run.previous
    copy_state(state, before)
    put_terms(memory.series.terms, memory)
    moved, changed, speed = 0.0, 0.0, larger(largest(before.velocities), memory.options.rest_speed)
    for i in range(state.coordinates.shape[0]):
        moved = larger(moved, state.coordinates[i] - before.coordinates[i])
    for i in range(state.velocities.shape[0]):
        changed = larger(changed, state.velocities[i] - before.velocities[i])
    copy_state(before, state)
    allowed = START_ERROR if freedoms(memory) > 0 else START_ERROR_DRIVEN
    return moved > memory.options.start_distance or changed > allowed * speed


@kernel
def rests_near(memory):
    """Return whether a motion starts from rest so near to a singular position that rounding may change its
    direction."""
    at_rest = freedoms(memory) > 0 and not largest(memory.run.state.velocities) > 0.0
    return at_rest and least_pivot(memory) < REST_PIVOT


@kernel
def is_turned(memory):
    """Return whether rounding changes the direction of a motion that started at rest near a singular position
    and is still near it. A rounding error of a row moves the state by (error / p) with the least pivot p. The
    error also changes the direction of the motion, which gains a fraction √p of its speed over a distance p.
    Rows of loops with equal dimensions may have no rounding error.
    """
    distance, pivot = memory.distance, least_pivot(memory)
    distance.rests_near = distance.rests_near and pivot < REST_PIVOT
    return distance.rests_near and not memory.step.correction <= REST_TURN * sqrt(pivot)
