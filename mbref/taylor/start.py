"""Judging the start of a motion, whose freedoms or velocities rounding may hide near a singular position."""

from __future__ import annotations

from numpy import sqrt

from mbref.equations.coordinates import copy_state
from mbref.kernels.compilation import kernel
from mbref.kernels.layout import OK, SINGULAR
from mbref.linear_algebra.vectors import larger, largest
from mbref.simulation.stepping import UNDECIDED
from mbref.taylor.partition import freedoms
from mbref.taylor.passage import ROOT, least_pivot
from mbref.taylor.samples import put_terms

OFF = 2e-7  # lengths or rad, and fastest velocities, by which a series may miss the start
FASTER = 0.05  # the same of velocities that drivers prescribe
BESIDE = 1e-7  # pivot of unit rows below which rounding turns a free motion by 1e-2
CLOSE = 5e-6  # the same, of a motion from rest by 1e-5
LATE = 3e-8  # of the fastest velocities, by which it may be off where it has left


@kernel
def judged_start(status, memory):
    """UNDECIDED in place of OK, or of a rank that rounding changes, where rounding hides the motion."""
    nearly_dependent = memory.run.equations.system.settings.nearly_dependent
    if nearly_dependent and (status == SINGULAR or (status == OK and hides_rank(memory))):
        return UNDECIDED
    memory.progress.resting = rests_beside(memory)
    if status == OK and (misses_state(memory) or is_turned(memory)):
        return UNDECIDED
    return status


@kernel
def hides_rank(memory):
    """Whether rounding hides the freedoms of a start at which rows are nearly dependent.

    Natural coordinates count others then, or the motion could go over to another branch.
    """
    beside = BESIDE if largest(memory.run.state.velocities) > 0.0 else ROOT
    if freedoms(memory) > 0 and least_pivot(memory) < beside:
        return True
    return memory.progress.freedoms != freedoms(memory)


@kernel
def misses_state(memory):
    """Whether the series misses the state in memory.

    Numbers were taken for rounding then, or rounding over the distance from a singular position turns
    velocities; drivers that prescribe them hold the motion all the same.
    """
    state, before = memory.run.state, memory.run.previous
    copy_state(state, before)
    put_terms(memory.series.terms, memory)
    moved, changed, speed = 0.0, 0.0, largest(before.velocities)
    for i in range(state.coordinates.shape[0]):
        moved = larger(moved, state.coordinates[i] - before.coordinates[i])
    for i in range(state.velocities.shape[0]):
        changed = larger(changed, state.velocities[i] - before.velocities[i])
    copy_state(before, state)
    allowed = OFF if freedoms(memory) > 0 else FASTER
    return moved > memory.progress.farthest or changed > allowed * speed


@kernel
def rests_beside(memory):
    """Whether a motion leaves from rest so near to a singular position that rounding may turn it."""
    at_rest = freedoms(memory) > 0 and not largest(memory.run.state.velocities) > 0.0
    return at_rest and least_pivot(memory) < CLOSE


@kernel
def is_turned(memory):
    """Whether rounding turns a motion that began at rest beside a singular position and is not clear of it.

    A row that is off by rounding moves the state by its ratio to the least pivot p, and turns the motion by
    as much again, which on a way as long as p gets a share √p of its speed.  Rows of equal loops may be off
    by nothing.
    """
    progress, pivot = memory.progress, least_pivot(memory)
    progress.resting = progress.resting and pivot < CLOSE
    return progress.resting and not progress.corrected <= LATE * sqrt(pivot)
