"""Snapshots of a run: its state at a time, kept in memory and gone back to."""

from __future__ import annotations

from mbref.kernels.compilation import kernel
from mbref.linear_algebra.vectors import copy


@kernel
def take_snapshot(run, snapshot):
    """Keep the state of a run, its time, the samples taken and the singular positions passed."""
    clock, instant = run.loop.clock, snapshot.instant
    instant.time, instant.sample = clock.time, clock.sample
    instant.crossings = run.equations.system.counts.crossings
    copy(run.state.coordinates, snapshot.coordinates)
    copy(run.state.velocities, snapshot.velocities)
    copy(run.equations.angles, snapshot.angles)


@kernel
def return_to_snapshot(snapshot, run):
    """Bring a run back to the state that was kept."""
    clock, instant = run.loop.clock, snapshot.instant
    clock.time, clock.sample = instant.time, instant.sample
    run.equations.system.counts.crossings = instant.crossings
    copy(snapshot.coordinates, run.state.coordinates)
    copy(snapshot.velocities, run.state.velocities)
    copy(snapshot.angles, run.equations.angles)
