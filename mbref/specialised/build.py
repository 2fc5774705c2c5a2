"""Specialise: machine code for one scene, with only the operations that its constants leave.

Two pieces are recorded from the kernels: the rates of the active coordinates, by the formulation's kernel on
the active rows and columns, and one Newton step of the projection.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from mbref.equations.coordinates import coordinate_rates
from mbref.equations.evaluation import assemble_system
from mbref.equations.initial_state import Start
from mbref.equations.model import Model
from mbref.equations.static_multipliers import add_static_multipliers
from mbref.kernels.compilation import CACHE, PLAIN
from mbref.kernels.layout import OK, Active, Addresses, SparseFactor, State, System
from mbref.kernels.machine_code import Code, code_at, processor
from mbref.kernels.named_memory import Packed, allocate, packed
from mbref.kernels.records import Numbers, record
from mbref.linear_algebra.sparse_cholesky import find_squared_pivots
from mbref.method import Method
from mbref.specialised.assembly import Piece, text_of
from mbref.specialised.tracing import Record, Untraceable, inputs, numbers, plain
from mbref.specialised.varied import Varied, arrays_of
from mbref.stabilisation.projection import REPEATED, project_velocities, whole_newton_step

MOST_ROWS = 60  # the record of more would be too long (assembly.MOST_OPERATIONS)


@dataclass(frozen=True)
class Part:
    """The active coordinates and velocities of a scene, and the factor over the rows that bear on them."""

    active: Active
    factor: SparseFactor
    identity: bytes  # all of both but numbers


@dataclass(frozen=True)
class Specialised:
    """The addresses of a scene's machine code; keep it while it is used."""

    addresses: Addresses
    code: Code


class RecordingState:
    """The start as recording scalars, and memory for the kernels to run on."""

    def __init__(
        self, model: Model, method: Method, rank_tolerance: float, start: Start, part: Part,
        varied: Varied | None = None,
    ):  # fmt: skip
        self.active, self.record, self.formulation = part.active, Record(), method.formulation
        algebra, (q, v) = method.formulation.linear_algebra, part.active
        sizes = {**model.sizes, "dense_rows": algebra.rows(model.m)}
        rows, columns = part.factor.symbolic.row.size, v.size
        equations = model.equations(
            sizes,
            varied.data if varied else None,
            settings=record(method.settings(rank_tolerance)),
            options=method.packed_options(method.formulation),
            scratch=packed(algebra.scratch(rows, columns, part.factor)),
        )
        self.memory = with_numbers(
            SimpleNamespace(
                equations=equations,
                state=allocate(State, sizes)._replace(coordinates=start.q.copy(), velocities=start.v.copy()),
                factor=part.factor,
                chart=allocate(method.stabilisation.memory, sizes),
            )
        )
        if varied:
            varied.put_inputs(self.record, self.memory)
        (self.t,) = inputs(self.record, "t", np.zeros(1))
        scalars = inputs(self.record, "y", np.concatenate([start.q[q], start.v[v]]))
        state = self.memory.state
        state.coordinates[q], state.velocities[v] = scalars[: q.size], scalars[q.size :]
        angles = self.memory.equations.angles
        angles[:] = inputs(self.record, "angles", np.zeros(angles.size))

    def accelerate(self) -> int:
        """Accelerations of the active velocities and multipliers of all rows; the status."""
        system, kernel = self.memory.equations.system, plain(self.formulation.accelerate)
        if self.formulation.linear_algebra.sparse:
            return kernel(system)
        rows, columns = self.memory.factor.symbolic.row.astype(int), self.active.velocities
        reduced = _reduced(system, rows, columns)
        status = kernel(reduced)
        system.acceleration[columns], system.multipliers[rows] = reduced.acceleration, reduced.multipliers
        plain(add_static_multipliers)(self.memory.factor.static, system)
        return status


def _reduced(system: System, rows: np.ndarray, columns: np.ndarray) -> System:
    """The system of these rows and columns; its accelerations and multipliers are copies."""
    of_columns = {k: getattr(system, k)[columns] for k in ("mass", "inverse_root", "force", "acceleration")}
    of_rows = {k: getattr(system, k)[rows] for k in ("rhs", "multipliers")}
    return system._replace(**of_columns, **of_rows, jacobian=system.jacobian[np.ix_(rows, columns)])


