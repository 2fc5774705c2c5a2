"""The chart of the active coordinates by code specialised for the scene (see ``build``).

Where a guard of that code does not hold, the general kernels are asked.
"""

from __future__ import annotations

from dataclasses import replace

from llvmlite import ir
from numba import i8
from numba.extending import intrinsic

from mbref.equations.coordinates import expand
from mbref.equations.evaluation import set_poses
from mbref.equations.loads import has_angles
from mbref.kernels.compilation import exchangeable, inlined, kernel
from mbref.kernels.layout import ACCEPT, GUARD_FAILED, OK, RATES
from mbref.linear_algebra.vectors import copy, flush_denormals
from mbref.stabilisation.base import Stabilisation
from mbref.stabilisation.projection import FACTOR_FAILED, newton_loop, project, watch


@intrinsic
def call(typingctx, address, t, y, angles, numbers, out, more):
    """Call a piece of machine code; 0 when its guards held."""

    def generate(context, builder, signature, arguments):
        double, pointer = ir.DoubleType(), ir.DoubleType().as_pointer()
        kind = ir.FunctionType(ir.IntType(64), [double, *[pointer] * 5])
        data = [
            context.make_array(array)(context, builder, value).data
            for array, value in zip(signature.args[2:], arguments[2:], strict=True)
        ]
        return builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), [arguments[1], *data])

    return i8(address, t, y, angles, numbers, out, more), generate


@kernel
def evaluate_by_code(t, y, y_rate, memory):
    """y' and the multipliers by specialised code; OK or GUARD_FAILED."""
    system, angles = memory.equations.system, memory.equations.angles
    system.counts.evaluations += 1
    system.counts.factorisations += 1
    code = memory.code
    status = call(code.addresses.rates, t, y, angles, code.numbers, y_rate, system.multipliers)
    return OK if status == OK else GUARD_FAILED


@exchangeable(RATES)
def rates(t, y, y_rate, memory):
    return evaluate_by_code(t, y, y_rate, memory)


@exchangeable(RATES)
def rates_with_outputs(t, y, y_rate, memory):
    """``rates``, with the state and the accelerations of all bodies."""
    active, acceleration = memory.active, memory.equations.system.acceleration
    status = evaluate_by_code(t, y, y_rate, memory)
    nq = active.coordinates.shape[0]
    for k in range(active.velocities.shape[0]):
        acceleration[active.velocities[k]] = y_rate[nq + k]
    expand(y, active, memory.state)
    return status


@inlined
def newton_step_by_code(t, y, before, memory):
    """One Newton step of the projection of y by specialised code; the largest |Φ| before it."""
    code, size, angles = memory.code, memory.loop.clock.y_size, memory.equations.angles
    memory.equations.system.counts.factorisations += 1
    if call(code.addresses.project, t, y, angles, code.numbers, code.y, code.outputs) != OK:
        return FACTOR_FAILED
    copy(code.y[:size], y[:size])
    return code.outputs[0]


project_by_code = newton_loop(newton_step_by_code)


@exchangeable(ACCEPT)
def accept(t, y, memory):
    """Project y by specialised code; the bodies' frames only where torsion springs need them."""
    if project_by_code(t, y, memory) != OK:
        return project(t, y, memory)
    outputs, equations = memory.code.outputs, memory.equations
    watch(outputs[1 : 1 + memory.factor.symbolic.row.shape[0]], memory.pivots, memory.watch)
    flush_denormals(y[: memory.loop.clock.y_size])
    equations.rows.phi[:] = outputs[0]
    expand(y, memory.active, memory.state)
    if has_angles(equations.scene.loads):
        set_poses(memory.state.coordinates, equations.frames)
    return OK


def with_specialised_code(chart: Stabilisation) -> Stabilisation:
    """The chart with specialised code before its kernels, which serve where a guard does not hold."""
    return replace(chart, rates=rates, rates_with_outputs=rates_with_outputs, accept=accept)
