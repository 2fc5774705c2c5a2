"""Brief passages: few exact steps over a singular position, on a motion whose speed tells it determined.

A mechanism of one freedom without drivers moves along a curve.  In the arc length σ of the metric of M,
σ'' = Q(σ) - c(σ) σ' with c ≥ 0: loads and dampers do not depend on time.  By Liouville's formula a motion
that begins faster by a part ε, with v = σ', is ahead by δσ = ε v₀² v ∫ W / v² dt, W = exp(-∫ c dt) ≤ 1, and
its variables by ε x' ∫ v₀² / v² dt at most.  Where that is small beside the distance at which twins disagree,
no twin is needed (``mbref.taylor.twin``); where it is not, or the exact steps do not cross, the series is as
it was, and a longer passage judges (``mbref.taylor.passing``).
"""

from __future__ import annotations

from mbref.kernels.compilation import kernel
from mbref.kernels.layout import OK
from mbref.linear_algebra.vectors import copy
from mbref.taylor.partition import freedoms, is_undriven
from mbref.taylor.passage import least_pivot, size_of
from mbref.taylor.samples import evaluate_series, put_angles, put_state_at
from mbref.taylor.start import judged_start
from mbref.taylor.stepping import return_to_start
from mbref.taylor.turning import turns_back
from mbref.taylor.twin import APART, CLOSER, MAGNIFIED

SLOWEST = 0.02  # of the kinetic energy where the passage began: it does not fall below
LULL = 0.5  # of the distance at which twins are apart: a margin for the error of the integral
MOST_STEPS = 6  # of a brief passage


@kernel
def step_exactly(memory):
    """Have the next steps be exact ones, which pass singular positions."""
    progress = memory.progress
    progress.passing, progress.tolerance, progress.order = 1, progress.exact, progress.exact_order
    progress.past_pivot = 1.0


@kernel
def step_usually(memory):
    """Have the next steps be usual ones, which run up to singular positions."""
    progress = memory.progress
    progress.passing, progress.tolerance, progress.order = 0, progress.usual, progress.usual_order


@kernel
def may_be_brief(memory):
    """Whether the motion has no freedom, or one and no drivers."""
    return freedoms(memory) <= is_undriven(memory)


@kernel
def parts_at(crossing, memory):
    """Whether another branch than the smooth one is asked for at a singular position, counted from 1."""
    for number in memory.parting:  # noqa: SIM110 - no generators in kernels
        if number == crossing:
            return True
    return False


@kernel
def is_full(memory):
    """Whether there is no room for the singular positions of another step, which meets two at most."""
    return memory.progress.passed + 2 > memory.crossings.time.shape[0]


@kernel
def parts_in_pair(before, memory):
    """Whether the last step met two singular positions, behind a number of them, and another branch than the
    smooth one is asked for at one."""
    if memory.run.equations.system.counts.crossings < before + 2:
        return False
    return parts_at(before + 1, memory) or parts_at(before + 2, memory)


@kernel
def pass_briefly(memory):
    """Whether the singular position ahead of where the last step began is passed; else all is as it was."""
    clock, counts = memory.run.loop.clock, memory.run.equations.system.counts
    if not may_be_brief(memory) or is_full(memory):
        return False
    time, sample, passage = clock.time, clock.sample, clock.passage
    steps, crossings = counts.steps, counts.crossings
    save_step_start(memory)
    return_to_start(memory)
    step_exactly(memory)
    status = memory.kernels.expand(time, memory)
    if time == 0.0:
        status = judged_start(status, memory)
    passed = status == OK and crosses(memory)
    step_usually(memory)
    if not passed:
        clock.time, clock.sample, clock.passage = time, sample, passage
        counts.steps, counts.crossings = steps, crossings
        restore_step_start(memory)
    return passed


@kernel
def save_step_start(memory):
    """Keep the variables where the last step began, and the angles there, which are those of the run."""
    saved, past = memory.step_start, memory.series.past
    for order in range(2):
        copy(past[order], saved.terms[order])
    put_angles(0.0, memory)
    copy(memory.angles, saved.angles)


@kernel
def restore_step_start(memory):
    """Have the last step begin again where ``save_step_start`` found it."""
    saved, slot = memory.step_start, memory.polynomials.torsions.slot
    for order in range(2):
        copy(saved.terms[order], memory.series.past[order])
    for s in range(slot.shape[0]):
        memory.run.equations.angles[slot[s]] = saved.angles[s]


@kernel
def crosses(memory):
    """Whether few exact steps cross a singular position, which is recorded, on a determined motion."""
    clock, counts, progress = memory.run.loop.clock, memory.run.equations.system.counts, memory.progress
    crossings = counts.crossings
    first, slower, delay = energy(memory.series.terms, memory), 1.0, 0.0
    progress.entered = least_pivot(memory)
    for _ in range(MOST_STEPS):
        if clock.time >= progress.end or memory.kernels.step(memory) != OK:
            return False
        middle, after = energy_in_middle(memory), energy(memory.series.terms, memory)
        if not keeps_moving(min(middle, after), first, memory):
            return False
        delay += clock.length * (slower + 4.0 * first / middle + first / after) / 6.0
        slower = first / after
        if counts.crossings != crossings:
            is_certain = magnifies_little(delay, memory) and not parts_in_pair(crossings, memory)
            if is_certain:
                record_crossings(memory)
            progress.leaving = is_certain
            return is_certain
    return False


@kernel
def energy(rates, memory):
    """x'ᵀ M x' of the rates in row 1: twice the kinetic energy, lengths in units of the scene's."""
    mass, total = memory.polynomials.inertia.mass, 0.0
    for i in range(mass.shape[0]):
        for j in range(mass.shape[0]):
            total += rates[1, i] * mass[i, j] * rates[1, j]
    return total


@kernel
def energy_in_middle(memory):
    """The energy in the middle of the last step."""
    evaluate_series(0.5 * memory.run.loop.clock.length, memory)
    return energy(memory.state, memory)


@kernel
def keeps_moving(least, first, memory):
    """Whether a motion that has a freedom has neither turned back in the last step nor lost nearly all of its
    first energy."""
    if freedoms(memory) == 0:
        return True
    moved = energy(memory.series.past, memory) > 0.0
    return least >= SLOWEST * first and not (moved and turns_back(memory.series.terms, memory))


@kernel
def magnifies_little(delay, memory):
    """Whether a passage keeps twins together: by ∫ v₀² / v² dt (s), by Simpson's rule in each step."""
    progress = memory.progress
    if freedoms(memory) == 0:
        return True
    speed = size_of(memory.series.terms, 1, memory.solver.pivot_columns.shape[0])
    near = CLOSER * min(MAGNIFIED * progress.change, APART)
    return progress.change * speed * delay <= LULL * near


@kernel
def record_crossings(memory):
    """Record time and state where the last step crossed."""
    progress = memory.progress
    record_at(progress.first, memory)
    if progress.second >= 0.0:
        record_at(progress.second, memory)


@kernel
def record_at(h, memory):
    """Record time and state at a distance h (s) from where the last step began."""
    run, crossings, k = memory.run, memory.crossings, memory.progress.passed
    length = run.loop.clock.length
    put_state_at(h, memory)
    crossings.time[k] = run.loop.clock.time - (length - h)
    copy(run.state.coordinates, crossings.coordinates[k])
    copy(run.state.velocities, crossings.velocities[k])
    memory.progress.passed = k + 1
