"""The stepping loop: from sample time to sample time, compiled, no Python object inside."""

from __future__ import annotations

from numpy import isnan

from mbref.equations.coordinates import copy_state, fastest_turn
from mbref.equations.evaluation import rate_of_row
from mbref.equations.functions import end_of_pieces, select_pieces
from mbref.equations.loads import advance_angles
from mbref.kernels.compilation import INT, entry, kernel
from mbref.kernels.layout import CHANGED, MEMORY, NOT_FINITE, OK, SINGULAR_AHEAD
from mbref.linear_algebra.vectors import all_finite, copy
from mbref.stepping.watch import (
    keep_position,
    meets_singular_position,
    remember_watch,
)

# status codes of a call, in addition to evaluation statuses (SINGULAR, …)
DONE, VIOLATED, STEP_TOO_SMALL, TOO_MANY_STEPS, PAUSED, UNDECIDED, LEFT_MOTION, CREEPING = range(10, 18)

# steps up to which tolerances are not reduced; steps after which the mean step length is known
MANY, PACE = 1000.0, 50
LEAST_TOLERANCE, EARLY = 1e-13, 1e-2  # least tolerance of a step; tolerance of first steps / rtol


@kernel
def take_sample(memory):
    """Record state, accelerations, multipliers and angles of the last evaluation."""
    samples, state, system = memory.loop.samples, memory.state, memory.equations.system
    k = memory.loop.clock.sample
    copy(state.coordinates, samples.coordinates[k])
    copy(state.velocities, samples.velocities[k])
    copy(system.acceleration, samples.accelerations[k])
    copy(system.multipliers, samples.multipliers[k])
    copy(memory.equations.angles, samples.angles[k])
    memory.loop.clock.sample = k + 1


@kernel
def worst_row(phi):
    """Return the row with the largest violation; -1 without rows."""
    worst = -1
    for row in range(phi.shape[0]):
        if worst < 0 or abs(phi[row]) > abs(phi[worst]):
            worst = row
    return worst


@kernel
def check_state(y, y_rate, memory):
    """Return OK if a state is finite and no row is violated beyond the limit, otherwise NOT_FINITE or
    VIOLATED."""
    if not (all_finite(y) and all_finite(y_rate)):
        return NOT_FINITE
    phi = memory.equations.rows.phi
    row = worst_row(phi)
    memory.loop.clock.violated_row = row
    if row >= 0 and abs(phi[row]) > memory.control.violation:
        return VIOLATED
    return OK if memory.equations.scene.velocity_rows.shape[0] == 0 else check_rates(memory)


@kernel
def check_rates(memory):
    """Return VIOLATED if Φ' of a row is larger than rounding or drift, otherwise OK; rows between velocities,
    of wheels that roll, are first."""
    equations, v, control = memory.equations, memory.state.velocities, memory.control
    velocity_rows, m, greatest = equations.scene.velocity_rows, equations.rows.phi.shape[0], 0.0
    for row in range(m):
        greatest = max(greatest, rate_of_row(row, v, equations)[1])
    for k in range(velocity_rows.shape[0] + m):
        row = velocity_rows[k] if k < velocity_rows.shape[0] else k - velocity_rows.shape[0]
        value, size = rate_of_row(row, v, equations)
        if abs(value) > max(control.rest, control.rate * max(size, control.rate_share * greatest)):
            memory.loop.clock.violated_row = row
            return VIOLATED
    return OK


@kernel
def remember_accepted_state(t, memory):
    """Save the accepted state, from which dependent coordinates are predicted and angles are unwrapped."""
    copy_state(memory.state, memory.previous)
    memory.watch.accepted_time = t
    advance_angles(t - memory.watch.angle_time, memory.equations)
    memory.watch.angle_time = t


@kernel
def largest_step(memory):
    """Return the longest step that the user's limit and the fastest rotating body allow."""
    control, fastest = memory.control, fastest_turn(memory.state.velocities)
    h = control.largest_step
    return min(h, control.largest_turn / fastest) if fastest > 0.0 else h


@kernel
def share(suggested, memory):
    """Return the factor on rtol and atol for a step: 1, or (MANY / N)² if more than MANY steps N are
    expected.

    Errors of a motion's frequency add up to a phase error that grows with the square of the time. The number
    of steps is estimated from the mean step length so far, at first also from the suggested step (s). First
    steps may be far shorter than later ones, so that the factor of first steps is at least EARLY.
    """
    loop, steps, least = (
        memory.loop,
        memory.equations.system.counts.steps,
        LEAST_TOLERANCE / memory.control.rtol,
    )
    reached, end = loop.clock.time, loop.times[loop.times.shape[0] - 1]
    if steps < PACE:
        reached, least = max(reached, steps * suggested), max(least, EARLY)
    if not steps * end > MANY * reached:
        return 1.0
    part = MANY * reached / (steps * end)
    return min(1.0, max(part * part, least))


