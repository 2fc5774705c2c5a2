"""Specialise: the machine code of one scene, holding only the operations that its constants leave.

Two pieces are traced from the kernels: the rates of the moving coordinates, by the formulation's kernel on
the rows and columns that move, and the projection of a state.  Coordinates that never move, and rows that
bear on none that does, are left out.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mbref.equations.evaluation import (
    coordinate_rates,
    dense_jacobian,
    evaluate,
    right_hand_side,
    violation_rate,
)
from mbref.equations.model import Model
from mbref.equations.static_constraints import add_multipliers_of_held
from mbref.formulations.augmented_lagrangian import factor
from mbref.formulations.base import Formulation
from mbref.kernels.compilation import CACHE, PLAIN
from mbref.kernels.layout import (
    ACCELERATION,
    ANGLES,
    COLUMNS,
    FORCE,
    INVERSE_ROOT,
    MASS,
    MULTIPLIERS,
    OK,
    PHI,
    PHI_Q,
    PHI_RATE,
    PROJECT_CODE,
    RATES_CODE,
    RHS,
    ROWS,
    SCRATCH,
)
from mbref.linear_algebra.sparse_cholesky import memories, squared_pivots
from mbref.linear_algebra.symbolic_factorisation import COLUMN, ROW, Plan
from mbref.specialised.kept_code import code_of
from mbref.specialised.machine_code import Code, Piece, processor
from mbref.specialised.tracing import Record, Untraceable, inputs, numbers, plain
from mbref.stabilisation.all_coordinates import normalise
from mbref.stabilisation.projection import (
    ALPHA,
    REPEATED,
    cancel,
    displace,
    largest,
)
from mbref.stabilisation.sparse_chart import accelerations

MOST_ROWS = 60  # whose record would not be too long (machine_code.MOST_OPERATIONS)
PIECES = ("rates", "project")  # in the order of their addresses in ints[LIVE]


@dataclass(frozen=True)
class Part:
    """What of a scene moves: indices into q (7 nb) and v (6 nb), and the rows that bear on them."""

    coordinates: np.ndarray
    velocities: np.ndarray
    rows: np.ndarray
    plan: Plan

    @staticmethod
    def of(plan: Plan, coordinates: np.ndarray) -> Part:
        """With the rows in the plan's order of elimination."""
        velocities, rows = (plan.part(k).astype(int) for k in (COLUMN, ROW))
        return Part(coordinates, velocities, rows, plan)


@dataclass(frozen=True)
class Specialised:
    """The scene's machine code and ``ints[LIVE]`` with its addresses; keep it while it is used."""

    live: np.ndarray
    operations: dict[str, int]  # per piece
    code: Code


class State:
    """A state of recording scalars at the start's sample, and memory for the kernels to run on."""

    def __init__(self, model: Model, q: np.ndarray, v: np.ndarray, moving: Part):
        self.model, self.moving, self.record = model, moving, Record()
        (self.t,) = inputs(self.record, "t", np.zeros(1))
        self.q, self.v = numbers(q), numbers(v)
        nq = len(moving.coordinates)
        samples = np.concatenate([q[moving.coordinates], v[moving.velocities]])
        scalars = inputs(self.record, "y", samples)
        self.q[moving.coordinates], self.v[moving.velocities] = scalars[:nq], scalars[nq:]
        self.floats = tuple(map(numbers, model.floats))
        self.work = tuple(map(numbers, model.workspace(moving.plan.memory)))
        angles = self.work[ANGLES]
        angles[0, :] = inputs(self.record, "angles", np.zeros(angles.shape[1]))
        self.problem = (model.ints, self.floats, self.work)

    def evaluate(self, settings: np.ndarray) -> None:
        """All terms of the equations of motion."""
        plain(evaluate)(self.t, self.q, self.v, *self.problem)
        plain(right_hand_side)(self.v, self.model.ints, self.work, settings)

    def accelerate(self, formulation: Formulation, settings: np.ndarray) -> int:
        """Accelerations of what moves and multipliers, into the workspace; the status."""
        if formulation.sparse:
            return plain(accelerations)(self.moving.plan.indices, self.work, settings, no_counts())
        plain(dense_jacobian)(self.model.ints, self.work)
        velocities, rows = self.moving.velocities, self.moving.rows
        columns, of_rows = self.work[COLUMNS][:, velocities], self.work[ROWS][:, rows]
        (m, n), pivots = (len(rows), len(velocities)), np.zeros(2 * (len(rows) + len(velocities)), dtype=int)
        scratch = np.zeros(formulation.scratch(m, n)).astype(object)
        status = plain(formulation.accelerate)(
            columns[MASS], columns[INVERSE_ROOT], self.work[PHI_Q][np.ix_(rows, velocities)], columns[FORCE],
            of_rows[RHS], settings, scratch, pivots, no_counts(), columns[ACCELERATION], of_rows[MULTIPLIERS],
        )  # fmt: skip
        self.work[COLUMNS][ACCELERATION, velocities] = columns[ACCELERATION]
        self.work[ROWS][MULTIPLIERS, rows] = of_rows[MULTIPLIERS]
        plain(add_multipliers_of_held)(self.moving.plan.indices, self.work)
        return status


