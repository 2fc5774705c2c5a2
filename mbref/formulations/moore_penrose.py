"""What the Moore–Penrose formulations share: Eq. 26 around the product D⁺ b.

    q̈ = q̈_unc + M^(-1/2) D⁺ (γ - Φ_q q̈_unc),   D = Φ_q M^(-1/2),   q̈_unc = M⁻¹ g

with the rows of D scaled to unit length, so that the rank does not depend on units.
"""

from __future__ import annotations

from mbref.kernels.compilation import kernel
from mbref.linear_algebra.orthogonal_factorisations import equilibrate


@kernel
def begin(mass, inverse_root, jacobian, force, rhs, d, b, acceleration, row_scale):
    """D, b = γ - Φ_q q̈_unc in scaled rows, and q̈_unc; False where M is singular."""
    m, n = jacobian.shape
    equilibrate(jacobian, inverse_root, d, row_scale)
    for j in range(n):
        if not mass[j] > 0.0:
            return False
        acceleration[j] = force[j] / mass[j]
    for i in range(m):
        b[i] = rhs[i]
    for j in range(n):
        for i in range(m):
            b[i] -= jacobian[i, j] * acceleration[j]
    for i in range(m):
        b[i] *= row_scale[i]
    return True


@kernel
def transpose(d, dt):
    """dt (n, m) := Dᵀ."""
    m, n = d.shape
    for j in range(n):
        for i in range(m):
            dt[j, i] = d[i, j]


@kernel
def finish(inverse_root, x, dual, acceleration, multipliers):
    """q̈ from x = D⁺ b, and λ = -R (Dᵀ)⁺ x; the row scale R stands in ``multipliers``."""
    for j in range(x.shape[0]):
        acceleration[j] += inverse_root[j] * x[j]
    for i in range(dual.shape[0]):
        multipliers[i] *= -dual[i]