@kernel
def step_within(interval, h):
    """Return the next step towards the end of an interval: the interval, its half, or h."""
    if h * (1.0 + 1e-9) >= interval:
        return interval
    return 0.5 * interval if 2.0 * h > interval else h


@entry(INT(MEMORY))
def advance_to_end(memory):
    """Advance until the last sample time, a failure, or the number of steps per call; return the status."""
    loop, clock, counts = memory.loop, memory.loop.clock, memory.equations.system.counts
    taken, times = 0, memory.loop.times
    while True:
        y, y_rate = loop.y[: clock.y_size], loop.y_rate[: clock.y_size]
        status = evaluate_state(y, y_rate, memory)
        if status != OK:
            return status
        for _ in range(clock.sample, times.shape[0]):
            if clock.time < times[clock.sample]:
                break
            take_sample(memory)
        if clock.sample == times.shape[0]:
            return DONE
        if counts.steps >= memory.control.most_steps:
            return TOO_MANY_STEPS
        if taken >= memory.control.steps_per_call:
            return PAUSED
        status = advance(times[clock.sample], y, y_rate, memory)
        if status != OK:
            return status
        if clock.sample == times.shape[0]:
            return DONE
        taken += 1


@kernel
def evaluate_state(y, y_rate, memory):
    """Evaluate y' at the present time, with outputs at a sample time; check and save the state."""
    clock, kernels = memory.loop.clock, memory.kernels
    t = clock.time
    select_pieces(t, memory.equations)
    if t >= memory.loop.times[clock.sample]:
        status = kernels.rates_with_outputs(t, y, y_rate, memory)
    else:
        status = kernels.rates(t, y, y_rate, memory)
    if status == OK:
        status = check_state(y, y_rate, memory)
    if status == OK:
        remember_accepted_state(t, memory)
    return status


@kernel
def accept_step(now, h, suggested, ratio, memory):
    """Correct and keep the new state; return OK, CHANGED (new coordinates), or the status of the failure.

    SINGULAR_AHEAD, with nothing saved, if the step reaches or passes a singular position.
    """
    loop, counts = memory.loop, memory.equations.system.counts
    clock = loop.clock
    status = memory.kernels.accept(now, loop.y_new, memory)
    if status == SINGULAR_AHEAD:
        keep_position(1.0, now - clock.time, memory)
    elif status == OK and meets_singular_position(now - clock.time, memory):
        status = SINGULAR_AHEAD
    if status == SINGULAR_AHEAD:
        clock.attempt_end = now
    if status == OK or status == CHANGED:  # noqa: SIM109 - no containers in kernels
        counts.steps += 1
        copy(loop.y_new, loop.y)
        clock.past_length, clock.past_ratio = clock.length, clock.ratio
        clock.time, clock.length, clock.suggested, clock.ratio = now, h, suggested, ratio
        if status == CHANGED:
            clock.restart = counts.steps
        else:
            remember_watch(memory)
    return status


@kernel
def advance(target, y, y_rate, memory):
    """Take one accepted step towards the target time (s), with as many attempts as needed. A step ends at the
    end of a piece of a function of time, where a new smooth piece of the motion begins.
    """
    loop, control, counts = memory.loop, memory.control, memory.equations.system.counts
    propose, take_step = memory.kernels.propose, memory.kernels.step
    clock, end = loop.clock, end_of_pieces(memory.equations)
    target = min(target, end)
    t, interval, y_new = clock.time, target - clock.time, loop.y_new[: clock.y_size]
    suggested = propose(clock.length, clock.suggested, clock.ratio, y, y_rate, memory)
    clock.share = share(suggested, memory)
    if counts.steps == 0 and control.first_step > 0.0:
        suggested = control.first_step
    suggested = min(max(suggested, control.forced_step), largest_step(memory))
    while True:
        if control.fixed_step > 0.0:
            h = interval / max(1.0, -(-(interval / control.fixed_step - 1e-6) // 1.0))
        else:
            h = step_within(interval, suggested)
        ratio = take_step(memory.kernels.rates, t, h, y, y_rate, y_new, memory)
        status = NOT_FINITE if isnan(ratio) else (OK if ratio >= 0.0 else int(-ratio))
        if h <= control.forced_step:
            ratio = min(ratio, 1.0)
        if status == OK and ratio <= 1.0:
            status = accept_step(target if h == interval else t + h, h, suggested, ratio, memory)
            if status == OK or status == CHANGED:  # noqa: SIM109 - no containers in kernels
                if clock.time >= end:
                    clock.restart = counts.steps
                return OK
            if status == SINGULAR_AHEAD:
                return status
        counts.rejected += 1
        if control.fixed_step > 0.0:
            return status
        suggested = propose(h, suggested, ratio if status == OK else -float(status), y, y_rate, memory)
        if status == OK:
            suggested = max(suggested, control.forced_step)
        if suggested < control.smallest_step:
            return STEP_TOO_SMALL if status == OK else status
