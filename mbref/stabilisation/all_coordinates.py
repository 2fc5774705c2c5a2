"""Chart whose vector y contains the entries in ``Memory.active``: all coordinates and velocities, or the
active coordinates and velocities.

y = (r, Euler parameters; r', ω'), body by body.
"""

from __future__ import annotations

from mbref.equations.coordinates import contract, coordinate_rates, expand, normalise
from mbref.equations.evaluation import assemble_system, evaluate
from mbref.kernels.compilation import exchangeable, inlined, kernel
from mbref.kernels.layout import ACCEPT, ENTER, OK, RATES, SINGULAR, Equations, SparseFactor
from mbref.kernels.named_memory import opener
from mbref.linear_algebra.minimum_norm import ALPHA, find_least_multipliers
from mbref.linear_algebra.sparse_cholesky import regularised_factor

equations_of, factor_of = opener(Equations), opener(SparseFactor)


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


@exchangeable(RATES)
def rates_and_balance(t, y, y_rate, memory):
    """Compute y' as ``rates`` does, and multipliers of all rows, of which steps use a part."""
    state, equations = memory.state, memory.equations
    expand(y, memory.active, state)
    assemble_system(t, state.coordinates, state.velocities, equations)
    status = memory.kernels.accelerate(equations.system)
    write_rates(y_rate, memory)
    return balance_sample(t, memory) if status == OK else status


@kernel
def balance_sample(t, memory):
    """Compute multipliers λ of all rows with Φ_qᵀ λ = g - M q̈; return OK or SINGULAR.

    For redundant rows, they have the least norm in rows of unit length in the metric of M.
    """
    state, equations, factor = memory.state, equations_of(memory.sampled), factor_of(memory.balance)
    system = equations.system
    evaluate(t, state.coordinates, state.velocities, equations)
    for j in range(system.force.shape[0]):
        system.force[j] -= system.mass[j] * system.acceleration[j]
    if not regularised_factor(factor, system.blocks.reshape(-1), system.inverse_root, ALPHA):
        return SINGULAR
    find_least_multipliers(factor, system.force, system.multipliers)
    return OK


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
