"""Uniqueness of the continuation: bound or measure the amplification of an error of the start by a crossing.

The state before a singular position is known to the tolerance only. If drivers prescribe the whole motion,
errors are not amplified.

A mechanism of one degree of freedom without drivers moves along a curve. In the arc length σ of the metric of
M, σ'' = Q(σ) - c(σ) σ' with c ≥ 0, because loads and dampers do not depend on time. By Liouville's formula a
motion that starts faster by a fraction ε, with v = σ', is ahead by δσ = ε v₀² v ∫ W / v² dt, with the speed
v₀ at the start and W = exp(-∫ c dt) ≤ 1. Its variables x are ahead by at most ε x' ∫ v₀² / v² dt. If this
bound is small, no further run is needed.

If the bound is large, a perturbed run repeats the crossing from slightly larger velocities: the motion is
determined if both runs end in nearby states.
"""

from __future__ import annotations

from mbref.kernels.compilation import kernel
from mbref.kernels.layout import OK
from mbref.linear_algebra.vectors import copy, larger
from mbref.taylor.coefficients import largest_coefficient, turns_back
from mbref.taylor.crossing.thresholds import (
    BOUND_MARGIN,
    MAX_APART,
    MAX_GAIN,
    MIN_CHANGE,
    MIN_ENERGY,
    RATE_FACTOR,
    STRICTER,
)
from mbref.taylor.samples import evaluate_series
from mbref.taylor.saved_state import restore_state


# --- bound ----------------------------------------------------------------------------------------------
@kernel
def kinetic_energy(rates, memory):
    """Return x'ᵀ M x' of the rates in row 1: twice the kinetic energy, lengths in units of the scene."""
    mass, total = memory.polynomials.inertia.mass, 0.0
    for i in range(mass.shape[0]):
        for j in range(mass.shape[0]):
            total += rates[1, i] * mass[i, j] * rates[1, j]
    return total


@kernel
def energy_in_middle(memory):
    """Return ``kinetic_energy`` in the middle of the last step."""
    evaluate_series(0.5 * memory.run.loop.clock.length, memory)
    return kinetic_energy(memory.state, memory)


@kernel
def keeps_moving(least, first, memory):
    """Return whether the motion has not reversed in the last step, and has not lost nearly all of its initial
    kinetic energy."""
    moved = kinetic_energy(memory.series.past, memory) > 0.0
    reverses = moved and turns_back(memory.series.terms, memory)
    return least > 0.0 and least >= MIN_ENERGY * first and not reverses


@kernel
def is_bounded(delay, memory):
    """Return whether a motion with a slightly changed velocity stays near the motion that crosses.

    ``delay`` = ∫ v₀² / v² dt (s) over the crossing, with the speed v and its value v₀ at the start.  The
    change of velocity times ``delay`` bounds the distance of the two motions.
    """
    change = memory.options.velocity_change
    speed = largest_coefficient(memory.series.terms, 1, memory.solver.pivot_columns.shape[0])
    near = STRICTER * min(MAX_GAIN * change, MAX_APART)
    return change * speed * delay <= BOUND_MARGIN * near


# --- perturbed run --------------------------------------------------------------------------------------
@kernel
def perturbed_run_agrees(rtol, memory):
    """Return whether a perturbed run of the crossing ends near the state at which the series now begins.

    The limit is stricter if the perturbed run counts another number of singular positions, because a step may
    cross two.
    """
    run, end, terms = memory.run, memory.crossing_end, memory.series.terms
    counted, change = run.equations.system.counts.crossings, max(rtol, MIN_CHANGE)
    for order in range(2):
        copy(terms[order], end[order])
    if not run_perturbed(change, run.loop.clock.time, memory):
        return False
    places, rates, variables = 0.0, 0.0, memory.solver.pivot_columns.shape[0]
    for i in range(variables):
        places = larger(places, terms[0, i] - end[0, i])
        rates = larger(rates, terms[1, i] - end[1, i])
    near = min(MAX_GAIN * change, MAX_APART)
    if run.equations.system.counts.crossings != counted:
        near *= STRICTER
    return places <= near and rates <= RATE_FACTOR * near * largest_coefficient(end, 1, variables)


@kernel
def run_perturbed(change, until, memory):
    """Repeat the crossing until a time (s) from velocities larger by a fraction; return whether the run
    reaches that time."""
    run, clock, counts = memory.run, memory.run.loop.clock, memory.run.equations.system.counts
    restore_state(memory.crossing_start, run)
    for i in range(run.state.velocities.shape[0]):
        run.state.velocities[i] *= 1.0 + change
    clock.sample, memory.progress.end = run.loop.times.shape[0], until  # the perturbed run takes no samples
    status = memory.kernels.begin(memory)
    while status == OK and clock.time < until and counts.steps < run.control.most_steps:
        status = memory.kernels.step(memory)
    return status == OK and clock.time >= until
