"""Charts with the accelerations of ALF-dual from a sparse factor: cost grows with the number of joints."""

from __future__ import annotations

from dataclasses import replace

from mbref.equations.evaluation import evaluate, expand, right_hand_side
from mbref.equations.static_constraints import add_multipliers_of_held
from mbref.formulations.augmented_lagrangian import factor, settle
from mbref.kernels.arguments import opened, planned
from mbref.kernels.compilation import exchangeable, inlined
from mbref.kernels.layout import (
    ACCELERATION,
    COLUMNS,
    COORDINATES,
    EVALUATIONS,
    FORCE,
    FORMULATION_OPTIONS,
    LIVE,
    MASS,
    MULTIPLIERS,
    RATES,
    RHS,
    ROWS,
    SCRATCH,
    SINGULAR,
    STATE,
    VELOCITIES,
)
from mbref.linear_algebra.sparse_cholesky import memories, part, subtract_product
from mbref.linear_algebra.symbolic_factorisation import COLUMN, ROW
from mbref.stabilisation.all_coordinates import write_rates
from mbref.stabilisation.base import Stabilisation
from mbref.stabilisation.baumgarte import BAUMGARTE
from mbref.stabilisation.none import NONE
from mbref.stabilisation.projection import PROJECTION


@inlined
def accelerations(plan, work, settings, counts):
    """Accelerations and multipliers by ALF-dual at the state last evaluated; their status."""
    rows, columns, column, row = work[ROWS], work[COLUMNS], part(plan, COLUMN), part(plan, ROW)
    mass, force, acceleration = columns[MASS], columns[FORCE], columns[ACCELERATION]
    alpha, epsilon = settings[FORMULATION_OPTIONS], settings[FORMULATION_OPTIONS + 1]
    most = int(settings[FORMULATION_OPTIONS + 2])
    if not factor(plan, work, alpha, counts):
        return SINGULAR
    d, _, _, _, b, _, _, root, x = memories(plan, work[SCRATCH][0])
    for j in range(column.shape[0]):
        k = column[j]
        if not mass[k] > 0.0:
            return SINGULAR
        x[j] = root[j] * force[k]
        acceleration[k] = root[j] * x[j]
    for i in range(row.shape[0]):
        b[i] = rows[RHS, row[i]]
    subtract_product(plan, d, x, b)
    status = settle(plan, work, epsilon, most, acceleration, rows[MULTIPLIERS])
    add_multipliers_of_held(plan, work)
    return status


@exchangeable(RATES)
def rates(accelerate, t, y, y_rate, problem):
    """y' of the entries of y."""
    ints, floats, work, _pivots, settings, counts = opened(problem)
    live, state = ints[LIVE], work[STATE]
    expand(y, live, state)
    q, v = state[COORDINATES], state[VELOCITIES][: work[COLUMNS].shape[1]]
    counts[EVALUATIONS] += 1
    evaluate(t, q, v, ints, floats, work)
    right_hand_side(v, ints, work, settings)
    status = accelerations(planned(problem), work, settings, counts)
    write_rates(q, v, live, y_rate, work)
    return status


CHARTS: dict[str, Stabilisation] = {
    s.name: replace(s, rates=rates, observe=rates, careful=rates) for s in (NONE, BAUMGARTE, PROJECTION)
}
