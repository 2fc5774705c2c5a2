"""Null space: coordinates and the velocities along the constraint tangent are integrated.

The tangent space at a reference pose has an orthonormal basis Z₀ (n, f) with Φ_q R Z₀ = 0, where R makes
columns of unit length (``equations.units``).  With f independent speeds w = Z₀ᵀ R⁻¹ v, the velocities follow
at each evaluation from the bordered system

    [Φ_q R]             [ν]
    [Z₀ᵀ  ] R⁻¹ v   =   [w],          w' = Z₀ᵀ R⁻¹ q̈,

so that no velocity leaves the constraints; positions drift by the integrator's error alone.  After an
accepted step Φ_q R z = 0, Z₀ᵀ z = e_k gives the tangents there, each on the side of the one before: this
continues the tangent by its sign.  They replace Z₀, orthonormalised, once one has turned by more than acos(1
/ TURNED) (Kim & Vanderploeg, ASME J. Mech. Trans. Aut. Des. 108, 1986, by QR; Keller's bordered systems,
1977).  The number of freedoms is that at the start.  Beside a singular position the tangent of a pose that
violates constraints by ε follows another branch within a distance of about √ε.  Where the bordered system
loses its rank, the run is at a singular position, and ends.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from numpy import sqrt

from mbref.equations.coordinates import coordinate_rates, normalise
from mbref.equations.evaluation import assemble_jacobian, assemble_system, evaluate
from mbref.formulations.moore_penrose import transpose
from mbref.kernels.compilation import exchangeable, kernel
from mbref.kernels.layout import ACCEPT, CHANGED, ENTER, OK, RATES, SINGULAR, SINGULAR_AHEAD
from mbref.kernels.named_memory import Indices, Matrix, Vector, opener
from mbref.linear_algebra.orthogonal_factorisations import (
    apply_reflectors,
    equilibrate,
    gram_schmidt,
    minimum_norm,
    qr_pivoted,
)
from mbref.linear_algebra.vectors import copy
from mbref.stabilisation.base import Stabilisation

TURNED = 1.1  # length of a tangent, of unit component along the one before, from which on it replaces that


class Freedoms(NamedTuple):
    """Number of independent speeds, and the rank of the bordered system last factorised."""

    number: int = 0
    rank: int = 0


class Scratch(NamedTuple):
    """The bordered system, its factors, and the basis of the tangent space by rows."""

    d: Annotated[Matrix, "m", "n"]  # Φ_q R with rows of unit length
    row_scale: Annotated[Vector, "m"]
    transposed: Annotated[Matrix, "n", "m + n"]
    order: Annotated[Indices, "m + n"]
    tau: Annotated[Vector, "m + n"]
    work: Annotated[Vector, "m + n"]
    norms: Annotated[Matrix, 2, "m + n"]
    b: Annotated[Vector, "m + n"]
    x: Annotated[Vector, "n"]
    tangent: Annotated[Matrix, "n", "n"]  # Z₀ᵀ in the first rows, zeros below
    next_tangent: Annotated[Matrix, "n", "n"]
    triangle: Annotated[Matrix, "n", "n"]
    freedoms: Freedoms


scratch_of = opener(Scratch)


@kernel
def put_bordered_system(memory):
    """[R Φ_qᵀ  Z₀] (n, m + n) with unit rows of Φ_q, and ν, at the state last evaluated; its factors."""
    equations, scratch = memory.equations, scratch_of(memory.chart)
    a, d, scale = scratch.transposed, scratch.d, scratch.row_scale
    m, n = d.shape
    assemble_jacobian(equations, d)
    equilibrate(d, equations.scene.metric_root, d, scale)
    transpose(d, a)
    for i in range(m):
        scratch.b[i] = scale[i] * equations.rows.nu[i]
    for k in range(n):
        for j in range(n):
            a[j, m + k] = scratch.tangent[k, j]
    equations.system.counts.factorisations += 1
    scratch.freedoms.rank = qr_pivoted(equations.system.settings.rank_tolerance, scratch)


@kernel
def put_null_space(memory):
    """An orthonormal basis of the null space of Φ_q R at the state last evaluated into ``tangent``."""
    scratch = scratch_of(memory.chart)
    scratch.tangent[:] = 0.0
    put_bordered_system(memory)
    n, rank = scratch.x.shape[0], scratch.freedoms.rank
    scratch.freedoms.number = n - rank
    for k in range(n - rank):
        scratch.x[:] = 0.0
        scratch.x[rank + k] = 1.0
        apply_reflectors(rank, scratch)
        copy(scratch.x, scratch.tangent[k])


@kernel
def put_speeds(memory, y):
    """w = Z₀ᵀ R⁻¹ v of ``memory.state`` behind the coordinates in y."""
    along_tangent(memory.state.velocities, memory, y[memory.state.coordinates.shape[0] :])


@kernel
def along_tangent(vector, memory, speeds):
    """``speeds`` (f,) := Z₀ᵀ R⁻¹ x of a vector x (n,)."""
    scratch, root = scratch_of(memory.chart), memory.equations.scene.metric_root
    for k in range(scratch.freedoms.number):
        speeds[k] = 0.0
        for j in range(root.shape[0]):
            speeds[k] += scratch.tangent[k, j] * vector[j] / root[j]


@exchangeable(ENTER)
def enter(t, y, memory):
    state = memory.state
    evaluate(t, state.coordinates, state.velocities, memory.equations)
    put_null_space(memory)
    copy(state.coordinates, y[: state.coordinates.shape[0]])
    put_speeds(memory, y)
    return state.coordinates.shape[0] + scratch_of(memory.chart).freedoms.number


@kernel
def solve_velocities(t, y, memory):
    """Coordinates and velocities of y into ``memory.state``; False where Φ_q and Z₀ leave a velocity free."""
    state, scratch, root = memory.state, scratch_of(memory.chart), memory.equations.scene.metric_root
    nq, m, free = state.coordinates.shape[0], memory.equations.rows.nu.shape[0], scratch.freedoms.number
    copy(y[:nq], state.coordinates)
    evaluate(t, state.coordinates, state.velocities, memory.equations)
    put_bordered_system(memory)
    if scratch.freedoms.rank < root.shape[0]:
        return False
    for k in range(free):
        scratch.b[m + k] = y[nq + k]
    minimum_norm(scratch.freedoms.rank, scratch)
    for j in range(root.shape[0]):
        state.velocities[j] = root[j] * scratch.x[j]
    return True


@exchangeable(RATES)
def rates(t, y, y_rate, memory):
    if not solve_velocities(t, y, memory):
        return SINGULAR_AHEAD
    state, equations, nq = memory.state, memory.equations, memory.state.coordinates.shape[0]
    assemble_system(t, state.coordinates, state.velocities, equations)
    status = memory.kernels.accelerate(equations.system)
    coordinate_rates(state.coordinates, state.velocities, state.coordinate_rates)
    copy(state.coordinate_rates, y_rate[:nq])
    along_tangent(equations.system.acceleration, memory, y_rate[nq:])
    return status


@kernel
def put_next_tangent(memory):
    """Tangents with Z₀ᵀ z = e_k from the last factors into ``next_tangent``; the length of the longest."""
    scratch, m = scratch_of(memory.chart), memory.equations.rows.nu.shape[0]
    longest = 0.0
    for k in range(scratch.freedoms.number):
        scratch.b[:] = 0.0
        scratch.b[m + k] = 1.0
        minimum_norm(scratch.freedoms.rank, scratch)
        copy(scratch.x, scratch.next_tangent[k])
        square = 0.0
        for j in range(scratch.x.shape[0]):
            square += scratch.x[j] * scratch.x[j]
        longest = max(longest, sqrt(square))
    return longest


@exchangeable(ACCEPT)
def accept(t, y, memory):
    nq, scratch = memory.state.coordinates.shape[0], scratch_of(memory.chart)
    normalise(y[:nq])
    if not solve_velocities(t, y, memory):
        return SINGULAR_AHEAD
    if put_next_tangent(memory) < TURNED:
        return OK
    free = scratch.freedoms.number
    if not gram_schmidt(scratch.next_tangent[:free], scratch.triangle, 0.0):
        return SINGULAR
    for k in range(free):
        copy(scratch.next_tangent[k], scratch.tangent[k])
    put_speeds(memory, y)
    return CHANGED


NULL_SPACE = Stabilisation(
    "null-space", "Kim & Vanderploeg 1986", enter, rates, rates, accept, memory=Scratch, watches_rank=True
)
