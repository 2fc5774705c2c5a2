"""Coordinates (r, p) of every body with pᵀp - 1 = 0: residuals, Jacobian, velocities, second derivatives."""

from __future__ import annotations

from numpy import sqrt

from mbref.equations.coordinates import coordinate_rates
from mbref.kernels.compilation import kernel


@kernel
def jacobian_by_euler_parameters(q, equations, a):
    """Compute [Φ_r Φ_p; 0 2pᵀ] (m + nb, 7 nb) at the state of the last evaluation; Φ_p = 2 Φ_π' L."""
    bodies, blocks = equations.scene.row_bodies, equations.system.blocks
    m, nb = bodies.shape[0], q.shape[0] // 7
    a[:] = 0.0
    for row in range(m):
        for side in range(bodies.shape[1]):
            b = bodies[row, side]
            if b < nb:
                i, j = 7 * b, 6 * side
                for k in range(3):
                    a[row, i + k] = blocks[row, j + k]
                r1, r2, r3 = 2 * blocks[row, j + 3], 2 * blocks[row, j + 4], 2 * blocks[row, j + 5]
                w, x, y, z = q[i + 3], q[i + 4], q[i + 5], q[i + 6]
                a[row, i + 3] = -x * r1 - y * r2 - z * r3
                a[row, i + 4] = w * r1 - z * r2 + y * r3
                a[row, i + 5] = z * r1 + w * r2 - x * r3
                a[row, i + 6] = -y * r1 + x * r2 + w * r3
    for b in range(nb):
        for k in range(3, 7):
            a[m + b, 7 * b + k] = 2.0 * q[7 * b + k]


@kernel
def scale_by_lengths(scene, a, rows, columns):
    """Scale displacements by the length √(I / m) of each body, and the rows of a (m + nb, 7 nb) to the length
    1; compute the factors on rows and columns. So the largest pivots do not depend on the unit of length."""
    for j in range(columns.shape[0]):
        b = j // 7
        if j - 7 * b < 3:
            columns[j] = scene.metric_root[6 * b] / scene.metric_root[6 * b + 3]
    for i in range(rows.shape[0]):
        square = 0.0
        for j in range(columns.shape[0]):
            a[i, j] *= columns[j]
            square += a[i, j] * a[i, j]
        if square > 0.0:
            rows[i] = 1.0 / sqrt(square)
            for j in range(columns.shape[0]):
                a[i, j] *= rows[i]


@kernel
def velocities_of_rates(state):
    """Compute v from q': r' and ω' = 2 L p'."""
    q, q_rate, v = state.coordinates, state.coordinate_rates, state.velocities
    for body in range(q.shape[0] // 7):
        i, j = 7 * body, 6 * body
        for k in range(3):
            v[j + k] = q_rate[i + k]
        w, x, y, z = q[i + 3], q[i + 4], q[i + 5], q[i + 6]
        dw, dx, dy, dz = q_rate[i + 3], q_rate[i + 4], q_rate[i + 5], q_rate[i + 6]
        v[j + 3] = 2.0 * (-x * dw + w * dx + z * dy - y * dz)
        v[j + 4] = 2.0 * (-y * dw - z * dx + w * dy + x * dz)
        v[j + 5] = 2.0 * (-z * dw + y * dx - x * dy + w * dz)


@kernel
def second_rates(acceleration, state):
    """Compute q'' from the accelerations: r'' and p'' = ½ Lᵀ ω̇' - ¼ (ω'·ω') p."""
    q, v, second = state.coordinates, state.velocities, state.coordinate_second
    coordinate_rates(q, acceleration, second)
    for body in range(q.shape[0] // 7):
        j = 6 * body
        square = 0.25 * (v[j + 3] * v[j + 3] + v[j + 4] * v[j + 4] + v[j + 5] * v[j + 5])
        for k in range(3, 7):
            second[7 * body + k] -= square * q[7 * body + k]


@kernel
def residual_of_rows(q, phi, rows, residual):
    """Compute Φ and pᵀp - 1 of the given rows into the residual; return the largest."""
    m, size = phi.shape[0], 0.0
    for i in range(rows.shape[0]):
        row = rows[i]
        if row < m:
            residual[i] = phi[row]
        else:
            j = 7 * (row - m) + 3
            w, x, y, z = q[j], q[j + 1], q[j + 2], q[j + 3]
            residual[i] = w * w + x * x + y * y + z * z - 1.0
        if not abs(residual[i]) <= size:
            size = abs(residual[i])
    return size
