"""Saved states of a run, saved starts of its series, and the series that a step evaluates."""

from __future__ import annotations

from mbref.kernels.compilation import kernel
from mbref.linear_algebra.vectors import copy
from mbref.taylor.joint_loads import TORSION, TORSION_SERIES
from mbref.taylor.simd import WIDTH, load, store


@kernel
def save_state(run, saved):
    """Save state and time of a run, the number of samples taken and of singular positions crossed."""
    clock, instant = run.loop.clock, saved.instant
    instant.time, instant.sample = clock.time, clock.sample
    instant.crossings = run.equations.system.counts.crossings
    copy(run.state.coordinates, saved.coordinates)
    copy(run.state.velocities, saved.velocities)
    copy(run.equations.angles, saved.angles)


@kernel
def restore_state(saved, run):
    """Restore the state of a run that was saved."""
    clock, instant = run.loop.clock, saved.instant
    clock.time, clock.sample = instant.time, instant.sample
    run.equations.system.counts.crossings = instant.crossings
    copy(saved.coordinates, run.state.coordinates)
    copy(saved.velocities, run.state.velocities)
    copy(saved.angles, run.equations.angles)


@kernel
def save_variables(series, angles, saved):
    """Save variables and rates, the first two orders of a series, and the angles of joints."""
    copy(series[0], saved.terms[0])
    copy(series[1], saved.terms[1])
    copy(angles, saved.angles)


@kernel
def restore_variables(saved, series, angles):
    """Restore the first two orders of a series, and angles, that ``save_variables`` saved."""
    copy(saved.terms[0], series[0])
    copy(saved.terms[1], series[1])
    copy(saved.angles, angles)


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
