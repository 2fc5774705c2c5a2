"""Chart whose vector y contains the entries in ``Memory.active``: all coordinates and velocities, or the
active coordinates and velocities.

y = (r, Euler parameters; r', ω'), body by body.
"""

from __future__ import annotations

from mbref.equations.coordinates import contract, coordinate_rates, expand, normalise
from mbref.equations.evaluation import assemble_system
from mbref.kernels.compilation import exchangeable, inlined
from mbref.kernels.layout import ACCEPT, ENTER, OK, RATES


@exchangeable(ENTER)
def enter(t, y, memory):
    state, active = memory.state, memory.active
    contract(state.coordinates, state.velocities, active, y)
    return active.coordinates.shape[0] + active.velocities.shape[0]


@exchangeable(RATES)
def rates(t, y, y_rate, memory):
    state, equations = memory.state, memory.equations
    expand(y, memory.active, state)
    assemble_system(t, state.coordinates, state.velocities, equations)
    status = memory.kernels.accelerate(equations.system)
    write_rates(y_rate, memory)
    return status


@inlined
def write_rates(y_rate, memory):
    """Compute y' of the entries of y from the accelerations."""
    state = memory.state
    coordinate_rates(state.coordinates, state.velocities, state.coordinate_rates)
    contract(state.coordinate_rates, memory.equations.system.acceleration, memory.active, y_rate)


@exchangeable(ACCEPT)
def accept(t, y, memory):
    state, active = memory.state, memory.active
    expand(y, active, state)
    normalise(state.coordinates)
    contract(state.coordinates, state.velocities, active, y)
    return OK
