"""Specialise: the machine code of one scene, holding only the operations that its constants leave.

Two pieces are traced from the kernels: the rates of the moving coordinates, and the projection of a state.
Coordinates that never move are left out.  That a mechanism stays in a plane is not believed but seen in
the trace: with the other coordinates constant, the constraint rows that bear on them have a right-hand
side of exactly zero, no force acts along them, and no other row touches them; so they stay.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mbref.compiled import CACHE, PLAIN
from mbref.evaluation import coordinate_rates, dense_jacobian, evaluate, right_hand_side, violation_rate
from mbref.formulations.base import Formulation
from mbref.model import Model
from mbref.orthogonal import equilibrate
from mbref.specialised.machine_code import Code, Piece, compiled, processor
from mbref.specialised.tracing import Record, Scalar, Untraceable, inputs, numbers, plain
from mbref.stabilisation.full import normalise
from mbref.stabilisation.projection import displace, largest, least_change, select, smallest_pivot
from mbref.tables import (
    COLUMNS,
    FORCE,
    INVERSE_ROOT,
    MASS,
    OBSERVE_CODE,
    OK,
    PHI,
    PHI_Q,
    PHI_RATE,
    PROJECT_CODE,
    RATES_CODE,
    REDUNDANT,
    RHS,
    ROWS,
)

PIECES = ("rates", "observe", "project")  # in the order of their addresses in ints[LIVE]
STILL = 1e-12  # a coordinate of the start this small is taken for zero: what corrections leave


@dataclass(frozen=True)
class Moving:
    """The columns of q (7 nb) and of v (6 nb) that can move, and the constraint rows that bear on them."""

    coordinates: np.ndarray
    velocities: np.ndarray
    rows: np.ndarray


@dataclass(frozen=True)
class Specialised:
    """The scene's machine code, and what ``chart`` needs to know of it; keep it while it is used."""

    columns: np.ndarray  # what can move among all coordinates (7 nb), then velocities (6 nb)
    rank: int  # rows the projection was given
    live: np.ndarray  # ints[LIVE]
    operations: dict[str, int]  # per piece
    code: Code


class _State:
    """A state of recording scalars at the start's sample, and memory for the kernels to run on."""

    def __init__(self, model: Model, q: np.ndarray, v: np.ndarray, moving: Moving):
        self.model, self.moving, self.record = model, moving, Record()
        (self.t,) = inputs(self.record, "t", np.zeros(1))
        self.q, self.v = numbers(q), numbers(v)
        nq = len(moving.coordinates)
        samples = np.concatenate([q[moving.coordinates], v[moving.velocities]])
        scalars = inputs(self.record, "y", samples)
        self.q[moving.coordinates], self.v[moving.velocities] = scalars[:nq], scalars[nq:]
        self.floats = tuple(map(numbers, model.floats))
        self.work = tuple(map(numbers, model.workspace(1)))
        angles = self.work[9]
        angles[0, :] = inputs(self.record, "angles", np.zeros(angles.shape[1]))
        self.problem = (model.ints, self.floats, self.work)

    def evaluate(self, settings: np.ndarray) -> None:
        """All terms of the equations of motion."""
        plain(evaluate)(self.t, self.q, self.v, *self.problem)
        plain(dense_jacobian)(self.model.ints, self.work)
        plain(right_hand_side)(self.v, self.model.ints, self.work, numbers(settings))

    def of_moving(self, column: int) -> np.ndarray:
        """Entries of ``work[COLUMNS]`` at the moving velocities."""
        return self.work[COLUMNS][column, self.moving.velocities]

    def jacobian(self) -> np.ndarray:
        """Φ_q of the moving velocities in the rows that bear on them."""
        return self.work[PHI_Q][np.ix_(self.moving.rows, self.moving.velocities)]


def everything(model: Model) -> Moving:
    """All coordinates, velocities and rows."""
    return Moving(np.arange(7 * model.nb), np.arange(6 * model.nb), np.arange(model.m))


def moving_parts(model: Model, q: np.ndarray, v: np.ndarray, settings: np.ndarray) -> Moving:
    """What can move from the start (q, v): the motions in a plane across a world axis, or everything."""
    for axis in range(3):
        moving = _in_plane(model, q, v, axis)
        if moving is not None:
            moving = _closed(model, *_at_rest(q, v, moving), moving, settings)
        if moving is not None:
            return moving
    return everything(model)


