"""MuJoCo's ``mj_forward`` as a C function that computes a state's rates for compiled code."""

from __future__ import annotations

import math

import numpy as np
from numba import carray, types
from numba.extending import register_jitable

from crosscheck.engines.mujoco.context import (
    AMPLITUDE,
    DATA,
    DRIVE,
    DRIVE_WIDTH,
    DRIVES,
    FORCE,
    FORWARD,
    FREQUENCY,
    INERTIA,
    MODEL,
    NQ,
    NV,
    PHASE,
    POLYNOMIAL,
    POSITION,
    QACC,
    QPOS,
    QVEL,
    SINGLE,
    SINGLES,
    TURN,
    TURNS,
    VELOCITY,
    WIDTH,
    Context,
)
from crosscheck.engines.shared.compiled.calls import RATES, c_function, call_with_two, integers, reals

SIGNATURE = types.int32(
    types.CPointer(types.intp), types.float64, types.CPointer(types.float64), types.CPointer(types.float64)
)


def load(context: Context, t: float, y: np.ndarray) -> None:
    """Put a state into the data, and compute the forces and accelerations that belong to it."""
    RATES(rates.address)(context.address, t, y.ctypes.data, np.empty(len(y)).ctypes.data)


@register_jitable
def prescribe(drive, t, qpos, qvel, force):
    """Set the value and rate of a driven coordinate, and the force of its acceleration."""
    value, rate, acceleration = 0.0, 0.0, 0.0
    for i in range(drive.shape[0] - 1, POLYNOMIAL - 1, -1):
        acceleration = acceleration * t + 2.0 * rate
        rate = rate * t + value
        value = value * t + drive[i]
    amplitude, frequency = drive[AMPLITUDE], drive[FREQUENCY]
    phase = frequency * t + drive[PHASE]
    v = int(drive[VELOCITY])
    qpos[int(drive[POSITION])] = value + amplitude * math.sin(phase)
    qvel[v] = rate + amplitude * frequency * math.cos(phase)
    force[v] = drive[INERTIA] * (acceleration - amplitude * frequency**2 * math.sin(phase))


@register_jitable
def turn_rates(q, omega, out):
    """Compute dq/dt = q/|q| (0, ω)/2 of a quaternion q (w, x, y, z) with ω in body axes."""
    half = 0.5 / math.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
    w, x, y, z = half * q[0], half * q[1], half * q[2], half * q[3]
    out[0] = -x * omega[0] - y * omega[1] - z * omega[2]
    out[1] = w * omega[0] + y * omega[2] - z * omega[1]
    out[2] = w * omega[1] + z * omega[0] - x * omega[2]
    out[3] = w * omega[2] + x * omega[1] - y * omega[0]


@register_jitable
def position_rates(c, qpos, qvel, out):
    """Compute the rates of qpos."""
    single, turn = carray(integers(c[SINGLE]), (c[SINGLES], 2)), carray(integers(c[TURN]), (c[TURNS], 2))
    for k in range(c[SINGLES]):
        out[single[k, 0]] = qvel[single[k, 1]]
    for k in range(c[TURNS]):
        q, v = turn[k]
        turn_rates(qpos[q : q + 4], qvel[v : v + 3], out[q : q + 4])


@register_jitable
def put(c, t, y):
    """Put a state into the data, with driven coordinates as prescribed at time t."""
    nq, nv = c[NQ], c[NV]
    qpos, qvel, state = carray(reals(c[QPOS]), (nq,)), carray(reals(c[QVEL]), (nv,)), carray(y, (nq + nv,))
    qpos[:], qvel[:] = state[:nq], state[nq:]
    drives = carray(reals(c[DRIVE]), (c[DRIVES], c[DRIVE_WIDTH]))
    for k in range(c[DRIVES]):
        prescribe(drives[k], t, qpos, qvel, carray(reals(c[FORCE]), (nv,)))
    return qpos, qvel


@c_function(SIGNATURE)
def rates(context, t, y, out):
    """Compute the rates (nq + nv,) of a state at time t (s) by mj_forward; returns 0."""
    c = carray(context, (WIDTH,))
    nq, nv = c[NQ], c[NV]
    qpos, qvel = put(c, t, y)
    call_with_two(c[FORWARD], c[MODEL], c[DATA])
    slope = carray(out, (nq + nv,))
    slope[nq:] = carray(reals(c[QACC]), (nv,))
    position_rates(c, qpos, qvel, slope)
    return 0
