"""ALF: the augmented Lagrangian iteration on the n x n matrix M + Φ_qᵀ α Φ_q (Eqs. 17 to 20).

    (M + Φ_qᵀ α Φ_q) q̈_{i+1} = M q̈_i + Φ_qᵀ α (γ - 2 ω μ Φ' - ω² Φ),   M q̈_0 = g

Eq. 19 is misprinted: its load has Φ_q q̈_i where the velocity violation Φ' = Φ_q q' - ν belongs, and Φ_q
where Φ does.  Its β is used nowhere.  Eq. 20 stops when the change is ≤ epsilon; here relative to the
larger of 1 and the acceleration.  α weights rows of unit length in the metric of M, so that it does not
depend on units.  The number α multiplies loses digits: rounding is α times that of the accelerations
(see ``alf-dual``).
"""

from __future__ import annotations

from collections.abc import Mapping

from numpy import sqrt

from mbref.formulations.base import Formulation
from mbref.kernels.compilation import exchangeable, kernel
from mbref.kernels.layout import ACCELERATE, FACTORISATIONS, FORMULATION_OPTIONS, NOT_CONVERGED, OK, SINGULAR
from mbref.linear_algebra.elimination import cholesky_factor, cholesky_solve
from mbref.linear_algebra.orthogonal_factorisations import equilibrate
from mbref.linear_algebra.vectors import copy

OPTIONS = {"alpha": 1e5, "epsilon": 1e-9, "iterations": 100.0, "omega": 10.0, "mu": 1.0}


def feedback(options: Mapping[str, float]) -> tuple[float, float]:
    """Gains of Φ' and Φ: 2 ω μ and ω²."""
    return 2 * options["omega"] * options["mu"], options["omega"] ** 2


@kernel
def changed(before, now):
    """Norm of the change relative to the larger of 1 and the norm of ``now`` (Eq. 20)."""
    change, size = 0.0, 0.0
    for j in range(now.shape[0]):
        step = now[j] - before[j]
        change += step * step
        size += now[j] * now[j]
    return sqrt(change / max(1.0, size))


@kernel
def augmented(mass, inverse_root, d, alpha, a):
    """M^(-1/2) (M + Φ_qᵀ α Φ_q) M^(-1/2) from D, its upper half."""
    m, n = d.shape
    for j in range(n):
        for k in range(j, n):
            a[j, k] = 0.0
        a[j, j] = mass[j] * inverse_root[j] * inverse_root[j]
    for i in range(m):
        for j in range(n):
            weight = alpha * d[i, j]
            if weight != 0.0:
                for k in range(j, n):
                    a[j, k] += weight * d[i, k]


@exchangeable(ACCELERATE)
def accelerate(
    mass, inverse_root, jacobian, force, rhs, settings, scratch, pivots, counts, acceleration, multipliers
):
    m, n = jacobian.shape
    alpha, epsilon = settings[FORMULATION_OPTIONS], settings[FORMULATION_OPTIONS + 1]
    d = scratch[: m * n].reshape((m, n))
    a = scratch[m * n : m * n + n * n].reshape((n, n))
    start = m * n + n * n
    load, x = scratch[start : start + n], scratch[start + n : start + 2 * n]
    scaled, total = (
        scratch[start + 2 * n : start + 2 * n + m],
        scratch[start + 2 * n + m : start + 2 * n + 2 * m],
    )
    equilibrate(jacobian, inverse_root, d, multipliers)
    augmented(mass, inverse_root, d, alpha, a)
    counts[FACTORISATIONS] += 1
    if not cholesky_factor(a, n):
        return SINGULAR
    for j in range(n):
        load[j] = force[j] * inverse_root[j]
        acceleration[j] = 0.0
    for i in range(m):
        scaled[i], total[i] = rhs[i] * multipliers[i], 0.0
    status = NOT_CONVERGED
    for _ in range(int(settings[FORMULATION_OPTIONS + 2])):
        for j in range(n):
            x[j] = load[j]
        for i in range(m):
            for j in range(n):
                x[j] += d[i, j] * (alpha * scaled[i])
        cholesky_solve(a, n, x)
        for i in range(m):  # λ grows by α (Φ_q q̈ - γ)
            gap = -scaled[i]
            for j in range(n):
                gap += d[i, j] * x[j]
            total[i] += alpha * gap
        for j in range(n):
            load[j] = mass[j] * inverse_root[j] * inverse_root[j] * x[j]
            x[j] *= inverse_root[j]
        change = changed(acceleration, x)
        copy(x, acceleration)
        if change <= epsilon:
            status = OK
            break
    for i in range(m):
        multipliers[i] *= total[i]
    return status


ALF = Formulation(
    name="alf",
    equations="Eqs. 17-20",
    accelerate=accelerate,
    scratch=lambda m, n: m * n + n * n + 2 * n + 2 * m,
    handles_redundancy=True,
    handles_singular_mass=True,
    iterative=True,
    options=OPTIONS,
    feedback=feedback,
)