def _in_plane(model: Model, q: np.ndarray, v: np.ndarray, axis: int) -> Moving | None:
    """The coordinates of motions across ``axis``, if the start is one; its rows are not known yet."""
    across = [k for k in range(3) if k != axis]
    coordinates = np.array([[7 * b + k for k in (*across, 3, 4 + axis)] for b in range(model.nb)]).ravel()
    velocities = np.array([[6 * b + k for k in (*across, 3 + axis)] for b in range(model.nb)]).ravel()
    turned = np.array([[7 * b + 4 + k for k in across] for b in range(model.nb)]).ravel()
    still = np.setdiff1d(np.arange(v.size), velocities)
    if np.max(np.abs(np.concatenate([q[turned], v[still]])), initial=0.0) > STILL * max(1.0, np.abs(v).max()):
        return None
    return Moving(coordinates, velocities, np.arange(model.m))


def _at_rest(q: np.ndarray, v: np.ndarray, moving: Moving) -> tuple[np.ndarray, np.ndarray]:
    """q and v with roundings of zero made zero in what does not move."""
    q, v = q.copy(), v.copy()
    still = np.setdiff1d(np.arange(q.size), moving.coordinates)
    q[still] = np.where(np.abs(q[still]) < STILL, 0.0, q[still])
    v[np.setdiff1d(np.arange(v.size), moving.velocities)] = 0.0
    return q, v


def _closed(
    model: Model, q: np.ndarray, v: np.ndarray, moving: Moving, settings: np.ndarray
) -> Moving | None:
    """``moving`` with its rows, if the trace shows that nothing else starts to move; otherwise None."""
    state = _State(model, q, v, moving)
    state.evaluate(settings)
    jacobian, rows, columns = state.work[PHI_Q], state.work[ROWS], state.work[COLUMNS]
    bears = np.array([[not _zero(x) for x in row] for row in jacobian]).reshape(jacobian.shape)
    still = np.setdiff1d(np.arange(model.n), moving.velocities)
    live = bears[:, moving.velocities].any(axis=1)
    rates = np.zeros(q.size, dtype=object)
    plain(coordinate_rates)(state.q, state.v, rates)
    stays = (
        not bears[np.ix_(live, still)].any()
        and all(_zero(x) for x in rows[RHS, ~live])
        and all(_zero(x) for x in columns[FORCE, still])
        and all(_zero(x) for x in np.delete(rates, moving.coordinates))
    )
    return Moving(moving.coordinates, moving.velocities, np.flatnonzero(live)) if stays else None


def _zero(value: Scalar | float) -> bool:
    return not isinstance(value, Scalar) and value == 0


def rates_pieces(state: _State, formulation: Formulation, settings: np.ndarray) -> list[Piece]:
    """y' of the moving coordinates by the formulation; the same with the multipliers of all rows."""
    settings = numbers(settings)
    state.evaluate(settings)
    jacobian, (m, n) = state.jacobian(), (len(state.moving.rows), len(state.moving.velocities))
    scratch = np.zeros(formulation.scratch(m, n)).astype(object)
    acceleration, multipliers = np.zeros(n, dtype=object), np.zeros(m, dtype=object)
    status = plain(formulation.accelerate)(
        state.of_moving(MASS), state.of_moving(INVERSE_ROOT), jacobian, state.of_moving(FORCE),
        state.work[ROWS][RHS, state.moving.rows], settings, scratch,
        np.zeros(2 * (m + n), dtype=np.int64), np.zeros(6, dtype=np.int64), acceleration, multipliers,
    )  # fmt: skip
    if status != OK:
        raise Untraceable(f"{formulation.name} fails at the start")
    rates = np.zeros(state.q.size, dtype=object)
    plain(coordinate_rates)(state.q, state.v, rates)
    outputs = [*rates[state.moving.coordinates], *acceleration]
    of_all_rows = np.zeros(state.model.m, dtype=object)
    of_all_rows[state.moving.rows] = multipliers
    return [Piece(PIECES[0], state.record, outputs), Piece(PIECES[1], state.record, [*outputs, *of_all_rows])]


