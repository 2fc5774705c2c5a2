"""The steps of a Taylor method: as long as the last terms allow, each judged where it ends.

Steps follow À. Jorba and M. Zou (Experimental Mathematics 14, 2005).  Where a step ends, the constraint rows
are violated by what the series has lost, which is corrected, and the accelerations of the equations differ
from the series'.  Where either is more than the tolerance explains, or rows have become dependent, the step
ends earlier: so a series that continues beyond a singular position passes it, and no other does.
"""

from __future__ import annotations

from numpy import exp, isfinite, log

from mbref.kernels.compilation import exchangeable, kernel
from mbref.kernels.layout import NOT_FINITE, OK, SINGULAR_AHEAD
from mbref.linear_algebra.vectors import copy, larger
from mbref.simulation.stepping import STEP_TOO_SMALL, UNDECIDED, share
from mbref.taylor.correction import correct, violation
from mbref.taylor.crossing import count_crossings
from mbref.taylor.layout import BEGIN, EXPAND, STEP
from mbref.taylor.loads import (
    ANGLE,
    TORSION_SERIES,
    expand_drivers,
    part_behind_no_length,
    time_to_no_length,
)
from mbref.taylor.meeting import meet, time_to_meet
from mbref.taylor.partition import choose
from mbref.taylor.passage import (
    BEFORE,
    distance_ahead,
    exactness,
    exactness_across,
    judge_branch,
    least_pivot,
    remember_pivots,
    remember_pivots_here,
    size_in_use,
)
from mbref.taylor.pose_maps import read_variables
from mbref.taylor.samples import evaluate_series, keep_sample, put_angles
from mbref.taylor.series import expand, expand_with_multipliers, turns_back_in
from mbref.taylor.simd import WIDTH, load, store
from mbref.taylor.solver import factorise_anew
from mbref.taylor.start import is_turned, judged_start

ROUNDING = 1e-12  # of rows
LOST_ROWS = 100.0  # tolerances by which rows may be off
LOST_MOTION = 30.0  # tolerances, times orders², by which accelerations times the step's square may be off
NOISE = 1e-9  # the same, by rounding
SHORTER = 0.7
LOOSER = 1e4  # of rates in a passage: they count where a step is short beside the motion's own time
NEARLY = 0.2  # of a step's first pivot: a step that ends nearer to a singular position is tried beyond it
CROSSING = 1.05  # of the time in which a singular position is met: a longer step crosses it
BEST = 0.6  # of a step that crosses: where it begins, from the singular position
WORTH = 0.5  # of a step that a series with its rounding allows: a series without it allows as long a one
OVER = 1.25  # its length then, over the distance; the same to where a spring has no length


@exchangeable(EXPAND)
def expand_from(t, memory):
    """Correct the state at time t and expand it: OK or why it cannot be."""
    expand_drivers(t, memory)
    status = correct(memory)
    if status == OK:
        expand(memory)
    return status


@kernel
def longest_step(tolerance, memory):
    """The step at which the last two terms of the series are as large as the tolerance.

    So are those of its rate, over the largest rate where that is above 1; in a passage, which asks for
    rounding anyway, they may be LOOSER, and do not count near a singular position.  It is at
    most clearly over the time in which a spring's ends could meet.
    """
    progress, control = memory.progress, memory.run.control
    h = control.largest_step
    shortest, of_rates = log(h), tolerance * max(1.0, size_in_use(1, memory))
    if progress.passing:
        of_rates *= LOOSER
    counted = not progress.passing or progress.past_pivot >= BEFORE * progress.largest_pivot
    for k in range(progress.top - 1, min(progress.top + 1, progress.order) + 1):
        size = size_in_use(k, memory)
        if size > 0.0:
            shortest = min(shortest, log(tolerance / size) / k)
            if counted:
                shortest = min(shortest, log(of_rates / (k * size)) / (k - 1))
    h = min(exp(shortest), OVER * time_to_no_length(memory))
    if memory.run.equations.system.counts.steps == 0 and control.first_step > 0.0:
        h = min(h, control.first_step)
    return h


@kernel
def first_lengths(left, memory):
    """The longest step (s) by the tolerance, and by that of one that crosses; not beyond the time left."""
    progress = memory.progress
    whole = 1.0 if progress.passing else share(memory.run.loop.clock.length, memory.run)
    usual, looser = exactness(progress), exactness_across(progress)
    exact = min(longest_step(whole * usual, memory), left)
    if not progress.passing:
        return exact, exact
    across = exact if looser == usual else min(longest_step(whole * looser, memory), left)
    ahead, progress.ahead = progress.meets if progress.meets > 0.0 else progress.ahead, 0.0
    if across < CROSSING * ahead and exact > (1.0 - NEARLY) * ahead:
        exact = across = ahead - BEST * across
    return exact, across


@kernel
def keep_terms(memory):
    """The terms, which are looked along from now on; angles have no last order."""
    series, progress = memory.series, memory.progress
    for j in range(0, (progress.order + 1) * series.terms.shape[1], WIDTH):
        store(load(series.terms, j), series.past, j)
    for s in range(series.past_angles.shape[0]):
        for k in range(progress.order):
            series.past_angles[s, k] = series.torsions[TORSION_SERIES * s + ANGLE, k]
        series.past_angles[s, progress.order] = 0.0
    progress.top = progress.cut = progress.order
    progress.meets = 0.0


@kernel
def keep_series(memory):
    """Have steps look along the series that begins here, without its rounding unless that makes them short:
    beside a near position few orders may be left that rounding does not outgrow."""
    keep_terms(memory)
    distance = time_to_meet(memory)
    if distance != 0.0:
        tolerance = exactness(memory.progress)
        reached = longest_step(tolerance, memory)
        meet(distance, memory)
        if not longest_step(tolerance, memory) > WORTH * reached:
            keep_terms(memory)


