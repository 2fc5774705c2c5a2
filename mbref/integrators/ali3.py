"""ALi3-P: the index-3 augmented Lagrangian by the trapezoidal rule, with projected rates.

One step of h seconds finds q = q_n ⊕ Δ with v = 2 Δ / h - v_n and a = 2 (v - v_n) / h - a_n (trapezoidal
rule) from

    M a + Φ_qᵀ (λ* + α Φ) = g(q, v, t),    λ* := λ* + α Φ after each iteration,

by Newton's method with the matrix (4 / h²) M + Φ_qᵀ α Φ_q; v and a are then moved by the least change in the
metric of M on to Φ_q v = ν and Φ_q a = γ with the same factor (Bayo & Ledesma, Nonlinear Dynamics 9, 1996;
Cuadrado, Cardenal, Morer & Bayo, Multibody Syst. Dyn. 4, 2000).  The change of g with q and v is left out of
the matrix, which a stiff force needs: there the iteration does not converge, and the outcome says so.  All
three solutions are iterations of ``formulations.alf``; α is α_unit 4 / h² in its unit rows, so that neither
units nor h decide.  Redundant rows are borne, and a fixed step goes over a singular position without seeing
it.

Of order 2.  Its own accelerations serve the next step; samples record accelerations of the formulation.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from mbref.equations.coordinates import contract, displace
from mbref.equations.evaluation import assemble_jacobian, assemble_system
from mbref.formulations import alf
from mbref.integrators.base import Integrator
from mbref.integrators.one_step import propose
from mbref.kernels.compilation import exchangeable, kernel
from mbref.kernels.layout import NOT_CONVERGED, OK, SINGULAR, STEP
from mbref.kernels.named_memory import Vector, opener
from mbref.linear_algebra.elimination import cholesky_factor
from mbref.linear_algebra.orthogonal_factorisations import equilibrate
from mbref.linear_algebra.vectors import copy, largest

ALPHA = 1e5  # α_unit: an iteration leaves about 1 / ALPHA of a violation; rounding grows by ALPHA
MOST_ITERATIONS = 50
CONVERGED = 1e-6  # largest entry of a correction / of Δ; the next correction is smaller by 1 / ALPHA
ROUNDING = 10.0  # tolerances of a violation (m or rad): a smaller correction is rounding
PROJECTIONS = 3  # iterations of a projection: ALPHA to that power is beyond rounding


class Scratch(NamedTuple):
    """The iteration in unit rows and the metric of M, and the accelerations and multipliers carried on."""

    augmented: alf.Scratch
    row_scale: Annotated[Vector, "m"]
    displacement: Annotated[Vector, "n"]  # Δ
    correction: Annotated[Vector, "n"]
    change: Annotated[Vector, "7*nb"]
    before: Annotated[Vector, "n"]  # a_n
    acceleration: Annotated[Vector, "n"]  # a
    multipliers: Annotated[Vector, "m"]  # λ*


scratch_of = opener(Scratch)


@kernel
def carry_on(h, memory):
    """a_n and λ* of the step before, or of the formulation at a start; the first Δ = h v_n + ½ h² a_n."""
    scratch, system, n = (
        scratch_of(memory.integrator),
        memory.equations.system,
        memory.previous.velocities.shape[0],
    )
    if system.counts.steps == memory.loop.clock.restart:
        copy(system.acceleration, scratch.acceleration)
        copy(system.multipliers, scratch.multipliers)
    copy(scratch.acceleration, scratch.before)
    for j in range(n):
        velocity = memory.previous.velocities[j]
        scratch.displacement[j] = h * velocity + 0.5 * h * h * scratch.before[j]


@kernel
def put_trial_state(h, memory):
    """q_n ⊕ Δ and the velocities of the trapezoidal rule into ``memory.state``, with their accelerations."""
    scratch, state, last = scratch_of(memory.integrator), memory.state, memory.previous
    copy(last.coordinates, state.coordinates)
    displace(state.coordinates, scratch.displacement, scratch.change)
    for j in range(state.velocities.shape[0]):
        v = 2.0 * scratch.displacement[j] / h - last.velocities[j]
        state.velocities[j] = v
        scratch.acceleration[j] = 2.0 * (v - last.velocities[j]) / h - scratch.before[j]


@kernel
def factorise(equations, scratch):
    """D = Φ_q M^(-1/2) in unit rows, and the factor of 1 + α_unit Dᵀ D; False where it does not exist."""
    d, root = scratch.augmented.d, equations.system.inverse_root
    assemble_jacobian(equations, d)
    equilibrate(d, root, d, scratch.row_scale)
    alf.augmented(equations.system.mass, root, d, ALPHA, scratch.augmented.matrix)
    equations.system.counts.factorisations += 1
    return cholesky_factor(scratch.augmented.matrix, root.shape[0])


@kernel
def correct(h, equations, scratch):
    """One iteration of Newton's method: Δ and λ* changed; the largest entry of the change of Δ."""
    system, inner, scale, quarter = equations.system, scratch.augmented, scratch.row_scale, 0.25 * h * h
    for j in range(system.force.shape[0]):
        inertia = system.mass[j] * scratch.acceleration[j]
        inner.load[j] = quarter * system.inverse_root[j] * (system.force[j] - inertia)
    for i in range(scale.shape[0]):
        inner.total[i] = quarter * scratch.multipliers[i] / scale[i]
        inner.scaled[i] = -scale[i] * equations.rows.phi[i]
        for j in range(inner.load.shape[0]):
            inner.load[j] -= inner.d[i, j] * inner.total[i]
    alf.iterate(ALPHA, inner)
    for i in range(scale.shape[0]):
        scratch.multipliers[i] = inner.total[i] * scale[i] / quarter
    for j in range(inner.x.shape[0]):
        scratch.correction[j] = system.inverse_root[j] * inner.x[j]
        scratch.displacement[j] += scratch.correction[j]
    return largest(scratch.correction)


