"""Completion of samples: accelerations and multipliers at the states that the steps of a series have saved.

A series of second order about the sample gives the accelerations.  Near a singular position rounding divided
by the distance would dominate that series, so the second derivative of the high-accuracy step is used.
Multipliers balance the forces in the metric of a projection, so that bodies may lack inertia.
"""

from __future__ import annotations

from mbref.equations.evaluation import evaluate
from mbref.equations.functions import select_pieces
from mbref.equations.loads import remember_angles
from mbref.kernels.compilation import INT, entry, exchangeable, kernel
from mbref.kernels.layout import OK, SINGULAR
from mbref.linear_algebra.minimum_norm import ALPHA, find_least_multipliers
from mbref.linear_algebra.sparse_cholesky import regularised_factor
from mbref.linear_algebra.vectors import copy
from mbref.stepping.loop import take_sample
from mbref.taylor.layout import BALANCE, SAMPLE, SERIES
from mbref.taylor.loads import expand_functions
from mbref.taylor.samples import find_poses, put_state
from mbref.taylor.saved_state import restore_state, restore_variables, save_state, save_variables
from mbref.taylor.simd import WIDTH, load, store

SAMPLE_CORRECTIONS = 2  # corrections of a sample of a low-accuracy series; two reach rounding


@entry(INT(INT, SERIES))
def complete_samples(go_on, memory):
    """Complete the samples saved since the last call; return OK, or the failure status of the first sample
    without accelerations or multipliers, which is then not recorded.

    ``go_on`` is true if steps continue from the present series.
    """
    end = memory.run.loop.clock.sample
    if memory.progress.completed >= end:
        return OK
    save_state(memory.run, memory.before_samples)
    save_variables(memory.series.terms, memory.run.equations.angles, memory.series_start)
    status = complete_until(end, memory)
    if status == OK:
        restore_state(memory.before_samples, memory.run)
    if status == OK and go_on:
        return_to_series(memory)
    return status


@kernel
def complete_until(end, memory):
    """Complete the samples before ``end``; return OK, or the failure status of the sample at the time of the
    clock."""
    loop, progress, mode, status = memory.run.loop, memory.progress, memory.mode, OK
    order, tolerance = mode.order, mode.tolerance
    mode.order, mode.tolerance = 2, memory.options.accurate_tolerance
    while progress.completed < end and status == OK:
        loop.clock.sample, loop.clock.time = progress.completed, loop.times[progress.completed]
        select_pieces(loop.clock.time, memory.run.equations)
        status = memory.kernels.sample(memory)
        progress.completed = loop.clock.sample
    mode.order, mode.tolerance = order, tolerance
    return status


@exchangeable(SAMPLE)
def complete_sample(memory):
    """Record the sample at the clock; return OK or the failure status.

    The signs of its quaternions follow the rotations since the start, whatever other samples there are.
    """
    run, waiting = memory.run, memory.waiting
    k, status = run.loop.clock.sample, OK
    copy(waiting.coordinates[k], run.state.coordinates)
    copy(waiting.state[k], memory.state.reshape(-1))
    copy(waiting.angles[k], run.equations.angles)
    if not waiting.exact[k]:
        status = expand_at_sample(memory)
    find_poses(memory)
    put_state(memory)
    if status == OK:
        status = memory.kernels.balance(run.loop.times[k], memory)
    if status == OK:
        remember_angles(run.equations)
        take_sample(run)
    return status


@kernel
def expand_at_sample(memory):
    """Correct the variables in ``state``, and compute their second derivatives; return OK or the failure
    status."""
    terms, state, lanes = memory.series.terms, memory.state, memory.series.terms.shape[1]
    status = correct_sample(memory)
    if status != OK:  # later steps have chosen a partition that is singular here
        put_sample(memory)
        memory.kernels.partition(memory)
        status = correct_sample(memory)
    if status != OK:
        return status
    for j in range(0, lanes, WIDTH):
        store(load(terms, j), state, j)
        store(load(terms, lanes + j), state, lanes + j)
        store(2.0 * load(terms, 2 * lanes + j), state, 2 * lanes + j)
    return status


@kernel
def put_sample(memory):
    """Put the variables in ``state`` and their rates into the first terms of the series."""
    terms, state, variable = memory.series.terms, memory.state, memory.series.variable
    for j in range(0, terms.shape[1], WIDTH):
        store(load(variable, j) * load(state, j), terms, j)
        store(load(variable, j) * load(state, terms.shape[1] + j), terms, terms.shape[1] + j)


@kernel
def correct_sample(memory):
    """Correct the variables in ``state`` to rounding in the terms of the series; return OK or the failure
    status."""
    put_sample(memory)
    for _ in range(SAMPLE_CORRECTIONS if memory.options.follows_drivers else 1):
        status = memory.kernels.expand(memory.run.loop.clock.time, memory)
        if status != OK:
            return status
    return OK


@exchangeable(BALANCE)
def balance_forces(t, memory):
    """Compute multipliers λ with Φ_qᵀ λ = g - M q̈ at the state and accelerations in memory; return OK or
    SINGULAR.

    For redundant rows, they have the least norm in unit rows.
    """
    run, equations = memory.run, memory.run.equations
    system, factor = equations.system, run.factor
    system.counts.evaluations += 1
    evaluate(t, run.state.coordinates, run.state.velocities, equations)
    for j in range(system.force.shape[0]):
        system.force[j] -= system.mass[j] * system.acceleration[j]
    if not regularised_factor(factor, system.blocks.reshape(-1), equations.scene.metric_root, ALPHA):
        return SINGULAR
    find_least_multipliers(factor, system.force, system.multipliers)
    return OK


@kernel
def return_to_series(memory):
    """Restore the series about the saved variables in ``terms``."""
    restore_variables(memory.series_start, memory.series.terms, memory.run.equations.angles)
    select_pieces(memory.run.loop.clock.time, memory.run.equations)
    expand_functions(memory.run.loop.clock.time, memory)
    memory.kernels.partition(memory)
    memory.kernels.terms(memory)