def no_counts() -> np.ndarray:
    """Room for counts that nobody reads: those of a piece are known beforehand."""
    return np.zeros(6, dtype=np.int64)


def rates_piece(state: State, formulation: Formulation, settings: np.ndarray) -> Piece:
    """y' of the moving coordinates by the formulation, and the multipliers of all rows."""
    settings, moving = numbers(settings), state.moving
    state.evaluate(settings)
    if state.accelerate(formulation, settings) != OK:
        raise Untraceable(f"{formulation.name} fails at the start")
    rates = np.zeros(state.q.size, dtype=object)
    plain(coordinate_rates)(state.q, state.v, rates)
    acceleration, multipliers = state.work[COLUMNS][ACCELERATION], state.work[ROWS][MULTIPLIERS]
    out = [*rates[moving.coordinates], *acceleration[moving.velocities]]
    return Piece(PIECES[0], state.record, out, multipliers)


def project_piece(state: State) -> Piece:
    """One Newton step of the projection: y after it; the violation before it and the squared pivots.

    Velocities are corrected in every step; where one is enough they need next to no correction.
    """
    moving, model, q, v, work = state.moving, state.model, state.q, state.v, state.work
    plan, rows = moving.plan.indices, work[ROWS]
    plain(evaluate)(state.t, q, v, *state.problem)
    plain(normalise)(q)
    if not plain(factor)(plan, work, ALPHA, no_counts()):
        raise Untraceable("the constraint rows cannot be factored at the start")
    _, l, diagonal, squares, *_ = plain(memories)(plan, work[SCRATCH][0])
    plain(squared_pivots)(plan, l, diagonal, squares)
    violation, x = plain(largest)(rows[PHI, moving.rows]), np.zeros(model.n, dtype=object)
    plain(cancel)(PHI, REPEATED, plan, work, x)
    plain(violation_rate)(model.ints, work, v)
    plain(cancel)(PHI_RATE, REPEATED, plan, work, v)
    plain(displace)(q, x, np.zeros(q.size, dtype=object))
    y = [*q[moving.coordinates], *v[moving.velocities]]
    return Piece(PIECES[1], state.record, y, [violation, *squares])


def specialise(
    model: Model, formulation: Formulation, settings: np.ndarray, q: np.ndarray, v: np.ndarray, moving: Part
) -> Specialised:
    """The code of a scene from its start (q, v), traced and compiled, or as kept from an earlier run.

    Raises Untraceable where the formulation decides at run time what it does, the scene is too large, or
    there is no JIT.
    """
    if PLAIN:
        raise Untraceable("without the JIT there is no machine code")
    if formulation.pivots_by_size:
        raise Untraceable(f"{formulation.name} chooses pivots at every evaluation")
    if len(moving.rows) > MOST_ROWS:
        raise Untraceable(f"{len(moving.rows)} rows that move, more than {MOST_ROWS}")
    arrays = (*model.ints, *model.floats, settings, q, v, moving.coordinates, moving.plan.indices)
    kept = CACHE / "scenes" / f"{_key(formulation.name, arrays)}.code"
    operations, code = code_of(kept, lambda: _traced(model, formulation, settings, q, v, moving))
    live = model.entries(moving.coordinates, moving.velocities)
    live[0, [RATES_CODE, PROJECT_CODE]] = [code.address(name) for name in PIECES]
    return Specialised(live, operations, code)


def _key(name: str, arrays: Sequence[np.ndarray]) -> str:
    digest = hashlib.sha256(f"{name} {processor()}".encode())
    for array in arrays:
        digest.update(str(array.shape).encode() + array.tobytes())
    return digest.hexdigest()[:32]


def _traced(
    model: Model, formulation: Formulation, settings: np.ndarray, q: np.ndarray, v: np.ndarray, moving: Part
) -> list[Piece]:
    rates = rates_piece(State(model, q, v, moving), formulation, settings)
    return [rates, project_piece(State(model, q, v, moving))]
