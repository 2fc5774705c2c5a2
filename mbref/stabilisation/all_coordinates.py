"""The chart of the entries in ``ints[LIVE]``, which are all unless a projection leaves out what cannot move.

y = (r, Euler parameters; r', ω'), body by body.
"""

from __future__ import annotations

from numpy import sqrt

from mbref.equations.evaluation import accelerations, contract, coordinate_rates, expand
from mbref.kernels.arguments import opened
from mbref.kernels.compilation import exchangeable, inlined
from mbref.kernels.layout import (
    ACCELERATION,
    ACCEPT,
    COLUMNS,
    COORDINATE_RATES,
    COORDINATES,
    ENTER,
    LIVE,
    MOVING,
    OK,
    RATES,
    STATE,
    TURNING,
    VELOCITIES,
)

TINY = 1e-100  # its cube is still a normal number


@exchangeable(ENTER)
def enter(t, y, problem):
    ints, _floats, work, _pivots, _settings, _counts = opened(problem)
    live, state = ints[LIVE], work[STATE]
    contract(state[COORDINATES], state[VELOCITIES][: work[COLUMNS].shape[1]], live, y)
    return live[0, MOVING] + live[0, TURNING]


@exchangeable(RATES)
def rates(accelerate, t, y, y_rate, problem):
    ints, floats, work, pivots, settings, counts = opened(problem)
    live, state = ints[LIVE], work[STATE]
    expand(y, live, state)
    q, v = state[COORDINATES], state[VELOCITIES][: work[COLUMNS].shape[1]]
    status = accelerations(accelerate, t, q, v, ints, floats, work, pivots, settings, counts)
    write_rates(q, v, live, y_rate, work)
    return status


@inlined
def write_rates(q, v, live, y_rate, work):
    """y' of the entries of y, from the accelerations found."""
    rates_of_q = work[STATE][COORDINATE_RATES]
    coordinate_rates(q, v, rates_of_q)
    contract(rates_of_q, work[COLUMNS][ACCELERATION], live, y_rate)


@inlined
def flush(y):
    """Zero for what has decayed below TINY: with denormal numbers arithmetic is a hundred times slower."""
    for k in range(y.shape[0]):
        if abs(y[k]) < TINY:
            y[k] = 0.0


@inlined
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
