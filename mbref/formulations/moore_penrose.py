"""The common part of the Moore–Penrose formulations: Eq. 26 around the product D⁺ b.

    q̈ = q̈_unc + M^(-1/2) D⁺ (γ - Φ_q q̈_unc),   D = Φ_q M^(-1/2),   q̈_unc = M⁻¹ g

with the rows of D scaled to unit length, so that the rank does not depend on units.
"""

from __future__ import annotations

from mbref.kernels.compilation import kernel
from mbref.linear_algebra.orthogonal_factorisations import equilibrate


@kernel
def scaled_residual(system, d, b):
    """Compute D, b = γ - Φ_q q̈_unc in scaled rows, and q̈_unc; return False if M is singular.

    The row scale is stored in ``system.multipliers``.
    """
    jacobian, acceleration, row_scale = system.jacobian, system.acceleration, system.multipliers
    m, n = jacobian.shape
    equilibrate(jacobian, system.inverse_root, d, row_scale)
    for j in range(n):
        if not system.mass[j] > 0.0:
            return False
        acceleration[j] = system.force[j] / system.mass[j]
    for i in range(m):
        b[i] = system.rhs[i]
    for j in range(n):
        for i in range(m):
            b[i] -= jacobian[i, j] * acceleration[j]
    for i in range(m):
        b[i] *= row_scale[i]
    return True


@kernel
def transpose(d, dt):
    """Compute dt (n, m) = Dᵀ."""
    m, n = d.shape
    for j in range(n):
        for i in range(m):
            dt[j, i] = d[i, j]


@kernel
def recover_solution(x, dual, system):
    """Compute q̈ from x = D⁺ b, and λ = -R (Dᵀ)⁺ x; the row scale R is in ``system.multipliers``."""
    for j in range(x.shape[0]):
        system.acceleration[j] += system.inverse_root[j] * x[j]
    for i in range(dual.shape[0]):
        system.multipliers[i] *= -dual[i]
