"""The chart of the coordinates that can move, by machine code of the scene's own (see ``build``).

Where a guard of that code does not hold, the kernels that serve every scene give the rates; where the rows
it was given are no longer independent, it hands over to the generic chart.
"""

from __future__ import annotations

from llvmlite import ir
from numba import i8
from numba.extending import intrinsic

from mbref.compiled import exchangeable
from mbref.evaluation import accelerations, contract, coordinate_rates, expand, move, place
from mbref.problem import opened
from mbref.singular import NEAR, WINDOW
from mbref.stabilisation.base import Stabilisation
from mbref.stabilisation.projection import MOST_ITERATIONS, watch_pivot
from mbref.tables import (
    ACCELERATION,
    ACCEPT,
    ANGLES,
    COLUMNS,
    COORDINATE_RATES,
    COORDINATES,
    DENSE,
    ENTER,
    EVALUATIONS,
    FACTORISATIONS,
    FRAMES,
    HANDOVER,
    LIVE,
    MEMO,
    MOVING,
    MULTIPLIERS,
    NEWTON,
    NEWTON_TOLERANCE,
    OBSERVE_CODE,
    OK,
    PROJECT_CODE,
    RATES,
    RATES_CODE,
    REDUNDANT,
    REFERENCE_PIVOT,
    ROWS,
    SIZES,
    STATE,
    TURNING,
    VELOCITIES,
)

LAST_RESORT = 0.1 * WINDOW  # of the smallest pivot, where no row is redundant: a leap may land inside


@intrinsic
def call(typingctx, address, t, y, angles, out):
    """Call a piece of machine code; 0 when its guards held."""

    def generate(context, builder, signature, arguments):
        double, pointer = ir.DoubleType(), ir.DoubleType().as_pointer()
        kind = ir.FunctionType(ir.IntType(64), [double, pointer, pointer, pointer])
        data = [
            context.make_array(array)(context, builder, value).data
            for array, value in zip(signature.args[2:], arguments[2:], strict=True)
        ]
        return builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), [arguments[1], *data])

    return i8(address, t, y, angles, out), generate


@exchangeable(ENTER)
def enter(t, y, problem):
    """The entries that move, from ``work[STATE]`` into y; their number."""
    ints, _floats, work, _pivots, _settings, _counts = opened(problem)
    live, state = ints[LIVE], work[STATE]
    contract(state[COORDINATES], state[VELOCITIES], live, y)
    return live[0, MOVING] + live[0, TURNING]


@exchangeable(RATES)
def rates(accelerate, t, y, y_rate, problem):
    """y' by the scene's own code."""
    ints, _floats, work, _pivots, _settings, counts = opened(problem)
    counts[EVALUATIONS] += 1
    counts[FACTORISATIONS] += 1
    return OK if call(ints[LIVE][0, RATES_CODE], t, y, work[ANGLES][0], y_rate) == OK else HANDOVER


@exchangeable(RATES)
def observe(accelerate, t, y, y_rate, problem):
    """y' by the scene's own code, with the accelerations and multipliers of all bodies and rows."""
    ints, _floats, work, _pivots, _settings, counts = opened(problem)
    live, state, acceleration = ints[LIVE], work[STATE], work[COLUMNS][ACCELERATION]
    out, size, multipliers = work[DENSE].reshape(-1), y.shape[0], work[ROWS][MULTIPLIERS]
    counts[EVALUATIONS] += 1
    counts[FACTORISATIONS] += 1
    if call(live[0, OBSERVE_CODE], t, y, work[ANGLES][0], out) != OK:
        return HANDOVER
    for k in range(size):
        y_rate[k] = out[k]
    for row in range(multipliers.shape[0]):
        multipliers[row] = out[size + row]
    for k in range(acceleration.shape[0]):
        acceleration[k] = 0.0
    for k in range(live[0, TURNING]):
        acceleration[live[1, live[0, MOVING] + k]] = y_rate[live[0, MOVING] + k]
    expand(y, live, state)
    return OK


@exchangeable(RATES)
def careful(accelerate, t, y, y_rate, problem):
    """y' by the kernels that serve every scene."""
    ints, floats, work, pivots, settings, counts = opened(problem)
    live, state = ints[LIVE], work[STATE]
    expand(y, live, state)
    q, v = state[COORDINATES], state[VELOCITIES][: work[COLUMNS].shape[1]]
    status = accelerations(accelerate, t, q, v, ints, floats, work, pivots, settings, counts)
    coordinate_rates(q, v, state[COORDINATE_RATES])
    contract(state[COORDINATE_RATES], work[COLUMNS][ACCELERATION], live, y_rate)
    return status


@exchangeable(ACCEPT)
def accept(t, y, problem):
    """Project y by the scene's own code, and tell the loop where the bodies are."""
    ints, _floats, work, pivots, settings, counts = opened(problem)
    live, memo, state = ints[LIVE], work[MEMO][0], work[STATE]
    size, rank = live[0, MOVING] + live[0, TURNING], pivots[SIZES, 0]
    out, least = work[DENSE].reshape(-1), NEAR if live[0, REDUNDANT] else LAST_RESORT
    for _ in range(MOST_ITERATIONS):
        counts[NEWTON] += 1
        counts[FACTORISATIONS] += 1
        status = call(live[0, PROJECT_CODE], t, y, work[ANGLES][0], out)
        violation, pivot = out[size], out[size + 1]
        if status != OK or not pivot > least * memo[REFERENCE_PIVOT]:
            return HANDOVER
        for k in range(size):
            y[k] = out[k]
        if violation <= settings[NEWTON_TOLERANCE]:
            watch_pivot(pivot, rank, work)
            expand(y, live, state)
            place(state[COORDINATES], work[FRAMES])
            move(state[VELOCITIES][: work[COLUMNS].shape[1]], work[FRAMES])
            return OK
    return HANDOVER


MOVING_ONLY = Stabilisation("projection", "Bayo & Ledesma 1996", enter, rates, observe, careful, accept)
