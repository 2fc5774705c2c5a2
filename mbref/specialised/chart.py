"""The chart of the coordinates that can move, by machine code of the scene's own (see ``build``).

Where a guard of that code does not hold, the kernels that serve every scene are asked.
"""

from __future__ import annotations

from dataclasses import replace

from llvmlite import ir
from numba import i8
from numba.extending import intrinsic

from mbref.equations.evaluation import expand, place
from mbref.equations.loads import has_angles
from mbref.kernels.arguments import opened, planned
from mbref.kernels.compilation import exchangeable, kernel
from mbref.kernels.layout import (
    ACCELERATION,
    ACCEPT,
    ANGLES,
    COLUMNS,
    COORDINATES,
    DENSE_VECTORS,
    EVALUATIONS,
    FACTORISATIONS,
    FRAMES,
    HANDOVER,
    LIVE,
    LOADS,
    MEMO,
    MOVING,
    MULTIPLIERS,
    NEWTON,
    NEWTON_TOLERANCE,
    OK,
    PHI,
    PROJECT_CODE,
    RATES,
    RATES_CODE,
    ROWS,
    STATE,
    TURNING,
)
from mbref.linear_algebra.sparse_cholesky import part
from mbref.linear_algebra.symbolic_factorisation import ROW
from mbref.linear_algebra.vectors import copy
from mbref.simulation.singular_crossing import NEVER
from mbref.stabilisation.all_coordinates import flush
from mbref.stabilisation.base import Stabilisation
from mbref.stabilisation.projection import MOST_ITERATIONS, ROUNDING, project, watch


@intrinsic
def call(typingctx, address, t, y, angles, out, more):
    """Call a piece of machine code; 0 when its guards held."""

    def generate(context, builder, signature, arguments):
        double, pointer = ir.DoubleType(), ir.DoubleType().as_pointer()
        kind = ir.FunctionType(ir.IntType(64), [double, *[pointer] * 4])
        data = [
            context.make_array(array)(context, builder, value).data
            for array, value in zip(signature.args[2:], arguments[2:], strict=True)
        ]
        return builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), [arguments[1], *data])

    return i8(address, t, y, angles, out, more), generate


@kernel
def evaluated(t, y, y_rate, ints, work, counts):
    """y' and the multipliers by the scene's own code; OK or HANDOVER."""
    counts[EVALUATIONS] += 1
    counts[FACTORISATIONS] += 1
    status = call(ints[LIVE][0, RATES_CODE], t, y, work[ANGLES][0], y_rate, work[ROWS][MULTIPLIERS])
    return OK if status == OK else HANDOVER


@exchangeable(RATES)
def rates(accelerate, t, y, y_rate, problem):
    ints, _floats, work, _pivots, _settings, counts = opened(problem)
    return evaluated(t, y, y_rate, ints, work, counts)


@exchangeable(RATES)
def observe(accelerate, t, y, y_rate, problem):
    """``rates``, with the state and the accelerations of all bodies."""
    ints, _floats, work, _pivots, _settings, counts = opened(problem)
    live, acceleration = ints[LIVE], work[COLUMNS][ACCELERATION]
    status = evaluated(t, y, y_rate, ints, work, counts)
    for k in range(live[0, TURNING]):
        acceleration[live[1, live[0, MOVING] + k]] = y_rate[live[0, MOVING] + k]
    expand(y, live, work[STATE])
    return status


@exchangeable(ACCEPT)
def accept(t, y, problem):
    """Project y by the scene's own code; the bodies' frames only where the loop needs them."""
    ints, _floats, work, _pivots, settings, counts = opened(problem)
    live, state = ints[LIVE], work[STATE]
    size, rows = live[0, MOVING] + live[0, TURNING], part(planned(problem), ROW).shape[0]
    memory = work[DENSE_VECTORS].reshape(-1)
    out, more = memory[:size], memory[size : size + 1 + rows]
    tolerance, violation = settings[NEWTON_TOLERANCE], NEVER
    for _ in range(MOST_ITERATIONS):
        counts[NEWTON] += 1
        counts[FACTORISATIONS] += 1
        if call(live[0, PROJECT_CODE], t, y, work[ANGLES][0], out, more) != OK:
            break
        copy(out, y[:size])
        before, violation = violation, more[0]
        if violation <= tolerance or before <= violation <= ROUNDING * tolerance:
            watch(more[1:], work[MEMO][0])
            flush(y[:size])
            work[ROWS][PHI, :] = violation
            expand(y, live, state)
            if has_angles(ints[LOADS]):
                place(state[COORDINATES], work[FRAMES])
            return OK
    return project(t, y, problem)


def with_own_code(chart: Stabilisation) -> Stabilisation:
    """The chart with the scene's own code before its kernels, which serve where a guard does not hold."""
    return replace(chart, rates=rates, observe=observe, accept=accept)
