"""Samples: state, accelerations and multipliers that a run records at the sample times."""

from __future__ import annotations

from mbref.kernels.compilation import kernel
from mbref.linear_algebra.vectors import copy


@kernel
def take_sample(memory):
    """Record state, accelerations and multipliers of the last evaluation."""
    samples, state, system = memory.loop.samples, memory.state, memory.equations.system
    k = memory.loop.clock.sample
    copy(state.coordinates, samples.coordinates[k])
    copy(state.velocities, samples.velocities[k])
    copy(system.acceleration, samples.accelerations[k])
    copy(system.multipliers, samples.multipliers[k])
    memory.loop.clock.sample = k + 1