@kernel
def remember_series(memory):
    """Keep the series of the step's beginning, and the pivots there."""
    remember_pivots(memory)
    keep_series(memory)


@kernel
def judge(h, last, memory):
    """OK where rows and accelerations at the end of a step are off by no more than the tolerance explains.

    Behind a position where a spring has no length, all of the time counts in which accelerations are off.
    """
    progress, state, terms = memory.progress, memory.state, memory.series.terms
    if not progress.violation <= LOST_ROWS * progress.tolerance + ROUNDING:
        return STEP_TOO_SMALL
    status = judge_branch(h, last, memory)
    if status != OK:
        return status
    if progress.resting and is_turned(memory):
        return UNDECIDED
    off, size = 0.0, 1.0
    for i in range(memory.solver.pivot_columns.shape[0]):
        off = larger(off, (2.0 * terms[2, i] - state[2, i]) * h * h)
        size = larger(size, state[2, i] * h * h)
    if not isfinite(off):
        return NOT_FINITE
    part = part_behind_no_length(memory)
    if part > 0.0:
        rates = size_in_use(1, memory)
        if off * part > exactness_across(progress) * rates * h:
            return STEP_TOO_SMALL
    lost = LOST_MOTION * progress.order * progress.order * exactness_across(progress)
    return OK if off <= lost + NOISE * size else STEP_TOO_SMALL


@kernel
def expand_at(h, last, memory):
    """Expand at a distance h (s), to the second order if it is the last step: OK or why it cannot be."""
    progress, terms, state = memory.progress, memory.series.terms, memory.state
    evaluate_series(h, memory)
    lanes, variable = terms.shape[1], memory.series.variable
    for j in range(0, lanes, WIDTH):
        store(load(variable, j) * load(state, j), terms, j)
        store(load(variable, j) * load(state, lanes + j), terms, lanes + j)
    put_angles(h, memory)
    order = progress.order
    progress.order = 2 if last else order
    status = memory.kernels.expand(memory.run.loop.clock.time + h, memory)
    progress.order = order
    return status


@kernel
def attempt(h, last, memory):
    """Step to a distance h (s), expand there, and judge the step."""
    status = expand_at(h, last, memory)
    return judge(h, last, memory) if status == OK else status


@kernel
def return_to_start(memory):
    """Back to where the step began: rows and variables as chosen there, and the violation that is left."""
    progress, past, terms = memory.progress, memory.series.past, memory.series.terms
    for k in range(2):
        copy(past[k], terms[k])
    progress.left = violation(memory)
    if progress.choice != progress.past_choice:
        choose(memory)
        factorise_anew(memory)
        remember_pivots_here(memory)


@kernel
def next_length(h, exact, memory):
    """The length (s) of the attempt after one of h seconds: clearly over the singular position that it came
    near to or crossed, by the series without its rounding; else one that does not reach it."""
    progress = memory.progress
    near = progress.crossed or least_pivot(memory) < NEARLY * progress.past_pivot
    if progress.cut == progress.top and near and h > exact:
        over = OVER * distance_ahead(h, memory)
        progress.cut = least_term(over, memory)
        return over
    progress.cut = progress.top
    return exact if h > exact else h * SHORTER


@kernel
def least_term(h, memory):
    """The order, below the last, of the least term at a distance h (s): those beyond grow by rounding."""
    best, least, power = 2, 1e300, h
    for k in range(2, memory.progress.top):
        power *= h
        size = size_in_use(k, memory) * power
        if size < least:
            best, least = k, size
    return best


@exchangeable(STEP)
def step(memory):
    """One step, as many attempts as it takes, and the samples on its way."""
    loop, control, counts = memory.run.loop, memory.run.control, memory.run.equations.system.counts
    clock, times, progress = loop.clock, loop.times, memory.progress
    remember_series(memory)
    left, progress.left = progress.end - clock.time, 0.0
    exact, h = first_lengths(left, memory)
    if turns_back_in(h, memory):
        expand_with_multipliers(memory)
        keep_series(memory)
        exact, h = first_lengths(left, memory)
    if 0.0 < progress.meets < h and not progress.passing:
        clock.passage = clock.time + h
        return SINGULAR_AHEAD
    while True:
        status = attempt(h, h >= left, memory)
        if status == OK and (progress.crossed or h <= exact):
            break
        if status == SINGULAR_AHEAD or (status == UNDECIDED and (progress.crossed or h <= exact)):
            clock.passage, progress.ahead = clock.time + h, distance_ahead(h, memory)
            return status
        counts.rejected += 1
        h = min(next_length(h, exact, memory), left)
        return_to_start(memory)
        if not h >= control.smallest_step:
            return status
    now = progress.end if h >= left else clock.time + h
    while clock.sample < times.shape[0] and times[clock.sample] <= now:
        keep_sample(times[clock.sample] - clock.time, memory)
    put_angles(h, memory)
    counts.steps += 1
    counts.crossings += count_crossings(h, memory) if progress.crossed else 0
    clock.time, clock.length = now, h
    return OK


@exchangeable(BEGIN)
def begin(memory):
    """Choose the partition at the present state and expand there: OK or why that cannot be."""
    t, slot = memory.run.loop.clock.time, memory.polynomials.torsions.slot
    for s in range(slot.shape[0]):
        memory.angles[s] = memory.run.equations.angles[slot[s]]
    read_variables(t, memory)
    expand_drivers(t, memory)
    memory.progress.rank, memory.progress.crossed, memory.progress.leaving = choose(memory), 0, 0
    memory.progress.resting = 0
    factorise_anew(memory)
    status = memory.kernels.expand(t, memory)
    return status if t > 0.0 else judged_start(status, memory)
