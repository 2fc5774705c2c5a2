"""Saved states of a run, and saved starts of its series, to which it can return."""

from __future__ import annotations

from mbref.kernels.compilation import kernel
from mbref.linear_algebra.vectors import copy


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