def project_piece(state: _State, independent: np.ndarray) -> Piece:
    """One Newton step of the projection: y after it, the violation before it, the smallest pivot."""
    moving, q, v, work = state.moving, state.q, state.v, state.work
    plain(normalise)(q)
    plain(evaluate)(state.t, q, v, *state.problem)
    plain(violation_rate)(state.model.ints, work, v)
    plain(dense_jacobian)(state.model.ints, work)
    rows, jacobian, inverse_root = work[ROWS], state.jacobian(), state.of_moving(INVERSE_ROOT)
    m, n, rank = *jacobian.shape, len(independent)
    scale = np.zeros(m, dtype=object)
    plain(equilibrate)(jacobian, inverse_root, jacobian, scale)
    columns, r = np.zeros((n, rank), dtype=object), np.zeros((rank, rank), dtype=object)
    plain(select)(jacobian, independent, columns)
    pivot = plain(smallest_pivot)(columns, r)
    steps = np.zeros((2, 6 * state.model.nb), dtype=object)
    for step, which in zip(steps, (PHI, PHI_RATE), strict=True):
        values, x = -rows[which, moving.rows][independent] * scale[independent], np.zeros(n, dtype=object)
        plain(least_change)(columns, r, inverse_root, values, x)
        step[moving.velocities] = x
    violation = plain(largest)(rows[PHI])
    plain(displace)(q, steps[0], np.zeros(q.size, dtype=object))
    v = v + steps[1]
    outputs = [*q[moving.coordinates], *v[moving.velocities], violation, pivot]
    return Piece(PIECES[2], state.record, outputs)


def specialise(
    model: Model, formulation: Formulation, settings: np.ndarray, q: np.ndarray, v: np.ndarray,
    independent: np.ndarray,
) -> Specialised:  # fmt: skip
    """The code of a scene from its start (q, v), traced and compiled, or as kept from an earlier run.

    ``independent`` are the rows that the projection chose there.  Raises Untraceable where the formulation
    decides at run time what it does, the scene is too large, or there is no JIT.
    """
    if PLAIN:
        raise Untraceable("without the JIT there is no machine code")
    if formulation.pivots_by_size:
        raise Untraceable(f"{formulation.name} chooses pivots at every evaluation")
    arrays = (*model.ints, *model.floats, settings, q, v, independent)
    kept = CACHE / "scenes" / _key(formulation.name, arrays)
    if not kept.with_suffix(".json").exists():
        _keep(kept, *_traced(model, formulation, settings, q, v, independent))
    return _loaded(kept, model, len(independent))


def _key(name: str, arrays: Sequence[np.ndarray]) -> str:
    digest = hashlib.sha256(f"{name} {processor()}".encode())
    for array in arrays:
        digest.update(str(array.shape).encode() + array.tobytes())
    return digest.hexdigest()[:32]


def _traced(
    model: Model, formulation: Formulation, settings: np.ndarray, q: np.ndarray, v: np.ndarray,
    independent: np.ndarray,
) -> tuple[Moving, bool, list[Piece]]:  # fmt: skip
    """What moves, whether its rows are redundant, and the pieces."""
    moving = moving_parts(model, q, v, settings)
    start = _at_rest(q, v, moving)
    chosen = np.array([np.flatnonzero(moving.rows == row)[0] for row in independent if row in moving.rows])
    pieces = rates_pieces(_State(model, *start, moving), formulation, settings)
    project = project_piece(_State(model, *start, moving), chosen.astype(int))
    return moving, len(chosen) < len(moving.rows), [*pieces, project]


def _keep(path: Path, moving: Moving, redundant: bool, pieces: list[Piece]) -> None:
    """Write the code, then what it is for, each whole or not at all."""
    facts = {
        "coordinates": moving.coordinates.tolist(),
        "velocities": moving.velocities.tolist(),
        "redundant": redundant,
        "operations": {piece.name: len(piece.live()) for piece in pieces},
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    for suffix, data in ((".o", compiled(pieces)), (".json", json.dumps(facts).encode())):
        with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
            file.write(data)
        os.replace(file.name, path.with_suffix(suffix))


def _loaded(path: Path, model: Model, rank: int) -> Specialised:
    facts, code = json.loads(path.with_suffix(".json").read_text()), Code(path.with_suffix(".o").read_bytes())
    coordinates, velocities = (np.array(facts[name], dtype=int) for name in ("coordinates", "velocities"))
    live = model.entries(coordinates, velocities)
    live[0, REDUNDANT] = facts["redundant"]
    live[0, [RATES_CODE, OBSERVE_CODE, PROJECT_CODE]] = [code.address(name) for name in PIECES]
    columns = np.concatenate([coordinates, 7 * model.nb + velocities])
    return Specialised(columns, rank, live, facts["operations"], code)
