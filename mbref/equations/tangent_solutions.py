"""Tangents of the equations of motion: compiled solutions of their variations at many states.

Displacements x and velocities w are in units S of the mechanism. ``row_factors`` has the partition of rows
and displacements, the factors of D, and the basis N of the freedoms.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from mbref.equations.evaluation import set_poses, set_velocities
from mbref.equations.functions import select_pieces
from mbref.equations.row_factors import RowPartition
from mbref.equations.variation_layout import SceneChanges, VariedState
from mbref.equations.varied_constraints import vary_constraints
from mbref.equations.varied_forces import vary_forces
from mbref.equations.varied_vectors import set_world_changes, set_world_motion
from mbref.kernels.compilation import INT, entry, kernel
from mbref.kernels.layout import EQUATIONS
from mbref.kernels.named_memory import Indices, Matrix, Named, Vector
from mbref.linear_algebra.ordered_lu import solve_in_order, solve_transposed_in_order
from mbref.linear_algebra.vectors import copy, larger


class StatesAndRows(NamedTuple):
    """k states, and the factors of the constraint rows there."""

    times: Annotated[Vector, "k"]
    coordinates: Annotated[Matrix, "k", "7*nb"]
    velocities: Annotated[Matrix, "k", "n"]
    angles: Annotated[Matrix, "k", "angles"]
    accelerations: Annotated[Matrix, "k", "n"]
    multipliers: Annotated[Matrix, "k", "m"]
    lengths: Annotated[Matrix, "k", "m"]  # of the rows
    factors: Annotated[Matrix, "k", "factors"]  # of D
    basis: Annotated[Matrix, "k*n", "free"]  # N
    compliance: Annotated[Matrix, "k*free", "free"]  # (Nᵀ M N)⁻¹; without masses it is not read


class UnitsAndMass(NamedTuple):
    """S, and the diagonal of S M S."""

    units: Annotated[Vector, "n"]
    mass: Annotated[Vector, "n"]
    has_mass: Annotated[Indices, 1]


class TangentArrays(NamedTuple):
    """Tangents along c directions at k states: x, w in units S; a, λ in SI units. ``rest`` and ``largest``
    are, for each number, the largest entry of its effect on unit rows that remains, and of the whole effect.
    """

    x: Annotated[Matrix, "k*c", "n"]
    w: Annotated[Matrix, "k*c", "n"]
    a: Annotated[Matrix, "k*c", "n"]
    multipliers: Annotated[Matrix, "k*c", "m"]
    rest: Annotated[Vector, "numbers"]
    largest: Annotated[Vector, "numbers"]


class TangentMemory(NamedTuple):
    """States, changes of the scene, tangents and working memory."""

    states: StatesAndRows
    partition: RowPartition
    body: UnitsAndMass
    numbers: SceneChanges
    varied: VariedState
    found: TangentArrays
    part: Annotated[Vector, "r"]
    left: Annotated[Vector, "n"]
    along: Annotated[Matrix, 2, "free"]


TANGENTS = Named(TangentMemory)


@kernel
def set_varied_state(k, memory, equations):
    """Write state k to the memory of an evaluation."""
    states, varied = memory.states, memory.varied
    for s in range(equations.angles.shape[0]):
        equations.angles[s] = states.angles[k, s]
    select_pieces(states.times[k], equations)
    set_poses(states.coordinates[k], equations.frames)
    set_velocities(states.velocities[k], equations.frames)
    for e in range(states.accelerations.shape[1]):
        varied.acceleration[0, e] = states.accelerations[k, e]
    copy(states.multipliers[k], varied.multipliers)
    set_world_motion(varied, equations)
    varied.x[:] = 0.0
    varied.w[:] = 0.0
    varied.wrench[:] = 0.0


@kernel
def place_dependent(k, rows, target, memory):
    """Subtract from a vector (n,) x with Φ_q S x = ``rows`` (m,), zero at the independent displacements."""
    partition, part = memory.partition, memory.part
    for j in range(part.shape[0]):
        row = partition.rows[j]
        part[j] = rows[row] / memory.states.lengths[k, row]
    solve_in_order(memory.states.factors[k], part, partition.lu)
    for i in range(part.shape[0]):
        target[partition.dependent[i]] -= part[i]


@kernel
def add_basis(k, amounts, target, memory):
    """Add N times amounts (f,) to a vector (n,)."""
    basis, n = memory.states.basis, target.shape[0]
    for i in range(n):
        for j in range(amounts.shape[0]):
            target[i] += basis[n * k + i, j] * amounts[j]


@kernel
def solve_for_accelerations(k, d, place, memory):
    """Compute δa and δλ along direction d from the changes of the equations at given a and λ."""
    partition, found, left, along = memory.partition, memory.found, memory.left, memory.along
    a, multipliers, n, f = found.a[place], found.multipliers[place], left.shape[0], along.shape[1]
    units, mass, states, part = memory.body.units, memory.body.mass, memory.states, memory.part
    place_dependent(k, memory.varied.rows[d], a, memory)
    if memory.body.has_mass[0] == 1:
        along[:] = 0.0
        for i in range(n):
            left[i] = -memory.varied.wrench[d, i] * units[i] - mass[i] * a[i]
            for j in range(f):
                along[0, j] += states.basis[n * k + i, j] * left[i]
        for i in range(f):
            for j in range(f):
                along[1, i] += states.compliance[f * k + i, j] * along[0, j]
        for i in range(n):
            left[i] += mass[i] * a[i]
        add_basis(k, along[1], a, memory)
        for i in range(part.shape[0]):
            b = partition.dependent[i]
            part[i] = left[b] - mass[b] * a[b]
        solve_transposed_in_order(states.factors[k], part, partition.lu)
        for j in range(part.shape[0]):
            row = partition.rows[j]
            multipliers[row] = part[j] / states.lengths[k, row]
    for i in range(n):
        a[i] *= units[i]


@kernel
def note_open_loops(k, freedoms, target, memory):
    """Update the largest entries of unit rows of all numbers in ``target`` (numbers,)."""
    rows = memory.varied.rows
    for d in range(2 * freedoms, rows.shape[0]):
        for row in range(rows.shape[1]):
            value = rows[d, row] / memory.states.lengths[k, row]
            target[d - 2 * freedoms] = larger(target[d - 2 * freedoms], value)


@kernel
def place_direction(k, d, level, freedoms, memory):
    """Complete the displacements, level 0, or the velocities, level 1, along direction d at state k by the
    rows' changes."""
    found, varied, n = memory.found, memory.varied, memory.left.shape[0]
    place = varied.x.shape[0] * k + d
    own, target = (found.x[place], varied.x[d]) if level == 0 else (found.w[place], varied.w[d])
    place_dependent(k, varied.rows[d], own, memory)
    column = d - freedoms * level
    if 0 <= column < freedoms:
        for i in range(n):
            own[i] += memory.states.basis[n * k + i, column]
    for i in range(n):
        target[i] = own[i] * memory.body.units[i]


@entry(INT(INT, TANGENTS, EQUATIONS))
def compute_tangents(freedoms, memory, equations):
    """Compute the tangents at all states: 2 f directions of the state, then one of each number; return k."""
    states, varied, found, numbers = memory.states, memory.varied, memory.found, memory.numbers
    count = varied.x.shape[0]
    for k in range(states.times.shape[0]):
        t = states.times[k]
        set_varied_state(k, memory, equations)
        for level in range(3):
            set_world_changes(varied, equations)
            vary_constraints(t, level, freedoms, varied, numbers, equations)
            if level == 0:
                note_open_loops(k, freedoms, found.largest, memory)
            for d in range(count if level < 2 else 0):
                place_direction(k, d, level, freedoms, memory)
        vary_forces(t, freedoms, varied, numbers, equations)
        for d in range(count):
            solve_for_accelerations(k, d, count * k + d, memory)
        if count > 2 * freedoms:
            vary_constraints(t, 0, freedoms, varied, numbers, equations)
            note_open_loops(k, freedoms, found.rest, memory)
    return states.times.shape[0]
