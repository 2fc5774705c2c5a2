"""The chart of all coordinates: y = (r, Euler parameters of every body; r', ω' of every body)."""

from __future__ import annotations

from numpy import sqrt

from mbref.compiled import exchangeable, kernel
from mbref.evaluation import accelerations, coordinate_rates
from mbref.problem import opened
from mbref.tables import (
    ACCELERATION,
    ACCEPT,
    COLUMNS,
    COORDINATE_RATES,
    COORDINATES,
    ENTER,
    OK,
    RATES,
    STATE,
    VELOCITIES,
)

TINY = 1e-100  # its cube is still a normal number


@kernel
def copy_state(state, y):
    """Coordinates and velocities of ``work[STATE]`` into y; the length of y."""
    nq = state.shape[1]
    nv = 6 * (nq // 7)
    for k in range(nq):
        y[k] = state[COORDINATES, k]
    for k in range(nv):
        y[nq + k] = state[VELOCITIES, k]
    return nq + nv


@exchangeable(ENTER)
def enter(t, y, problem):
    _ints, _floats, work, _pivots, _settings, _counts = opened(problem)
    return copy_state(work[STATE], y)


@exchangeable(RATES)
def rates(accelerate, t, y, y_rate, problem):
    ints, floats, work, pivots, settings, counts = opened(problem)
    nq, nv = work[STATE].shape[1], work[COLUMNS].shape[1]
    q, v = y[:nq], y[nq : nq + nv]
    status = accelerations(accelerate, t, q, v, ints, floats, work, pivots, settings, counts)
    write_rates(q, v, y_rate, work)
    return status


@kernel
def write_rates(q, v, y_rate, work):
    """y' from the accelerations found, and the state into ``work[STATE]``."""
    state, acceleration = work[STATE], work[COLUMNS][ACCELERATION]
    nq, nv = q.shape[0], v.shape[0]
    coordinate_rates(q, v, y_rate)
    for k in range(nv):
        y_rate[nq + k] = acceleration[k]
        state[VELOCITIES, k] = v[k]
    for k in range(nq):
        state[COORDINATES, k] = q[k]
        state[COORDINATE_RATES, k] = y_rate[k]


@kernel
def flush(y):
    """Zero for what has decayed below TINY: with denormal numbers arithmetic is a hundred times slower."""
    for k in range(y.shape[0]):
        if abs(y[k]) < TINY:
            y[k] = 0.0


@kernel
def normalise(q):
    """Euler parameters of every body back to unit length."""
    for b in range(q.shape[0] // 7):
        square = 0.0
        for k in range(3, 7):
            square += q[7 * b + k] * q[7 * b + k]
        inverse = 1.0 / sqrt(square)
        for k in range(3, 7):
            q[7 * b + k] *= inverse


@exchangeable(ACCEPT)
def accept(t, y, problem):
    _ints, _floats, work, _pivots, _settings, _counts = opened(problem)
    normalise(y[: work[STATE].shape[1]])
    return OK