@kernel
def find_positions(t, h, memory):
    """Δ of the step that ends at time t (s), its state into ``memory.state``; the status."""
    scratch, equations, state = scratch_of(memory.integrator), memory.equations, memory.state
    rounding = ROUNDING * equations.system.settings.newton_tolerance
    for _ in range(MOST_ITERATIONS):
        put_trial_state(h, memory)
        assemble_system(t, state.coordinates, state.velocities, equations)
        if not factorise(equations, scratch):
            return SINGULAR
        equations.system.counts.newton += 1
        change = correct(h, equations, scratch)
        if change <= max(rounding, CONVERGED * largest(scratch.displacement)):
            put_trial_state(h, memory)
            return OK
    return NOT_CONVERGED


@kernel
def project(vector, wanted, system, scratch):
    """Move a vector (n,) on to Φ_q x = ``wanted`` (m,), by the least change in the metric of M."""
    inner = scratch.augmented
    for j in range(vector.shape[0]):
        inner.x[j] = system.mass[j] * system.inverse_root[j] * vector[j]
    for i in range(wanted.shape[0]):
        inner.scaled[i], inner.total[i] = scratch.row_scale[i] * wanted[i], 0.0
    for _ in range(PROJECTIONS):
        copy(inner.x, inner.load)
        alf.iterate(ALPHA, inner)
    for j in range(vector.shape[0]):
        vector[j] = system.inverse_root[j] * inner.x[j]


@exchangeable(STEP)
def step(rates, t, h, y, y_rate, y_new, memory):
    scratch, state, equations = scratch_of(memory.integrator), memory.state, memory.equations
    carry_on(h, memory)
    status = find_positions(t + h, h, memory)
    if status != OK:
        return -float(status)
    assemble_system(t + h, state.coordinates, state.velocities, equations)
    if not factorise(equations, scratch):
        return -float(SINGULAR)
    project(state.velocities, equations.rows.nu, equations.system, scratch)
    assemble_system(t + h, state.coordinates, state.velocities, equations)
    project(scratch.acceleration, equations.rows.gamma, equations.system, scratch)
    contract(state.coordinates, state.velocities, memory.active, y_new)
    return 0.0


ALI3 = Integrator(
    "ali3", 2, step, propose, Scratch, adaptive=False, options={"step": 1e-3}, holds_constraints=True
)