def with_numbers(values: Any) -> Any:
    """The same memory with arrays of plain numbers, on which kernels record their operations."""
    if isinstance(values, Packed):
        return with_numbers(values.values)
    if isinstance(values, SimpleNamespace):
        return SimpleNamespace(**{name: with_numbers(value) for name, value in vars(values).items()})
    if isinstance(values, Numbers):
        return SimpleNamespace(**{name: values[name].item() for name in values.dtype.names})
    if isinstance(values, np.ndarray):
        return numbers(values) if values.dtype == float else values
    return type(values)(*map(with_numbers, values)) if isinstance(values, tuple) else values


def rates_piece(state: RecordingState) -> Piece:
    """y' of the active coordinates by the formulation, and the multipliers of all rows."""
    memory, (q, v) = state.memory, state.active
    coordinates, velocities = memory.state.coordinates, memory.state.velocities
    plain(assemble_system)(state.t, coordinates, velocities, memory.equations)
    if state.accelerate() != OK:
        raise Untraceable(f"{state.formulation.name} fails at the start")
    plain(coordinate_rates)(coordinates, velocities, memory.state.coordinate_rates)
    system = memory.equations.system
    out = [*memory.state.coordinate_rates[q], *system.acceleration[v]]
    return Piece("rates", state.record, out, system.multipliers)


def project_piece(state: RecordingState) -> Piece:
    """One Newton step of the projection: y after it; the violation before it and the squared pivots.

    Velocities are corrected in every step; where one is enough they need next to no correction.
    """
    memory, (q, v) = state.memory, state.active
    violation = plain(whole_newton_step)(state.t, memory)
    if isinstance(violation, float) and violation < 0:
        raise Untraceable("the constraint rows cannot be factored at the start")
    plain(find_squared_pivots)(memory.factor)
    plain(project_velocities)(REPEATED, memory)
    y = [*memory.state.coordinates[q], *memory.state.velocities[v]]
    return Piece("project", state.record, y, [violation, *memory.factor.squared_pivots])


def specialise(
    model: Model,
    method: Method,
    rank_tolerance: float,
    start: Start,
    part: Part,
    varied: Varied | None = None,
) -> Specialised:
    """The code of a scene from its start, recorded and compiled, or as kept from an earlier run.

    It takes the numbers that are ``varied``, so that it serves all scenes that differ in them alone.

    Raises Untraceable where the formulation chooses pivots at run time, the scene is too large, or there is
    no JIT.
    """
    if PLAIN:
        raise Untraceable("without the JIT there is no machine code")
    if method.formulation.pivots_by_size:
        raise Untraceable(f"{method.formulation.name} chooses pivots at every evaluation")
    if part.factor.symbolic.row.size > MOST_ROWS:
        raise Untraceable(f"{part.factor.symbolic.row.size} rows are active, more than {MOST_ROWS}")
    arguments = (model, method, rank_tolerance, start, part, varied)
    path = CACHE / "scenes" / f"{_key(*arguments)}.code"
    code = code_at(path, lambda: text_of(_pieces(*arguments)))
    return Specialised(Addresses(*map(code.address, Addresses._fields)), code)


def _pieces(*arguments: Any) -> list[Piece]:
    return [rates_piece(RecordingState(*arguments)), project_piece(RecordingState(*arguments))]


def _key(
    model: Model, method: Method, rank_tolerance: float, start: Start, part: Part, varied: Varied | None
) -> str:
    digest = hashlib.sha256(f"{method} {rank_tolerance} {processor()}".encode())
    numbers = varied.constants() if varied else (model.data, start.q, start.v)
    shapes_and_bytes = ((str(a.shape).encode(), a.tobytes()) for a in arrays_of(numbers))
    digest.update(b"".join(part for pair in shapes_and_bytes for part in pair) + part.identity)
    return digest.hexdigest()[:32]
